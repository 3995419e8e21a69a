#include "engine/octree/radius.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <nanoflann.hpp>

#include "engine/base/numbers.h"

namespace ptc {
namespace {

constexpr std::size_t kChunk = std::size_t{1} << 16;
constexpr std::size_t kHalo = std::size_t{1} << 13;
constexpr std::size_t kNeighbours = 6;
constexpr double kLargest = 3;  // times the chunk's median

/// Positions of a window for the k-d tree, relative to its first point, in lattice units.
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

class RadiusStream : public PointStream {
 public:
  RadiusStream(PointStream& sorted, double unit, std::uint64_t first)
      : sorted_(sorted), unit_(unit) {
    at_ = chunk_end_ = static_cast<std::size_t>(first / kChunk * kChunk - first_for_radii(first));
    fill(chunk_end_);
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
  /// Window = halo behind, chunk, halo ahead; the chunk behind has its radii already.
  void advance() {
    const std::size_t keep_from = chunk_end_ - std::min(chunk_end_, kHalo);
    window_.erase(window_.begin(), window_.begin() + static_cast<std::ptrdiff_t>(keep_from));
    const std::size_t chunk_begin = chunk_end_ - keep_from;
    fill(chunk_begin + kChunk + kHalo);
    at_ = chunk_begin;
    chunk_end_ = std::min(window_.size(), chunk_begin + kChunk);
    estimate(chunk_begin, chunk_end_);
  }

  /// Reads up to so many points in the window.
  void fill(std::size_t size) {
    std::size_t filled = window_.size();
    window_.resize(size);
    while (filled < size) {
      const std::size_t count = sorted_.next(std::span(window_).subspan(filled));
      if (count == 0) break;
      filled += count;
    }
    window_.resize(filled);
  }

  void estimate(std::size_t begin, std::size_t end) {
    const auto chunk = std::span(window_).subspan(begin, end - begin);
    if (std::ranges::none_of(chunk, [](const PointRecord& p) { return p.radius == 0; })) return;
    std::vector<double> radii = neighbour_radii(begin, end);
    std::vector<double> sorted = radii;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::ranges::nth_element(sorted, middle);
    for (std::size_t i = 0; i < chunk.size(); ++i) {
      if (chunk[i].radius != 0) continue;
      const double radius = radii[i] > 0 ? std::min(radii[i], kLargest * *middle) : *middle;
      chunk[i].radius = static_cast<float>(radius * unit_);
    }
  }

  [[nodiscard]] std::vector<double> neighbour_radii(std::size_t begin, std::size_t end) const {
    Cloud cloud;
    cloud.points.reserve(window_.size());
    for (const PointRecord& p : window_) {
      const LatticePoint q = decode_morton(p.key);
      cloud.points.push_back(
          {static_cast<double>(q[0]), static_cast<double>(q[1]), static_cast<double>(q[2])});
    }
    const Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));
    std::array<std::size_t, kNeighbours + 1> index{};
    std::array<double, kNeighbours + 1> squared{};
    std::vector<double> radii;
    radii.reserve(end - begin);
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t found =
          tree.knnSearch(cloud.points[i].data(), index.size(), index.data(), squared.data());
      radii.push_back(found > 1 ? std::sqrt(squared[found - 1] * kPiDouble /
                                            (2.0 * static_cast<double>(found - 1)))
                                : 0);
    }
    return radii;
  }

  PointStream& sorted_;
  double unit_;
  std::vector<PointRecord> window_;
  std::size_t at_ = 0;         // next point to hand out
  std::size_t chunk_end_ = 0;  // points before it have their radii
};

}  // namespace

std::unique_ptr<PointStream> estimate_radii(PointStream& sorted, double unit, std::uint64_t first) {
  return std::make_unique<RadiusStream>(sorted, unit, first);
}

std::uint64_t first_for_radii(std::uint64_t first) noexcept {
  const std::uint64_t chunk = first / kChunk * kChunk;
  return chunk - std::min<std::uint64_t>(chunk, kHalo);
}

}  // namespace ptc
