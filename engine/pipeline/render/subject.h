// Internal to render_picture(): what a picture shows, how it is seen, and which memory that takes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "engine/base/progress.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/render/render_picture.h"
#include "engine/pipeline/render/surface_ids.h"
#include "engine/pipeline/render/texture_tiles.h"
#include "engine/pipeline/render/tile_renderer.h"

namespace ptc {

/// The subject of a picture: the camera, what it sees and what lights it. The view refers to the
/// other members.
struct Subject {
  Camera camera;
  ImageWindow window;             ///< of the camera's picture that is rendered
  unsigned side = 1;              ///< samples of a pixel lie on a grid of side x side
  Mesh mesh;                      ///< empty: the camera sees the surfels
  std::optional<SurfaceIds> ids;  ///< of the mesh, where the picture shows them
  std::unique_ptr<RayScene> rays;
  std::unique_ptr<DirectLight> light;
  LightSampling sampling;  ///< shadow rays at a mesh
  float radius = 0;        ///< of the surfels, scene units
  float lift = 0;          ///< of receivers above a mesh, scene units
  PictureShadows shadows;
  bool rays_at_emitters = false;  ///< those of the mesh light it by rays, and not by the gather
  std::unique_ptr<PrimaryView> view;
  std::uint64_t baked_bytes = 0;  ///< of the view of a texture or of vertices

  [[nodiscard]] bool has_mesh() const noexcept { return !mesh.triangles.empty(); }
  [[nodiscard]] std::uint64_t pixels() const { return std::uint64_t{window.width} * window.height; }
  [[nodiscard]] std::uint64_t samples() const { return pixels() * side * side; }
  /// Samples of the whole picture.
  [[nodiscard]] std::uint64_t all_samples() const {
    return std::uint64_t{camera.width} * camera.height * side * side;
  }
};

/// Returns the memory for meshes. While they are read, only the sky takes any beside them.
/// @param target  as for roomiest_temp_dir()
[[nodiscard]] MeshLimits mesh_limits(const RenderRequest& request, const Sky& sky,
                                     const std::filesystem::path& target);

/// Loads the meshes.
/// @param moment    when they are seen, if they move
/// @param emission  whether they emit
/// @param target    as for roomiest_temp_dir()
/// @throws as load_meshes(); RequestError when a mesh is to be baked and none is in memory
void load_subject(Subject& subject, const RenderRequest& request,
                  const std::optional<Moment>& moment, bool emission, const ContainerReader& scene,
                  const Sky& sky, const std::filesystem::path& target, Progress& progress);

/// Prepares rays at the subject's mesh, and its lights.
void trace_subject(Subject& subject, const RenderRequest& request, const Lighting& lighting,
                   const LightRig& lights);

/// The memory of a view of surfels.
struct SurfelViewBytes {
  std::uint64_t depth = 0;  ///< of its depth buffer
  /// Memory of the pages of a view of parts, or of views that follow one another; 0 for the only
  /// view of a whole picture, which is made with the pages of the gather, before that begins.
  std::uint64_t pages = 0;
};

/// Returns the memory of the view of a subject: a quarter of the cap may be a depth buffer of the
/// whole picture, or an eighth one of a part.
/// @param again  whether more views are made while the gather runs
[[nodiscard]] SurfelViewBytes surfel_view_bytes(const Subject& subject, const Lighting& lighting,
                                                std::uint64_t cap, bool again);
/// Makes a view of the subject from its camera.
/// @param tile      that is baked, if it is a texture
/// @param progress  advances by one for each sample of a view of surfels
/// @pre trace_subject(), if it has a mesh
void see(Subject& subject, const RenderRequest& request, const TextureTile& tile,
         const SurfelViewBytes& bytes, const Lighting& lighting, Progress& progress);

/// Says whether the samples of views of surfels lie far apart in all of a few frames
/// (spec/shading.md#sparse-pictures). The subject keeps the camera of the first.
[[nodiscard]] bool are_sparse(Subject& subject, const std::vector<Camera>& cameras, float lift,
                              const Lighting& lighting);

/// Returns pilots that stand for the receivers of all frames: of a few frames, in equal parts.
/// @param look   makes a view of the subject from a camera
/// @param frame  of the scene
[[nodiscard]] std::vector<Pilot> pilots_of_frames(const Subject& subject,
                                                  const std::vector<Camera>& cameras,
                                                  const std::function<void(const Camera&)>& look,
                                                  const Frame& frame, const Executor& executor);

}  // namespace ptc
