// Fills pages with groups, and puts pages of points and nodes into the order of the file.
//
// Groups arrive in post-order. Each goes to the open page of its stream, which is its level or a
// few neighbouring levels, so that a reader that stops at one level reads a compact run of pages:
//
//   level 0   . . . . . . . [        ]     held: pages of the coarser levels wait for the end, and
//   level 1   . . [        ][        ]     leave level by level, the coarsest ones into the tail
//   ------------------------------------ cut: rises when the pages that are held take too much
//   level 2   [ page 1 ][ page 3 ][ 7 ]    full pages leave some at a time, level by level
//   points    [0][2][5][6]                 a point page leaves before the groups that end in it
//
// A page ends early where a cell begins that is not expected to fit into what is left of it, so
// that fewer pages hold what is in a region.
//
// The page of a group is known when the group is added, its rank is not: a held page has a
// provisional number, which references to it keep until the page that they lie on leaves.
#pragma once

#include <algorithm>
#include <array>
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

/// Returns a page of points that has no rank yet.
/// @param points  1 to points_per_page, ascending
[[nodiscard]] ContainerWriter::Page point_page(std::span<const PointRecord> points,
                                               std::uint8_t point_bytes);

/// Collects groups in node pages, with one open page for each stream of levels, and emits pages in
/// their final order. A page below the cut gets its rank when it is opened, so that parents can
/// refer to groups that are not on disk yet, and is emitted together with others when it is full.
/// Pages of the coarser levels are held until finish_held(). A point page is emitted before the
/// groups that end in it.
/// Memory: one open page for each stream, held_limit() and leaving_limit().
class PageOrder : public GroupSink {
 public:
  using Page = ContainerWriter::Page;

  // Files depend on these limits, so that no option changes them.
  /// Returns the most bytes of pages that are held until the end: 256 pages, and at most 16 MiB.
  [[nodiscard]] static constexpr std::uint64_t held_limit(std::uint8_t page_shift) noexcept {
    return std::min(std::uint64_t{256} << page_shift, std::uint64_t{16} << 20);
  }
  /// Returns the most bytes of full pages that leave together: 64 pages, and at most 4 MiB.
  [[nodiscard]] static constexpr std::uint64_t leaving_limit(std::uint8_t page_shift) noexcept {
    return held_limit(page_shift) / 4;
  }

  /// @param writer             gives out ranks; must outlive this
  /// @param levels_per_stream  see BuildOptions
  PageOrder(ContainerWriter& writer, std::uint32_t points_per_page, int levels_per_stream);

  /// Adds the next page of points, which gets its rank when it is emitted.
  void add(Page points) { points_.push_back(std::move(points)); }
  /// Adds a group to the page of its stream.
  /// @return  the page and slot that it will lie in; the page may be a provisional number
  /// @throws std::invalid_argument when it emits light, and points of the container have no
  /// emission
  ChildRef add(const GroupView& group, std::uint64_t end) override;
  /// Returns the pages emitted since the last call.
  [[nodiscard]] std::vector<Page> take() noexcept { return std::exchange(whole_, {}); }
  /// Emits all pages that are left but those that are held, the deepest level first.
  void finish();
  /// Hands the pages that are held to the writer, the deepest level first, the root last. The last
  /// ones are for the tail. @pre finish(), and what take() returned was written
  void finish_held(const Executor& executor);
  /// Returns a reference of add() with the page's rank. @pre finish_held()
  [[nodiscard]] ChildRef placed(ChildRef ref) const noexcept;
  /// Returns whether add() may have returned a page of this number.
  [[nodiscard]] bool knows(std::uint32_t page) const;

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
    std::uint8_t min_level = kNoLevel;
    void include(const GroupView& group);
  };
  /// The open page of a stream of levels.
  struct Open {
    std::uint32_t page;  ///< rank, or a provisional number
    NodePageEncoder encoder;
    Range keys{};
  };
  /// How many bytes the groups of a stream take in cells of each size. Cells of height h are those
  /// in which the high halves of keys differ in the last h octal digits alone.
  struct Cells {
    std::uint64_t key = 0;                         ///< high half of the last group's cell
    std::uint64_t bytes = 0;                       ///< of all groups; 0: there was none
    std::array<std::uint64_t, kHalfBits> begin{};  ///< `bytes` where the cell of height h began
    std::array<std::uint64_t, kHalfBits> mean{};   ///< of ended cells of height h; 0: there is none
    /// Ends the cells that a group is not in.
    /// @param next  high half of the group's cell
    /// @return  expected bytes of the largest cell that begins with the group; 0: not known
    std::uint64_t enter(std::uint64_t next);
  };
  /// A full page that waits for the end.
  struct Held {
    std::uint32_t page;  ///< provisional number; of a page of a state, also a rank
    Page content;
  };
  /// Some neighbouring levels.
  struct Stream {
    std::optional<Open> open;
    Cells cells;
    std::vector<Held> held;
  };

  [[nodiscard]] bool holds(const Stream& stream) const noexcept {
    return &stream < streams_.data() + cut_;
  }
  void open(Stream& stream);
  void close(Stream& stream);
  void evict();
  void place(std::uint32_t rank, Page& page) const;
  void emit(std::uint32_t rank, Page page);
  void emit_leaving();
  void place_references(Page& page) const;
  void take_points();
  void save_open(const Stream& stream, StateWriter& state) const;
  void load_open(StateReader& state, Stream& stream, std::uint64_t points);
  void load_held(StateReader& state, Stream& stream, std::uint64_t points);
  void save_page(std::uint32_t number, const Page& page, StateWriter& state) const;
  [[nodiscard]] Held load_page(StateReader& state, std::uint64_t points) const;
  [[nodiscard]] NodePage load_groups(StateReader& state, std::vector<std::byte>& payload,
                                     std::uint32_t groups, std::uint64_t points) const;

  ContainerWriter& writer_;
  std::uint32_t points_per_page_;
  int levels_per_stream_;
  std::size_t payload_limit_;
  bool may_emit_;
  std::uint64_t held_limit_;          ///< held_limit()
  std::uint64_t leaving_limit_;       ///< leaving_limit()
  std::vector<Stream> streams_;       ///< by level / levels_per_stream_
  std::size_t cut_;                   ///< streams below this index are held
  std::uint64_t held_bytes_ = 0;      ///< payloads of pages that are held; open ones count as full
  std::vector<Page> leaving_;         ///< full pages below the cut that are not emitted yet
  std::uint64_t leaving_bytes_ = 0;   ///< of their payloads
  std::vector<std::uint32_t> ranks_;  ///< by provisional number; kNoPage: not known yet
  std::deque<Page> points_;           ///< point pages not emitted yet
  std::uint64_t next_point_ = 0;      ///< number of their first point
  std::vector<Page> whole_;           ///< pages emitted and not taken yet
};

/// Saves points, for load_points().
void save_points(std::span<const PointRecord> points, StateWriter& state);
/// Returns the points of a page in a state.
/// @param point_bytes  bytes of a point; save_points() uses kEmittingPointBytes
/// @throws DataError, FormatError when they break a rule of points
[[nodiscard]] std::vector<PointRecord> load_points(StateReader& state,
                                                   std::uint8_t point_bytes = kEmittingPointBytes);

}  // namespace ptc
