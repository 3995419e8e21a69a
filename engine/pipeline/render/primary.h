// Primary visibility: the surface that a camera sees behind every sample of a picture.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>

#include <glm/vec3.hpp>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "engine/base/stream.h"
#include "engine/base/surfel.h"
#include "engine/cache/page_source.h"
#include "engine/scene/camera.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/ray_scene.h"
#include "engine/shade/lost_pages.h"
#include "engine/store/reader.h"

namespace ptc {

/// Returns which share of the way to the middle of their triangle receivers of baked texels and
/// vertices go: 0.6 radii of a surfel, or all of it. At an edge they would look through the gap
/// between two discs of the other side.
/// @param way, radius  scene units
[[nodiscard]] inline double baked_step(double way, float radius) noexcept {
  constexpr float kRadii = 0.6F;
  return way > 0 ? std::min(1.0, double{kRadii * radius} / way) : 1;
}

/// The place where the ray of a sample meets a surface.
struct PrimaryHit {
  glm::dvec3 position{0};      ///< scene units
  glm::dvec3 surface{0};       ///< place on the surface of a mesh, scene units
  glm::vec3 normal{0};         ///< shading normal, unit, turned towards the camera
  float lift = 0;              ///< scene units to rise along `offset_normal` before shading
  glm::vec3 offset_normal{0};  ///< normal of the surface itself, unit, turned towards the camera
  glm::vec3 albedo{0};         ///< 0 to 1
  /// Radiance that leaves towards the camera: emission, and reflected light of the lamps. The sky
  /// is left out, unless `sky_included` is set.
  glm::vec3 direct{0};
  bool sky_included = false;  ///< true when `direct` includes reflected light of the sky
  /// Irradiance of the lamps on a mesh, and of emitters that are asked for it, W/m^2.
  glm::vec3 lamps{0};
  bool is_margin = false;  ///< true where a texture shows the surface next to it
  float depth = 0;         ///< from the camera along its view, scene units; unused by what is baked
  /// Index in Mesh::triangles; kNoTriangle of a surfel.
  std::uint32_t triangle = kNoTriangle;

  static constexpr std::uint32_t kNoTriangle = 0xffffffff;
};

/// A rectangle of the grid of samples of a picture.
struct SampleRect {
  unsigned x0 = 0, y0 = 0;  ///< the first column and row
  unsigned x1 = 0, y1 = 0;  ///< those behind the last

  [[nodiscard]] std::uint64_t samples() const noexcept {
    return std::uint64_t{x1 - x0} * (y1 - y0);
  }
  [[nodiscard]] bool contains(const SampleRect& other) const noexcept {
    return other.x0 >= x0 && other.x1 <= x1 && other.y0 >= y0 && other.y1 <= y1;
  }
};

/// The surfaces that a camera sees. The samples of a pixel lie on a grid of side x side.
/// Threads: at() may be called concurrently.
class PrimaryView {
 public:
  virtual ~PrimaryView() = default;
  /// Finds what the samples of a rectangle see, where the view does not hold all of the picture.
  /// What at() returns does not depend on the rectangles.
  /// @param on  whether the rectangles behind it in its row, and then those below, come next
  virtual void look_at(const SampleRect& /*rect*/, bool /*on*/ = true) {}
  /// Returns the nearest surface behind a sample; nothing where the camera sees the sky.
  /// @param x, y  place on the grid of samples, width * side by height * side, (0, 0) top left;
  ///              in the rectangle of the last look_at(), if the view does not hold all
  [[nodiscard]] virtual std::optional<PrimaryHit> at(unsigned x, unsigned y) const = 0;
};

/// Makes a view that traces rays at a mesh and lights it by shadow rays.
/// @param scene, light  must outlive the view
/// @param side          samples along the side of a pixel
/// @param lift          height of receivers above the mesh, scene units
[[nodiscard]] std::unique_ptr<PrimaryView> view_mesh(const RayScene& scene,
                                                     const DirectLight& light,
                                                     const LightSampling& sampling,
                                                     const Camera& camera, unsigned side,
                                                     float lift);

/// Returns what a view shows of a place on a mesh, lit by shadow rays.
/// @param at       `front` says which side is seen
/// @param towards  direction in which it is looked at, unit
/// @param lift     height of receivers above the mesh, scene units
/// @param seed     fixes the sample points of the lights
[[nodiscard]] PrimaryHit seen_of_mesh(const RayScene& scene, const DirectLight& light,
                                      const LightSampling& sampling, const SurfaceHit& at,
                                      const glm::vec3& towards, float lift, std::uint64_t seed);

/// What a view of the surfels of a container may use.
struct SurfelViewOptions {
  unsigned side = 1;  ///< samples along the side of a pixel
  float lift = 0;     ///< height of receivers above their surfel, in radii of the surfel
  /// Gets the damaged pages, whose points are not seen; it must outlive the view.
  /// Null: damaged pages are errors.
  LostPages* lost = nullptr;
  /// Cap of the page cache and of what threads decode. Raised to what these need at least.
  std::uint64_t memory_bytes = std::uint64_t{64} << 20;
  /// Cap of the depth buffer: where the picture takes more, the view holds a part of it. Raised to
  /// what the rectangles of look_at() need.
  std::uint64_t depth_bytes = std::numeric_limits<std::uint64_t>::max();
  BackEnd back_end = BackEnd::pread;
};

/// The bytes of a sample in the depth buffer of a view of surfels.
inline constexpr std::uint64_t kSplatBytes = 24;

/// Returns the least depth buffer that serves look_at() of a rectangle of this size.
/// @param width, height  samples
[[nodiscard]] std::uint64_t depth_bytes_for(unsigned width, unsigned height) noexcept;
/// Returns a cap of pages that serves a view of a part of the picture.
[[nodiscard]] std::uint64_t view_bytes(const ContainerReader& scene, unsigned threads,
                                       BackEnd back_end);

/// Makes a view of the surfels themselves by rays at their discs: for clouds without a mesh.
/// PrimaryHit::direct is their baked radiance.
/// @param scene, executor  must outlive a view that does not hold all of the picture
/// @param progress         advances by one for each sample, if the view holds them all
/// @throws FormatError when a page is damaged and `lost` is null, or that of the octree's root;
///         std::system_error
/// Memory: SurfelViewOptions::depth_bytes or less, kSplatBytes for each sample that it holds;
///         while it is made, and as long as it holds but a part, SurfelViewOptions::memory_bytes.
[[nodiscard]] std::unique_ptr<PrimaryView> view_surfels(const ContainerReader& scene,
                                                        const Camera& camera,
                                                        const SurfelViewOptions& options,
                                                        const Executor& executor,
                                                        Progress& progress);

/// Returns the share of the samples of such a view that see a surface so far away that neighbours
/// of them lie more than a radius of its surfels apart. Of up to 16 x 16 samples one is looked at.
/// @throws as view_surfels()
[[nodiscard]] double sparse_share(const ContainerReader& scene, const Camera& camera,
                                  const SurfelViewOptions& options, const Executor& executor);

/// Makes a view of other surfels in the frame of a scene, such as clusters of its octree, drawn as
/// discs into a depth buffer of 24 bytes a sample.
[[nodiscard]] std::unique_ptr<PrimaryView> view_surfels(const ContainerReader& scene,
                                                        PointSource& surfels, const Camera& camera,
                                                        unsigned side, const Executor& executor);

/// Returns the camera of a mesh or scene file, which keeps its horizontal angle.
/// @param size  width and height of the picture; empty: those of the file, else the usual ones
[[nodiscard]] Camera camera_of(const MeshCamera& from,
                               const std::optional<std::array<unsigned, 2>>& size);

/// Returns the camera of a request that names none: the one recorded in the container or, without a
/// record, the first one of the mesh files or, without that, that of overview().
/// @param subject  box around what is to fill the picture; empty: the whole scene
/// @param size     width and height of the picture; empty: those of the camera
[[nodiscard]] Camera default_camera(const ContainerReader& scene,
                                    std::span<const MeshCamera> cameras,
                                    const std::optional<Bounds>& subject,
                                    const std::optional<std::array<unsigned, 2>>& size);

}  // namespace ptc
