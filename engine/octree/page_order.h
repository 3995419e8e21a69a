// Pages of points and nodes in the order of the file.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "engine/io/file/state_file.h"
#include "engine/octree/octree.h"
#include "engine/store/writer.h"
#include "format/node_page.h"
#include "format/point_record.h"

namespace ptc {

/// A page of points, its number not given yet. @param points  1 to points_per_page, ascending
[[nodiscard]] ContainerWriter::Page point_page(std::span<const PointRecord> points);

/// A node page is there when it is full, one open page per stream of levels; it gets its number
/// when it is opened, so that parents can refer to groups that are not on the disk yet. A point
/// page comes before the groups that end in it.
class PageOrder : public GroupSink {
 public:
  using Page = ContainerWriter::Page;

  /// @param writer  gives page numbers; must outlive this
  PageOrder(ContainerWriter& writer, std::uint32_t points_per_page, int levels_per_stream);

  /// The next page of points; its number is given later.
  void add(Page points) { points_.push_back(std::move(points)); }
  ChildRef add(const GroupView& group, std::uint64_t end) override;
  /// The pages that are whole.
  [[nodiscard]] std::vector<Page> take() noexcept { return std::exchange(whole_, {}); }
  /// Adds all others; of nodes those still open, deepest first: the coarse levels end up last in
  /// the file.
  void finish();

  /// What there is between two calls, when all whole pages were taken.
  void save(StateWriter& state) const;
  /// Takes it up, with a writer that has gone on from the same moment.
  /// @param points  in the pages so far @throws DataError, FormatError
  void load(StateReader& state, std::uint64_t points);

 private:
  struct Range {
    std::uint64_t first = ~std::uint64_t{0};
    std::uint64_t last = 0;
    std::uint16_t min_level = 0xffff;
    void include(const GroupView& group);
  };
  struct Stream {
    std::uint32_t page;
    NodePageEncoder encoder;
    Range keys{};
  };

  void take_points();
  void flush(std::optional<Stream>& stream);
  void load_stream(StateReader& state, std::optional<Stream>& stream, std::uint64_t points);

  ContainerWriter& writer_;
  std::uint32_t points_per_page_;
  int levels_per_stream_;
  std::size_t payload_limit_;
  std::vector<std::optional<Stream>> streams_;
  std::deque<Page> points_;       ///< not yet taken
  std::uint64_t next_point_ = 0;  ///< first of these
  std::vector<Page> whole_;
};

/// Points as a StateWriter keeps them.
void save_points(std::span<const PointRecord> points, StateWriter& state);
/// @throws DataError, FormatError when they break a rule of points
[[nodiscard]] std::vector<PointRecord> load_points(StateReader& state);

}  // namespace ptc
