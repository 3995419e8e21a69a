// What a camera sees: the surface behind every sample of a picture.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>

#include <glm/vec3.hpp>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/scene/camera.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/ray_scene.h"
#include "engine/shade/lost_pages.h"
#include "engine/store/reader.h"

namespace ptc {

struct PrimaryHit {
  glm::dvec3 position{0};
  glm::vec3 normal{0};  ///< unit, towards the camera
  float lift = 0;       ///< scene units to rise along `offset_normal` before shading
  glm::vec3 offset_normal{0};
  glm::vec3 albedo{0};
  glm::vec3 direct{0};        ///< emission and reflected light of lamps, sky left out unless baked
  bool sky_included = false;  ///< `direct` has the sky's light already
};

/// Samples per pixel lie on a side x side grid.
class PrimaryView {
 public:
  virtual ~PrimaryView() = default;
  /// @param x, y  sample on the grid of width * side by height * side
  [[nodiscard]] virtual std::optional<PrimaryHit> at(unsigned x, unsigned y) const = 0;
};

/// Rays at the mesh, lit by shadow rays.
/// @param lift  scene units
[[nodiscard]] std::unique_ptr<PrimaryView> view_mesh(const RayScene& scene,
                                                     const DirectLight& light,
                                                     const LightSampling& sampling,
                                                     const Camera& camera, unsigned side,
                                                     float lift);

/// The surfels themselves, drawn as discs into a depth buffer: for clouds without a mesh. `direct`
/// is their baked radiance.   Memory: 24 bytes a sample.
/// @param lift  in radii of a surfel
/// @param lost  where damaged pages are told, whose points are then not seen; null: they are errors
[[nodiscard]] std::unique_ptr<PrimaryView> view_surfels(const ContainerReader& scene,
                                                        const Camera& camera, unsigned side,
                                                        float lift, LostPages* lost,
                                                        const Executor& executor,
                                                        Progress& progress);

/// The camera where none is given: the container's, else the mesh's first, else one that sees
/// everything from the front, the right and above.
/// @param backdrop  the scene has one, which is larger than what stands on it and may leave the
/// picture
/// @param size      of the picture that it is for, if not the camera's own
[[nodiscard]] Camera default_camera(const ContainerReader& scene,
                                    std::span<const MeshCamera> cameras, bool backdrop,
                                    const std::optional<std::array<unsigned, 2>>& size);

}  // namespace ptc
