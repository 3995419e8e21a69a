// Tells whether a surface goes on up to the rim of a disc, by short rays through its rim.
//
//      |  |     |  |     rays
//   ---|--|=====|--|     surfels of a roof, and a disc that would stand for some of them
//      v  v     v  v     the last one meets nothing: the disc would stand out beyond the edge
#pragma once

#include <array>
#include <cstdint>

#include "engine/cache/page_cache.h"
#include "engine/shade/gather/scene_view.h"
#include "engine/store/reader.h"
#include "engine/trace/shadow_tracer.h"
#include "format/point_record.h"

namespace ptc {

/// Rays at the surfels of a container.
/// Memory: what least_bytes() says.
class RimRays {
 public:
  static constexpr unsigned kRays = 8;        ///< of a disc
  static constexpr float kAt = 0.9F;          ///< where they pass through, in radii of the disc
  static constexpr float kHalfLength = 0.5F;  ///< of a ray, in radii of the surfels

  /// Returns the memory that rays take, bytes.
  [[nodiscard]] static std::uint64_t least_bytes(const ContainerReader& scene);

  /// @param scene  must outlive this
  explicit RimRays(const ContainerReader& scene);

  /// Says whether every ray meets a surfel.
  /// @param finest  radius of the surfels, scene units
  /// @throws FormatError when a page is damaged; std::system_error
  [[nodiscard]] bool meet(const PointRecord& disc, float finest);

 private:
  const ContainerReader& scene_;
  SceneView view_;
  PageCache cache_;
  ShadowTracer tracer_;
};

}  // namespace ptc
