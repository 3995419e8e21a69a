#include "engine/pipeline/build/build_memory.h"

#include <algorithm>
#include <vector>

#include "engine/io/file/remote_file.h"
#include "engine/io/file/url.h"
#include "engine/octree/build_pages.h"
#include "engine/scene/sampling/streamed_sampler.h"
#include "engine/store/writer.h"
#include "format/point_page.h"

namespace ptc {
namespace {

// Memory of a checkpoint that is being saved: kCheckpointBytes, and as many open pages as there are
// in it and in its copies. Pages that wait are in kCopies: the checkpoint that the build continues
// from, the one that is being saved, and the next.
constexpr std::uint64_t kCheckpointBytes = 8 << 20;
constexpr std::uint64_t kOpenPages = 48;
constexpr std::uint64_t kCopies = 3;
// The least memory of the sort of a group of channels.
constexpr std::uint64_t kMinAttributeSortBytes = std::uint64_t{16} << 20;

}  // namespace

std::uint64_t expected_surfels(const LitMesh& lit, double spacing) {
  constexpr double kMost = 1e15;
  return static_cast<std::uint64_t>(
      std::min(kMost, sampled_area(lit.mesh, lit.first) / (spacing * spacing)));
}

MemoryBudget BuildMemory::budget() const {
  MemoryBudget budget = budget_of(request_.run.memory_bytes, "this scene's build");
  if (request_.lights) charge_sky(budget, request_.lights->sky);
  if (std::ranges::any_of(request_.inputs, is_url))
    budget.charge(RemoteFile::kMemory, RemoteFile::kMemoryBytes);
  return budget;
}

MeshLimits BuildMemory::mesh_limits() const {
  const MemoryBudget budget = this->budget();
  const std::uint64_t sampling =
      sampling_bytes(0, request_.sampling.count, request_.sampling.adapts, 1);
  // Meshes that are kept leave room for streaming. One that takes less than streaming does is
  // better in memory
  constexpr std::uint64_t kLeast = StreamingRoom::kLeastBytes;
  const std::uint64_t room = std::max(sampling_room(budget, 0), 2 * kLeast) - kLeast;
  return {.reading = std::max(budget.left(), kLeast),
          .kept = room,
          .traced = std::max(sampling_room(budget, sampling), kLeast),
          .textures = texture_cap(request_.run),
          .temp_directory = roomiest_temp_dir(request_.run, target_)};
}

SamplingRoom BuildMemory::charge_inputs(const BuildInputs& inputs, MemoryBudget& budget) const {
  SamplingRoom room;
  if (!request_.lights) charge_sky(budget, inputs.lights.sky);
  if (request_.mesh) charge_mesh(budget, *request_.mesh, nullptr);
  if (const LitMesh* lit = inputs.lit.get()) {
    charge_mesh(budget, lit->mesh, &lit->rays);
    // What is too small for any memory is refused as such
    static_cast<void>(with_spacing(request_.sampling, sampled_area(lit->mesh)));
    const std::uint64_t surfels = request_.sampling.spacing > 0
                                      ? expected_surfels(*lit, request_.sampling.spacing)
                                      : request_.sampling.count;
    const std::uint64_t fixed =
        sampling_bytes(lit->mesh.triangles.size(), surfels, request_.sampling.adapts, 0);
    const std::uint64_t writers = ContainerWriter::writing_bytes(request_.page_shift, threads_) -
                                  ContainerWriter::writing_bytes(request_.page_shift, 1);
    room.at_once = static_cast<unsigned>(std::clamp<std::uint64_t>(
        sampling_room(budget, fixed + writers) / kSampledPatchBytes, 1, threads_));
    budget.charge("sampling", fixed + room.at_once * kSampledPatchBytes);
  }
  if (const StreamedMeshes* streamed = inputs.streamed.get()) {
    budget.charge("the meshes", streamed->parts.bytes());
    std::vector<Material> materials = streamed->parts.materials();
    for (const PlacedMesh& placed : streamed->parts.placed())
      materials.insert(materials.end(), placed.mesh->materials.begin(),
                       placed.mesh->materials.end());
    charge_textures(budget, materials);
    const std::uint64_t fixed =
        streaming_bytes(streamed->found, with_spacing(request_.sampling, streamed->found.area));
    room.streaming.memory_bytes =
        std::clamp(sampling_room(budget, fixed) / 2, StreamingRoom::kLeastBytes,
                   std::max(8U, threads_) * StreamingRoom::kLeastBytes);
    budget.charge("sampling", fixed + room.streaming.memory_bytes);
  }
  return room;
}

AllSortOptions BuildMemory::sort_options(MemoryBudget budget, std::uint64_t expected, bool emits,
                                         std::size_t groups) const {
  const std::uint64_t there = scene_ ? scene_->superblock().points : 0;
  const std::uint64_t pages = pages_of(expected + there, emits, groups);
  budget.charge("pages that are written",
                ContainerWriter::writing_bytes(request_.page_shift, threads_));
  const std::uint64_t held = held_pages_bytes(request_.page_shift);
  budget.charge("node pages that wait", held);
  if (scene_) {
    budget.charge("the directory of " + file_name(scene_->path()),
                  ContainerReader::kMaxPageBytes * scene_->page_count());
  }
  if (resumption_) {
    budget.charge("checkpoints",
                  kCheckpointBytes + (kOpenPages << request_.page_shift) + kCopies * held);
  }
  const std::uint64_t directory_bytes = ContainerWriter::finish_bytes(pages);
  const std::uint64_t least = kMinSortBytes + groups * kMinAttributeSortBytes;
  const std::uint64_t memory = directory_bytes > least
                                   ? budget.rest("the output's directory", directory_bytes)
                                   : budget.rest("the sort", least);
  const std::uint64_t share = (memory - kMinSortBytes) / (groups + 1);
  const SortOptions options{.memory_bytes = memory - groups * share,
                            .temp_dirs = temp_dirs(request_.run, target_),
                            .expected = expected,
                            .emits = emits};
  AllSortOptions all{.points = options, .attributes = options};
  all.attributes.memory_bytes = share;
  if (resumption_) all.points.kept_files = resumption_->spills();
  return all;
}

std::uint64_t BuildMemory::pages_of(std::uint64_t points, bool emits, std::size_t groups) const {
  const FileHeader header{.page_shift = request_.page_shift,
                          .point_bytes = BuildPlan{.emits = emits}.point_bytes()};
  return points / points_per_page(header) * (8 + 5 * groups) / 5;
}

std::uint64_t BuildMemory::sampling_room(const MemoryBudget& budget, std::uint64_t fixed) const {
  const std::uint64_t others =
      fixed + kMinSortBytes + held_pages_bytes(request_.page_shift) +
      ContainerWriter::writing_bytes(request_.page_shift, 1);  // no number of threads decides
  return budget.left() > others ? budget.left() - others : 0;
}

}  // namespace ptc
