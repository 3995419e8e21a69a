#include "engine/pipeline/render/subject.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/light/built_scene.h"
#include "engine/pipeline/render/vertex_view.h"
#include "engine/pipeline/scene_record.h"
#include "engine/shade/lift.h"

namespace ptc {
namespace {

/// Says whether a box and the bounds of a scene's points have a place in common.
bool overlap(const Bounds& box, const Superblock& scene) {
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    if (box.high[k] < scene.bounds_low[axis] || box.low[k] > scene.bounds_high[axis]) return false;
  }
  return true;
}

/// Makes a view of the mesh from the camera.
void see_mesh(Subject& subject) {
  subject.view = view_mesh(*subject.rays, *subject.light, subject.sampling, subject.camera,
                           subject.side, subject.lift);
}

/// Makes a view of the texture of the mesh, and notes what of it is not as one expects.
void see_texture(Subject& subject, const RenderRequest& request, const TextureTile& tile,
                 const Executor& executor, Progress& progress) {
  const glm::uvec2 size(subject.camera.width, subject.camera.height);
  MemoryBudget budget = budget_of(request.run.memory_bytes, "this texture");
  charge_mesh(budget, subject.mesh, subject.rays.get());
  budget.charge("the mesh as it is baked", TextureView::bytes_for(*subject.rays, size));
  budget.require();
  auto view = std::make_unique<TextureView>(*subject.rays, *subject.light, subject.sampling, size,
                                            subject.side, subject.radius, subject.lift,
                                            *request.texture, tile, executor);
  subject.baked_bytes = view->bytes();
  if (view->covered() == 0) {
    progress.note(
        "no middle of a texel lies on a surface: the texture coordinates are outside of the "
        "texture, or cover too little of it");
  }
  constexpr double kMuch = 1.05;  // a texel at the edge of an island counts as a whole
  if (const double overlap = view->overlap(); overlap > kMuch) {
    progress.note(fmt::format(
        "parts of the meshes share texels, {:.2g} to one in the mean: each shows one of them",
        overlap));
  }
  subject.view = std::move(view);
}

/// Makes a view of the vertices of the mesh.
void see_vertices(Subject& subject, const RenderRequest& request) {
  MemoryBudget budget = budget_of(request.run.memory_bytes, "these vertices");
  charge_mesh(budget, subject.mesh, subject.rays.get());
  subject.baked_bytes = VertexView::bytes_for(subject.mesh);
  budget.charge("the mesh as it is baked", subject.baked_bytes);
  budget.require();
  subject.view = std::make_unique<VertexView>(*subject.rays, *subject.light, subject.sampling,
                                              subject.camera.width, subject.side, subject.radius,
                                              subject.lift);
}

SurfelViewOptions view_options(const Subject& subject, float lift, const Lighting& lighting) {
  return {.side = subject.side,
          .lift = lift,
          .lost = lighting.lost(),
          .memory_bytes = lighting.cache_bytes(),
          .back_end = lighting.back_end()};
}

/// Makes a view of the surfels from the camera.
/// @param progress  as for view_surfels()
void see_surfels(Subject& subject, float lift, const SurfelViewBytes& bytes,
                 const Lighting& lighting, Progress& progress) {
  SurfelViewOptions options = view_options(subject, lift, lighting);
  options.depth_bytes = bytes.depth;
  if (bytes.pages > 0) options.memory_bytes = bytes.pages;
  subject.view.reset();  // before the next one takes memory
  subject.view =
      view_surfels(lighting.scene(), subject.camera, options, lighting.executor(), progress);
  return_freed_memory();
}

/// Says whether the samples of such a view lie far apart (spec/shading.md#sparse-pictures).
bool is_sparse(const Subject& subject, float lift, const Lighting& lighting) {
  constexpr double kShare = 0.5;
  return sparse_share(lighting.scene(), subject.camera, view_options(subject, lift, lighting),
                      lighting.executor()) > kShare;
}

/// Returns windows of receivers that stand for all receivers of a picture. Windows in which the
/// camera meets nothing are left out.
std::vector<Pilot> pilots_of(const Subject& subject, const Executor& executor) {
  // Choose the size of a window; multiples of the shares kGolden cover the plane evenly (Roberts
  // 2018)
  constexpr double kGolden[2] = {0.7548776662466927, 0.5698402909980532};
  constexpr unsigned kMaxSide = 32;
  const ImageWindow& window = subject.window;
  const unsigned side = subject.side;
  const PilotPlan plan = plan_pilots(subject.samples());
  const unsigned width = std::min(kMaxSide, window.width),
                 height = std::min(kMaxSide, window.height);

  // Find what the windows see, in twice as many as are wanted: some may see nothing
  std::vector<Pilot> pilots(2 * plan.count);
  for (std::size_t i = 0; i < pilots.size(); ++i) {
    const auto place = [&](int axis, unsigned room) {
      const double turn = kGolden[axis] * static_cast<double>(i + 1);
      return static_cast<unsigned>((turn - std::floor(turn)) * (room + 1.0));
    };
    const unsigned x0 = window.x + place(0, window.width - width),
                   y0 = window.y + place(1, window.height - height);
    pilots[i].variant = static_cast<unsigned>(i / 2) % (side * side);
    subject.view->look_at(samples_of({x0, y0, width, height}, side), false);
    std::vector<std::optional<PrimaryHit>> hits(std::size_t{width} * height);
    executor.for_each(height, [&](std::size_t row, unsigned) {
      for (unsigned column = 0; column < width; ++column) {
        // Begin each row elsewhere, so that those that are compared lie all over the window
        const auto y = y0 + static_cast<unsigned>(row);
        const unsigned x = x0 + (column + width / 2 + 5 * (y - y0)) % width;
        const auto [sx, sy] = sample_at(x, y, pilots[i].variant, side);
        hits[row * width + column] = subject.view->at(sx, sy);
      }
    });
    for (const auto& hit : hits) {
      if (hit) pilots[i].receivers.push_back(receiver_at(*hit));
    }
  }

  // Keep the first ones that see something
  std::erase_if(pilots, [](const Pilot& pilot) { return pilot.receivers.empty(); });
  pilots.resize(std::min(pilots.size(), plan.count));
  return pilots;
}

/// The frames that stand for all of a sequence.
constexpr std::size_t kPilotFrames = 4;

/// Returns the camera of such a frame.
const Camera& pilot_camera(const std::vector<Camera>& cameras, std::size_t index) {
  return cameras[index * cameras.size() / std::min(kPilotFrames, cameras.size())];
}

}  // namespace

MeshLimits mesh_limits(const RenderRequest& request, const Sky& sky,
                       const std::filesystem::path& target) {
  constexpr std::uint64_t kOthers = std::uint64_t{96} << 20;  // a tile, rows, a gather, its pages
  constexpr std::uint64_t kLeast = std::uint64_t{26} << 20;   // refused rather than not seen
  MemoryBudget budget = budget_of(request.run.memory_bytes, "this picture");
  charge_sky(budget, sky);
  const std::uint64_t left = budget.left();
  return {.reading = left,
          .kept = std::max(left / 4, kLeast),
          .traced = std::max(left > kOthers ? left - kOthers : 0, kLeast),
          .textures = texture_cap(request.run),
          .temp_directory = roomiest_temp_dir(request.run, target)};
}

void load_subject(Subject& subject, const RenderRequest& request,
                  const std::optional<Moment>& moment, bool emission, const ContainerReader& scene,
                  const Sky& sky, const std::filesystem::path& target, Progress& progress) {
  LoadedMeshes meshes =
      load_meshes(request.meshes, request.mesh.get(), {request.backdrop, request.one_sided, moment},
                  mesh_limits(request, sky, target), progress, "meshes");
  if (meshes.parts) {
    progress.note("the meshes do not fit in memory: the camera sees the surfels");
  }
  subject.mesh = std::move(meshes.mesh);
  if (!emission) {
    for (Material& material : subject.mesh.materials) material.emission = glm::vec3(0);
  }
  if (!subject.mesh.triangles.empty() && !overlap(subject.mesh.bounds(), scene.superblock())) {
    progress.note(
        "the meshes lie outside of the scene: is this the container that was built from them?");
  }
  if (!request.bakes()) return;
  require_request(!subject.mesh.triangles.empty(), "meshes",
                  meshes.parts ? "the meshes do not fit in memory, as baking asks for"
                               : "there is no mesh that is to be baked");
}

void trace_subject(Subject& subject, const RenderRequest& request, const Lighting& lighting,
                   const LightRig& lights) {
  const ContainerReader& scene = lighting.scene();
  subject.radius = static_cast<float>(surfel_spacing(scene) / std::numbers::sqrt2);
  subject.lift = lift_height(subject.radius, request.lift, scene.header().frame);
  subject.rays = std::make_unique<RayScene>(subject.mesh);
  subject.light = std::make_unique<DirectLight>(*subject.rays, lights);
  return_freed_memory();  // that reading the files and building the ray scene took
  // The light that emitters gave to surfaces is in their radiance already, or else is gathered
  subject.sampling = request.light_sampling;
  subject.rays_at_emitters =
      lit_by_emitters(scene) && subject.mesh.emits() && subject.sampling.area_rays > 0;
  if (!subject.rays_at_emitters) subject.sampling.area_rays = 0;
}

SurfelViewBytes surfel_view_bytes(const Subject& subject, const Lighting& lighting,
                                  std::uint64_t cap, bool again) {
  const std::uint64_t all = subject.all_samples() * kSplatBytes;
  const std::uint64_t pages =
      view_bytes(lighting.scene(), lighting.executor().threads(), lighting.back_end());
  if (all <= cap / 4) return {all, again ? pages : 0};
  const Tile tile = TileRenderer::tile_of(subject.window.width, subject.side);
  const std::uint64_t least =
      depth_bytes_for(tile.width * subject.side, tile.height * subject.side);
  return {std::max(cap / 8, least), pages};
}

void see(Subject& subject, const RenderRequest& request, const TextureTile& tile,
         const SurfelViewBytes& bytes, const Lighting& lighting, Progress& progress) {
  if (!subject.has_mesh()) {
    see_surfels(subject, request.lift, bytes, lighting, progress);
  } else if (!request.bakes()) {
    see_mesh(subject);
  } else if (request.vertices) {
    see_vertices(subject, request);
  } else {
    see_texture(subject, request, tile, lighting.executor(), progress);
  }
}

bool are_sparse(Subject& subject, const std::vector<Camera>& cameras, float lift,
                const Lighting& lighting) {
  bool sparse = true;
  for (std::size_t k = 0; k < std::min(kPilotFrames, cameras.size()) && sparse; ++k) {
    subject.camera = pilot_camera(cameras, k);
    sparse = is_sparse(subject, lift, lighting);
  }
  subject.camera = cameras.front();
  return sparse;
}

std::vector<Pilot> pilots_of_frames(const Subject& subject, const std::vector<Camera>& cameras,
                                    const std::function<void(const Camera&)>& look,
                                    const Executor& executor) {
  const std::size_t frames = std::min(kPilotFrames, cameras.size());
  std::vector<Pilot> pilots;
  for (std::size_t k = 0; k < frames; ++k) {
    if (frames > 1) look(pilot_camera(cameras, k));
    std::vector<Pilot> of_frame = pilots_of(subject, executor);
    for (std::size_t i = k; i < of_frame.size(); i += frames)
      pilots.push_back(std::move(of_frame[i]));
  }
  if (frames > 1) look(cameras.front());
  return pilots;
}

}  // namespace ptc
