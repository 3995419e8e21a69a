// Clusters in columns, and the search for the nearest of a few.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/scene/sampling/clusters.h"

namespace ptc {

/// What a search for clusters knows of a point.
struct ClusterPoint {
  glm::vec3 position{0};
  glm::vec3 normal{0};  ///< unit
  float kind = 0;       ///< SurfacePoint::kind
};

/// Clusters as columns. Each column is kLanes longer than its contents, so that vectors may be read
/// and written whole.
class ClusterColumns {
 public:
  static constexpr std::size_t kLanes = 16;  ///< floats in the widest vector

  void clear() { size_ = 0; }

  /// @param index  of the cluster
  void add(std::uint32_t index, const Cluster& cluster) {
    make_room(1);
    set(size_++, index, cluster.position, cluster.normal, static_cast<float>(cluster.kind));
  }

  /// Adds the clusters from `first` to `end` of other columns.
  void add(const ClusterColumns& from, std::size_t first, std::size_t end) {
    make_room(end - first);
    for (std::size_t column = 0; column < kColumns; ++column) {
      for (std::size_t i = first; i < end; i += kStep) {
        std::memcpy(&columns_[column][size_ + i - first], &from.columns_[column][i],
                    kStep * sizeof(float));
      }
    }
    size_ += end - first;
  }

  /// Fills the last vector with rows that no point joins.
  void pad() {
    make_room(0);
    for (std::size_t i = 0; i < kLanes; ++i) set(size_ + i, 0, glm::vec3(0), glm::vec3(0), kNobody);
  }

  /// Returns the index of the nearest cluster that a point may join, or `none`.
  [[nodiscard]] std::uint32_t nearest(const ClusterPoint& p, std::uint32_t none) const {
    std::uint32_t nearest = none;
    float best = 1e30F;
    for (std::size_t block = 0; block < size_; block += kRows) {
      const std::int32_t least = least_of(p, block, std::min(size_ - block, kRows));
      const auto square = std::bit_cast<float>(least);
      if (square >= best) continue;
      best = square;
      nearest = std::bit_cast<std::uint32_t>(
          columns_[kIndex][block + static_cast<std::size_t>(least & kRowMask)]);
    }
    return nearest;
  }

 private:
  // Cosine between a point's normal and its cluster's, at least: surfaces that turn by more than
  // 75 degrees do not share a cluster.
  static constexpr float kMinCosine = 0.26F;
  // How much farther a cluster is taken to lie that faces another way: the squared distance grows
  // by this times (1 - cosine). Half of a cluster across a ridge is seen from behind
  // (spec/notes/surfels.md).
  static constexpr float kTurned = 10;
  static constexpr float kNever = 1e36F;  // finite, and greater than any distance that counts
  static constexpr float kNobody = 8;     // kind of no point
  static constexpr std::size_t kRows = 256;
  static constexpr std::int32_t kRowMask = 255;
  static constexpr std::size_t kStep = 4;  // floats that are copied at once
  static constexpr std::size_t kColumns = 8;
  static constexpr std::size_t kIndex = 7;

  // Makes the columns long enough for `more` rows and whole vectors after them.
  void make_room(std::size_t more) {
    const std::size_t least = size_ + more + kLanes;
    if (columns_.front().size() >= least) return;
    for (std::vector<float>& column : columns_) column.resize(2 * least);
  }

  void set(std::size_t row, std::uint32_t index, const glm::vec3& position, const glm::vec3& normal,
           float kind) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      columns_[axis][row] = position[static_cast<int>(axis)];
      columns_[3 + axis][row] = normal[static_cast<int>(axis)];
    }
    columns_[6][row] = kind;
    columns_[kIndex][row] = std::bit_cast<float>(index);
  }

  // Returns the least squared distance of up to kRows rows, its lowest bits replaced by the row. A
  // cluster that p may not join is put at a distance beyond all others instead of being skipped.
  [[nodiscard]] std::int32_t least_of(const ClusterPoint& p, std::size_t first,
                                      std::size_t rows) const {
    const float *x = &columns_[0][first], *y = &columns_[1][first], *z = &columns_[2][first];
    const float *normal_x = &columns_[3][first], *normal_y = &columns_[4][first],
                *normal_z = &columns_[5][first], *kind = &columns_[6][first];
    const std::size_t vectors = (rows + kLanes - 1) / kLanes;
    std::int32_t least = std::numeric_limits<std::int32_t>::max();
    for (std::size_t i = 0; i < vectors * kLanes; ++i) {
      const float dx = x[i] - p.position.x, dy = y[i] - p.position.y, dz = z[i] - p.position.z;
      const float cosine =
          normal_x[i] * p.normal.x + normal_y[i] * p.normal.y + normal_z[i] * p.normal.z;
      const float off_kind = kind[i] - p.kind;
      const float square = (dx * dx + dy * dy + dz * dz) * (1 + kTurned * (1 - cosine)) +
                           std::max(kMinCosine - cosine, 0.0F) * kNever +
                           off_kind * off_kind * kNever;
      const std::int32_t bits = std::bit_cast<std::int32_t>(square);
      least = std::min(least, (bits & ~kRowMask) | static_cast<std::int32_t>(i));
    }
    return least;
  }

  std::array<std::vector<float>, kColumns> columns_;  // x, y, z of position and normal; kind; index
  std::size_t size_ = 0;
};

}  // namespace ptc
