// A window slides along the Z-curve, one chunk at a time:
//
//   curve     ....|  halo  |        chunk        |  halo  |....
//   window_       ^0        ^at_ at first         ^chunk_end_
//
// Radii are estimated for the chunk, from neighbours anywhere in the window. The halo behind is the
// end of the chunk before, whose points are handed out already but still count as neighbours.
#include "engine/octree/radius.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <nanoflann.hpp>

#include "engine/base/numbers.h"
#include "engine/sort/point_streams.h"

namespace ptc {
namespace {

constexpr std::size_t kChunk = std::size_t{1} << 16;
constexpr std::size_t kHalo = std::size_t{1} << 13;
constexpr std::size_t kNeighbours = 6;
constexpr double kLargest = 3;  // the greatest radius, in medians of the chunk

/// Positions for the k-d tree, in lattice units, with the interface that nanoflann asks for.
struct Cloud {
  std::vector<std::array<double, 3>> points;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
  [[nodiscard]] double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][axis];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>, Cloud,
                                                 3, std::size_t>;

/// The distinct positions of a window, called places, in a k-d tree. Points in one place follow
/// each other on the curve. The tree holds each place once, because it could not split coincident
/// points.
class Places {
 public:
  explicit Places(std::span<const PointRecord> window) {
    of.reserve(window.size());
    for (std::size_t i = 0; i < window.size(); ++i) {
      if (i == 0 || window[i].key != window[i - 1].key) {
        const LatticePoint q = decode_morton(window[i].key);
        cloud_.points.push_back(
            {static_cast<double>(q[0]), static_cast<double>(q[1]), static_cast<double>(q[2])});
        points_at_.push_back(0);
      }
      ++points_at_.back();
      of.push_back(points_at_.size() - 1);
    }
    tree_.emplace(3, cloud_, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  }

  [[nodiscard]] std::size_t count() const noexcept { return points_at_.size(); }

  /// Returns the squared distance from a place to its nth nearest point or place, lattice units
  /// squared. The place itself is the first.
  /// @param n     1 to kNeighbours + 1, at most the number of points or places
  /// @param each  count every point of a place; otherwise each place counts as one
  [[nodiscard]] double distance_to(std::size_t place, std::size_t n, bool each) const {
    std::array<std::size_t, kNeighbours + 1> index{};
    std::array<double, kNeighbours + 1> squared{};
    tree_->knnSearch(cloud_.points[place].data(), n, index.data(), squared.data());
    std::size_t last = 0;
    for (std::size_t seen = 0;; ++last) {
      seen += each ? points_at_[index[last]] : 1;
      if (seen >= n) return squared[last];
    }
  }

  std::vector<std::size_t> of;  ///< the place of each point of the window

 private:
  Cloud cloud_;
  std::vector<std::size_t> points_at_;  ///< by place: the number of its points
  std::optional<Tree> tree_;
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// The stream that estimate_radii() returns.
class RadiusStream : public PointStream {
 public:
  RadiusStream(PointStream& sorted, double unit, std::uint64_t first, RadiusCounts& counts)
      : sorted_(sorted), unit_(unit), counts_(counts) {
    at_ = chunk_end_ = static_cast<std::size_t>(first / kChunk * kChunk - first_for_radii(first));
    window_.resize(chunk_end_);
    window_.resize(read_full(sorted_, window_));
    pass_over(*this, first % kChunk);
  }

  std::size_t next(std::span<PointRecord> out) override {
    if (at_ == chunk_end_) advance();
    const std::size_t count = std::min(out.size(), chunk_end_ - at_);
    std::copy_n(window_.begin() + static_cast<std::ptrdiff_t>(at_), count, out.begin());
    at_ += count;
    return count;
  }

 private:
  /// Slides the window on to the next chunk, and estimates its radii.
  void advance() {
    const std::size_t keep_from = chunk_end_ - std::min(chunk_end_, kHalo);
    window_.erase(window_.begin(), window_.begin() + static_cast<std::ptrdiff_t>(keep_from));
    const std::size_t chunk_begin = chunk_end_ - keep_from;
    const std::size_t kept = window_.size();
    window_.resize(chunk_begin + kChunk + kHalo);
    window_.resize(kept + read_full(sorted_, std::span(window_).subspan(kept)));
    at_ = chunk_begin;
    chunk_end_ = std::min(window_.size(), chunk_begin + kChunk);
    estimate(chunk_begin, chunk_end_);
  }

  /// Estimates the missing radii of the window's points from `begin` up to `end`.
  void estimate(std::size_t begin, std::size_t end) {
    const auto chunk = std::span(window_).subspan(begin, end - begin);
    if (std::ranges::none_of(chunk, [](const PointRecord& p) { return p.radius == 0; })) return;
    const Places places(window_);
    std::vector<double> radii = neighbour_radii(places, begin, end, true);
    double middle = median(radii);
    // Where most points are stacked in few places, count every place as one point.
    if (middle == 0) {
      radii = neighbour_radii(places, begin, end, false);
      std::vector<double> once;
      for (std::size_t i = begin; i < end; ++i) {
        if (i == begin || places.of[i] != places.of[i - 1]) once.push_back(radii[i - begin]);
      }
      middle = median(std::move(once));
    }
    // Limit the radii by their median, and store them where there is none.
    for (std::size_t i = 0; i < chunk.size(); ++i) {
      if (chunk[i].radius != 0) continue;
      const double radius = radii[i] > 0 ? std::min(radii[i], kLargest * middle) : middle;
      chunk[i].radius = static_cast<float>(radius * unit_);
      if (chunk[i].radius == 0) ++counts_.without_radius;
    }
  }

  /// Returns the radii that follow from the neighbours alone, for the window's points from `begin`
  /// up to `end`, lattice units. A radius is 0 where there are no neighbours.
  /// @param each  see Places::distance_to()
  std::vector<double> neighbour_radii(const Places& places, std::size_t begin, std::size_t end,
                                      bool each) {
    const std::size_t all = each ? window_.size() : places.count();
    const std::size_t wanted = std::min(kNeighbours + 1, all);
    std::vector<double> radii;
    radii.reserve(end - begin);
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t place = places.of[i];
      if (i > begin && place == places.of[i - 1]) {
        radii.push_back(radii.back());
        continue;
      }
      ++counts_.searches;
      const double squared = places.distance_to(place, wanted, each);
      const auto neighbours = static_cast<double>(wanted - 1);
      radii.push_back(wanted > 1 ? std::sqrt(squared * kPiDouble / (2.0 * neighbours)) : 0);
    }
    return radii;
  }

  PointStream& sorted_;
  double unit_;
  RadiusCounts& counts_;
  std::vector<PointRecord> window_;
  std::size_t at_ = 0;         ///< the window's next point to hand out
  std::size_t chunk_end_ = 0;  ///< the window's points before this one have their radii
};

}  // namespace

std::unique_ptr<PointStream> estimate_radii(PointStream& sorted, double unit, RadiusCounts& counts,
                                            std::uint64_t first) {
  return std::make_unique<RadiusStream>(sorted, unit, first, counts);
}

std::uint64_t first_for_radii(std::uint64_t first) noexcept {
  const std::uint64_t chunk = first / kChunk * kChunk;
  return chunk - std::min<std::uint64_t>(chunk, kHalo);
}

}  // namespace ptc
