// Fills pages with groups, and puts pages of points and nodes into the order of the file.
//
// Groups arrive in post-order. Each goes to the open page of its stream, which is its level or a
// few neighbouring levels, so that a reader that stops at one level reads a compact run of pages:
//
//   level 0   . . . . . . . [  page 9   ]     open pages, numbered when they were opened
//   level 1   . . [ page 4 ][  page 8   ]
//   level 2   [ page 1 ][ page 3 ][ 7 ]       full pages leave in the order in which they fill up
//   points    [0][2][5][6]                    a point page leaves before the groups that end in it
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

/// Returns a page of points that has no number yet.
/// @param points  1 to points_per_page, ascending
[[nodiscard]] ContainerWriter::Page point_page(std::span<const PointRecord> points);

/// Collects groups in node pages, with one open page for each stream of levels, and emits pages in
/// their final order. A node page gets its number when it is opened, so that parents can refer to
/// groups that are not on disk yet, and is emitted when it is full. A point page is emitted before
/// the groups that end in it.
class PageOrder : public GroupSink {
 public:
  using Page = ContainerWriter::Page;

  /// @param writer             gives out page numbers; must outlive this
  /// @param levels_per_stream  see BuildOptions
  PageOrder(ContainerWriter& writer, std::uint32_t points_per_page, int levels_per_stream);

  /// Adds the next page of points, which gets its number when it is emitted.
  void add(Page points) { points_.push_back(std::move(points)); }
  /// Adds a group to the page of its stream. @return the page and slot that it will lie in
  ChildRef add(const GroupView& group, std::uint64_t end) override;
  /// Returns the pages emitted since the last call.
  [[nodiscard]] std::vector<Page> take() noexcept { return std::exchange(whole_, {}); }
  /// Emits all pages that are left. Open node pages go deepest level first, so that the coarse
  /// levels are last in the file.
  void finish();

  /// Saves the state between two calls. @pre all emitted pages were taken
  void save(StateWriter& state) const;
  /// Resumes from a saved state, with a writer that resumed from the same place.
  /// @param points  number of points added before
  /// @throws DataError, FormatError when the state is invalid
  void load(StateReader& state, std::uint64_t points);

 private:
  /// The facts of a node page that follow from its groups.
  struct Range {
    std::uint64_t first = ~std::uint64_t{0};
    std::uint64_t last = 0;
    std::uint16_t min_level = 0xffff;
    void include(const GroupView& group);
  };
  /// The open page of a stream of levels.
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
  std::vector<std::optional<Stream>> streams_;  ///< by level / levels_per_stream_
  std::deque<Page> points_;                     ///< point pages not emitted yet
  std::uint64_t next_point_ = 0;                ///< number of their first point
  std::vector<Page> whole_;                     ///< pages emitted and not taken yet
};

/// Saves points, for load_points().
void save_points(std::span<const PointRecord> points, StateWriter& state);
/// Returns the points that save_points() saved.
/// @throws DataError, FormatError when they break a rule of points
[[nodiscard]] std::vector<PointRecord> load_points(StateReader& state);

}  // namespace ptc
