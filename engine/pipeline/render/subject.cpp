#include "engine/pipeline/render/subject.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
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

/// Returns what a sample of each pixel of a tile sees, along the Z-curve of its variant.
/// @param sample  its number in a pixel
std::vector<Receiver> receivers_of(const Subject& subject, const Tile& tile, unsigned sample,
                                   const Frame& frame, const Executor& executor) {
  std::vector<std::optional<PrimaryHit>> hits(tile.pixels());
  executor.for_each(tile.height, [&](std::size_t row, unsigned) {
    for (unsigned column = 0; column < tile.width; ++column) {
      const auto [x, y] =
          sample_at(tile.x0 + column, tile.y0 + static_cast<unsigned>(row), sample, subject.side);
      hits[row * tile.width + column] = subject.view->at(x, y);
    }
  });
  std::vector<Receiver> found, sorted;
  for (const auto& hit : hits) {
    if (hit) found.push_back(receiver_at(*hit));
  }
  const unsigned variant = sample % TileRenderer::kMaxVariants;
  for (const std::size_t i : order_along_curve(frame, found, variant, executor))
    sorted.push_back(found[i]);
  return sorted;
}

/// The tiles of a window, as they are rendered.
class Tiles {
 public:
  Tiles(const ImageWindow& window, unsigned side)
      : window_(window),
        whole_(TileRenderer::tile_of(window.width, side)),
        columns_((window.width + whole_.width - 1) / whole_.width),
        count_(std::size_t{columns_} * ((window.height + whole_.height - 1) / whole_.height)),
        step_(step_of(count_)) {}

  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  /// Returns the most receivers of a sample in a tile.
  [[nodiscard]] std::size_t pixels() const { return whole_.pixels(); }
  /// Returns a tile by its place in an order in which the first ones lie all over the window.
  [[nodiscard]] Tile operator[](std::size_t index) const {
    const auto number = static_cast<unsigned>(index * step_ % count_);
    const unsigned x = number % columns_ * whole_.width, y = number / columns_ * whole_.height;
    return {window_.x + x, window_.y + y, std::min(whole_.width, window_.width - x),
            std::min(whole_.height, window_.height - y)};
  }

 private:
  /// Returns the number next to the golden section of a count that is coprime to it.
  static std::size_t step_of(std::size_t count) {
    auto step = static_cast<std::size_t>(static_cast<double>(count) / std::numbers::phi) + 1;
    while (std::gcd(step, count) != 1) ++step;
    return step;
  }

  ImageWindow window_;
  Tile whole_;
  unsigned columns_;
  std::size_t count_, step_;
};

/// A block of a picture, and how many of its receivers one of the block stands for.
struct PictureBlock {
  std::vector<Receiver> receivers;
  unsigned variant = 0;
  double share = 1;
};

/// Adds some of the blocks of some of the samples of a tile.
/// @param index   of the tile: which samples and blocks these are
/// @param wanted  number of blocks
void add_blocks_of(const Subject& subject, const Tile& tile, std::size_t index, std::size_t wanted,
                   const Frame& frame, const Executor& executor,
                   std::vector<PictureBlock>& blocks) {
  subject.view->look_at(samples_of(tile, subject.side), false);
  const std::size_t samples = std::size_t{subject.side} * subject.side;
  const std::size_t chosen = std::min(samples, wanted), of_each = (wanted + chosen - 1) / chosen;
  for (std::size_t k = 0; k < chosen; ++k) {
    const auto sample = static_cast<unsigned>((index + k * samples / chosen) % samples);
    const std::vector<Receiver> all = receivers_of(subject, tile, sample, frame, executor);
    const std::size_t cut = (all.size() + Shader::kBlock - 1) / Shader::kBlock,
                      taken = std::min(cut, of_each);
    const std::size_t before = blocks.size();
    std::size_t receivers = 0;
    for (std::size_t j = 0; j < taken; ++j) {
      // Another one for each sample
      const std::size_t place = j * chosen + (k + index) % chosen;
      const std::size_t first = (2 * place + 1) * cut / (2 * taken * chosen) * Shader::kBlock;
      const auto some = std::span(all).subspan(first, std::min(Shader::kBlock, all.size() - first));
      blocks.push_back({{some.begin(), some.end()}, sample % TileRenderer::kMaxVariants});
      receivers += some.size();
    }
    for (std::size_t i = before; i < blocks.size(); ++i) {
      blocks[i].share =
          static_cast<double>(all.size() * samples) / static_cast<double>(chosen * receivers);
    }
  }
}

/// Returns pilots that stand for all receivers of a picture.
/// @param number, pictures  of so many pictures this is one; they share the pilots equally
std::vector<Pilot> pilots_of(const Subject& subject, std::size_t number, std::size_t pictures,
                             const Frame& frame, const Executor& executor) {
  constexpr std::size_t kTiles = 32;  // that blocks come from, where there are as many
  const Tiles tiles(subject.window, subject.side);
  const PilotPlan plan = plan_pilots(subject.samples(), std::min(Shader::kBlock, tiles.pixels()));
  const std::size_t wanted = (plan.blocks + pictures - 1) / pictures;
  const std::size_t spread = std::min(kTiles, tiles.count());
  // Pictures take one tile after another, and the pilots of every second tile choose the settings
  std::array<std::vector<PictureBlock>, 2> blocks;
  std::size_t seen = 0;
  const auto found = [&] { return blocks[0].size() + blocks[1].size(); };
  for (; seen < tiles.count() && found() < wanted; ++seen) {
    const std::size_t index = seen + number * spread;
    add_blocks_of(subject, tiles[index], index, (wanted + spread - 1) / spread, frame, executor,
                  blocks[seen % 2]);
  }
  // Cut them where they are few
  std::array<std::vector<Pilot>, 2> halves;
  const std::size_t enough = (kEnoughPilots + pictures - 1) / pictures;
  const std::size_t stretches = (enough + found() - 1) / std::max<std::size_t>(1, found());
  const double all_tiles = static_cast<double>(tiles.count()) / static_cast<double>(seen);
  for (std::size_t half = 0; half < 2; ++half) {
    for (PictureBlock& block : blocks[half]) {
      add_pilots(halves[half], std::move(block.receivers), block.variant, stretches,
                 block.share * all_tiles);
    }
  }
  // Where one half has more, the others follow
  std::vector<Pilot> pilots;
  for (std::size_t i = 0; i < std::max(halves[0].size(), halves[1].size()); ++i) {
    for (std::vector<Pilot>& half : halves) {
      if (i < half.size()) pilots.push_back(std::move(half[i]));
    }
  }
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
  subject.radius = surfel_radius(scene);
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
                                    const Frame& frame, const Executor& executor) {
  const std::size_t frames = std::min(kPilotFrames, cameras.size());
  std::vector<Pilot> pilots;
  for (std::size_t k = 0; k < frames; ++k) {
    if (frames > 1) look(pilot_camera(cameras, k));
    const std::vector<Pilot> some = pilots_of(subject, k, frames, frame, executor);
    pilots.insert(pilots.end(), some.begin(), some.end());
  }
  if (frames > 1) look(cameras.front());
  return pilots;
}

}  // namespace ptc
