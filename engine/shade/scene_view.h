// The octree of a container as a gather walks it: groups and surfels relative to a point in space.
#pragma once

#include <array>
#include <cstdint>

#include <glm/vec3.hpp>

#include "engine/cache/page_cache.h"
#include "format/node_page.h"

namespace ptc {

/// What shading needs of a container besides its pages; shared by all threads.
class SceneView {
 public:
  explicit SceneView(const ContainerReader& container);

  [[nodiscard]] const Frame& frame() const noexcept { return frame_; }
  [[nodiscard]] std::uint64_t points() const noexcept { return points_; }
  [[nodiscard]] std::uint32_t points_per_page() const noexcept { return points_per_page_; }
  /// The root group; not interior when the container is empty.
  [[nodiscard]] const ChildRef& root() const noexcept { return root_; }
  /// Page that holds a point.
  [[nodiscard]] std::uint32_t point_page(std::uint64_t point) const {
    return container_->point_pages()[static_cast<std::size_t>(point / points_per_page_)];
  }

 private:
  const ContainerReader* container_;
  Frame frame_;
  std::uint64_t points_;
  std::uint32_t points_per_page_;
  ChildRef root_;
};

/// The children of a group in float, relative to an origin, in scene units.
struct alignas(32) GroupLanes {
  std::array<float, kMaxChildren> x, y, z;  ///< mean - origin
  std::array<float, kMaxChildren> radius;
  int size = 0;
};

/// Up to 8 surfels in float, relative to an origin, in scene units.
struct alignas(32) SurfelLanes {
  std::array<float, 8> x, y, z, radius;
  std::array<float, 8> nx, ny, nz;
  std::array<std::uint32_t, 8> rgbe;
  int size = 0;
};

/// One thread's way into the octree.
class SceneReader {
 public:
  SceneReader(const SceneView& view, PageCache& cache) : view_(view), pages_(cache) {}

  [[nodiscard]] const SceneView& view() const noexcept { return view_; }
  /// A group; valid until the next call. @throws FormatError when the reference leads nowhere
  [[nodiscard]] GroupView group(std::uint32_t page, std::uint16_t slot);
  /// @param origin  in lattice units
  void widen(const GroupView& group, const glm::dvec3& origin, GroupLanes& lanes) const noexcept;
  /// The surfels [first, first + count), count at most 8.
  void surfels(std::uint64_t first, int count, const glm::dvec3& origin, SurfelLanes& lanes);

 private:
  const SceneView& view_;
  PageReader pages_;
};

}  // namespace ptc
