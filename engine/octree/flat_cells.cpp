// A stack holds what has been seen of the cells that are open at the current point: clusters, each
// a surfel or a whole cell. `join` of a cluster is the level of the smallest cell that holds it and
// the cluster below it on the stack.
//
//   join   4 6 6 | 3     the next point joins at level 3, so the cell of level 6, of the three
//          A B C   next  clusters A B C, is complete: they become one cluster, or all go out
//
// A cluster that a disc of its area covers becomes one surfel. Another one keeps its surfels, and
// may still be a part of a larger one that does. When a cell is too large, bends too much or is lit
// unevenly, all cells around it are: the whole stack goes out.
//
// Surfels that face to one side of a direction have a stack of their own, and those that face to
// the other: so both sides of a sheet are merged. What goes out of the two is put into one order
// again, and waits for what may still come before it. That is not much, because cells that are wide
// for their surfels are not merged.
#include "engine/octree/flat_cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <optional>
#include <ranges>
#include <span>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>

#include "engine/octree/cluster_sums.h"
#include "format/morton.h"
#include "format/point_record.h"
#include "format/scalar.h"

namespace ptc {
namespace {

// The greatest edge of a cell that is merged, in radii that its least surfel may grow to. A wall
// takes a square of sqrt(2) of them, or somewhat more of a cell that it crosses at an angle.
constexpr double kWidest = 4;

/// A surfel, or the surfels of a cell.
struct Cluster {
  ClusterSums sums;                 ///< over the surfels that came
  int join = -1;                    ///< see above; -1 for the first one of all
  std::vector<PointRecord> points;  ///< that stand for them
  MergeCounts counts;
};

ClusterSums sums_of(std::span<const Cluster> clusters) {
  ClusterSums all = clusters.front().sums;
  for (const Cluster& cluster : clusters.subspan(1)) all.add(cluster.sums);
  all.reach = 0;
  for (const Cluster& cluster : clusters)
    all.reach =
        std::max(all.reach, glm::distance(cluster.sums.mean, all.mean) + cluster.sums.reach);
  return all;
}

/// The limits of a merge, and what it asks.
struct Rules {
  double unit;
  Flatness most;
  const SurfaceGoesOn& goes_on;
  MergeCounts& counts;
  const MortonKey& handed_out;  ///< no surfel may come before this key any more
};

/// The surfels that face to one side. Those that face the other way may lie at the same places, as
/// they do on a sheet of which both sides are seen.
class Side {
 public:
  explicit Side(const Rules& rules) : rules_(rules) {}

  void take(const PointRecord& point) {
    const int level = before_ ? common_level(*before_, point.key) : -1;
    close(level);
    before_ = point.key;
    const ClusterSums sums(point, rules_.unit);
    open_.push_back({sums, level, {point}, sums.counts(false)});
    // Neither surfels at one place nor those without an area become one
    if (level == kLatticeBits || !(sums.area > 0)) flush();
  }

  void end() {
    close(-1);
    flush();
  }

  /// Hands out what no point from a key on can be merged with. @pre take() had no later one
  void pass(const MortonKey& key) {
    if (open_.empty()) return;
    close(common_level(*before_, key));
    while (!open_.empty() &&
           common_level(open_.front().points.front().key, key) < widest_of(open_.front().sums)) {
      hand_out(open_.front());
      open_.erase(open_.begin());
    }
  }

  /// Returns a key that no surfel which is still open will precede; nothing when none is open.
  [[nodiscard]] std::optional<MortonKey> begin_of_open() const {
    if (open_.empty()) return std::nullopt;
    return cell_of(open_.front().points.front().key, widest_of(open_.front().sums));
  }

  std::vector<PointRecord> ready;  ///< to be handed out, by ascending key

 private:
  /// Closes all cells below a level.
  void close(int level) {
    while (!open_.empty() && open_.back().join > level) {
      // The clusters of the smallest cell are those of its level, and the one before them
      const int cell = open_.back().join;
      std::size_t begin = open_.size() - 1;
      while (begin > 0 && open_[begin].join == cell) --begin;
      if (open_[begin].join == cell || !merge(begin)) flush();  // or the one before went out
    }
  }

  /// Makes the open clusters from `begin` on one. Returns false, and leaves them, when they may not
  /// be.
  bool merge(std::size_t begin) {
    const int cell = open_.back().join;
    const ClusterSums sums = sums_of(std::span(open_).subspan(begin));
    if (cell < widest_of(sums) || !sums.is_flat(rules_.most)) return false;
    Cluster& all = open_[begin];
    all.sums = sums;
    const PointRecord one = sums.surfel(all.points.front(), cell, rules_.unit);
    if (sums.is_round(rules_.most) && one.key >= rules_.handed_out &&
        rules_.goes_on(one, static_cast<float>(sums.finest() * rules_.unit))) {
      all.points = {one};
      all.counts = sums.counts(true);
    } else {
      for (std::size_t i = begin + 1; i < open_.size(); ++i) {
        all.points.insert(all.points.end(), open_[i].points.begin(), open_[i].points.end());
        all.counts += open_[i].counts;
      }
    }
    open_.erase(open_.begin() + static_cast<std::ptrdiff_t>(begin) + 1, open_.end());
    return true;
  }

  /// Returns the level of the widest cell that may be merged with these surfels in it.
  [[nodiscard]] int widest_of(const ClusterSums& sums) const {
    const double edge = std::max(kWidest * rules_.most.growth * sums.least, 1.0);
    return std::max(kLatticeBits - std::min(std::ilogb(edge), kLatticeBits), 0);
  }

  void hand_out(const Cluster& cluster) {
    ready.insert(ready.end(), cluster.points.begin(), cluster.points.end());
    rules_.counts += cluster.counts;
  }

  /// Hands all open clusters out.
  void flush() {
    for (const Cluster& cluster : open_) hand_out(cluster);
    open_.clear();
  }

  const Rules& rules_;
  std::optional<MortonKey> before_;  ///< of the point that came last
  std::vector<Cluster> open_;        ///< at most 8 for each level
};

/// The stream that merge_flat_cells() returns.
class FlatCellStream : public PointStream {
 public:
  FlatCellStream(PointStream& sorted, double unit, const Flatness& most,
                 const SurfaceGoesOn& goes_on, MergeCounts& counts)
      : sorted_(sorted), rules_{unit, most, goes_on, counts, handed_out_}, block_(kBlock) {}

  std::size_t next(std::span<PointRecord> out) override {
    while (done_ == ready_.size() && !ended_) {
      const std::size_t count = fill();
      for (const PointRecord& point : std::span(block_).first(count)) side_of(point).take(point);
      for (Side& side : sides_) {
        if (count > 0) {
          side.pass(block_[count - 1].key);
        } else {
          side.end();
        }
      }
      ended_ = count == 0;
      collect(block_[count > 0 ? count - 1 : 0].key);
    }
    const std::size_t count = std::min(out.size(), ready_.size() - done_);
    std::copy_n(ready_.begin() + static_cast<std::ptrdiff_t>(done_), count, out.begin());
    done_ += count;
    return count;
  }

 private:
  static constexpr std::size_t kBlock = 4096;  // points that are taken at once

  /// Fills the block, so that it does not matter how many points the source yields at once.
  /// @return the number of points; 0 at the end
  std::size_t fill() {
    std::size_t count = 0;
    while (count < kBlock) {
      const std::size_t more = sorted_.next(std::span(block_).subspan(count));
      if (more == 0) break;
      count += more;
    }
    return count;
  }

  Side& side_of(const PointRecord& point) {
    // No wall that is parallel to an axis or to a diagonal lies along this direction
    constexpr std::array<double, 3> kAlong{0.80, 0.51, 0.33};
    const auto n = decode_octahedral_f64(point.normal[0], point.normal[1]);
    return sides_[n[0] * kAlong[0] + n[1] * kAlong[1] + n[2] * kAlong[2] < 0 ? 1 : 0];
  }

  /// Returns a key that no surfel which is still open on either side will precede.
  [[nodiscard]] std::optional<MortonKey> begin_of_open() const {
    std::optional<MortonKey> first;
    for (const Side& side : sides_) {
      const auto begin = side.begin_of_open();
      if (begin && (!first || *begin < *first)) first = begin;
    }
    return first;
  }

  /// Moves what nothing can precede any more from both sides into ready_, in order.
  /// @param last  key of the point that was taken last
  void collect(const MortonKey& last) {
    ready_.clear();
    done_ = 0;
    const std::optional<MortonKey> until = begin_of_open();
    handed_out_ = until.value_or(last);
    std::array<std::size_t, 2> count{};
    for (std::size_t i = 0; i < 2; ++i) {
      const auto& ready = sides_[i].ready;
      count[i] = ready.size();
      if (until) {
        count[i] = static_cast<std::size_t>(
            std::ranges::lower_bound(ready, *until, {}, &PointRecord::key) - ready.begin());
      }
    }
    const auto end_of = [&](std::size_t i) {
      return sides_[i].ready.begin() + static_cast<std::ptrdiff_t>(count[i]);
    };
    std::ranges::merge(std::ranges::subrange(sides_[0].ready.begin(), end_of(0)),
                       std::ranges::subrange(sides_[1].ready.begin(), end_of(1)),
                       std::back_inserter(ready_), {}, &PointRecord::key, &PointRecord::key);
    for (std::size_t i = 0; i < 2; ++i) sides_[i].ready.erase(sides_[i].ready.begin(), end_of(i));
  }

  PointStream& sorted_;
  MortonKey handed_out_;  ///< what has been handed out lies before it, or at it
  const Rules rules_;
  std::array<Side, 2> sides_{Side(rules_), Side(rules_)};
  std::vector<PointRecord> block_;
  std::vector<PointRecord> ready_;  ///< to be handed out
  std::size_t done_ = 0;            ///< of them
  bool ended_ = false;
};

double share(double part, double whole) {
  return whole > 0 ? std::sqrt(part / whole) : 0.0;
}

}  // namespace

MergeCounts& MergeCounts::operator+=(const MergeCounts& other) noexcept {
  points += other.points;
  merged += other.merged;
  made += other.made;
  light_square += other.light_square;
  light_change += other.light_change;
  albedo_square += other.albedo_square;
  albedo_change += other.albedo_change;
  return *this;
}

double MergeCounts::light_error() const noexcept {
  return share(light_change, light_square);
}

double MergeCounts::albedo_error() const noexcept {
  return share(albedo_change, albedo_square);
}

std::unique_ptr<PointStream> merge_flat_cells(PointStream& sorted, double unit,
                                              const Flatness& most, const SurfaceGoesOn& goes_on,
                                              MergeCounts& counts) {
  return std::make_unique<FlatCellStream>(sorted, unit, most, goes_on, counts);
}

}  // namespace ptc
