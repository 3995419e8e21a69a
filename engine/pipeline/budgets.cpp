#include "engine/pipeline/budgets.h"

#include <algorithm>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/file/remote_file.h"
#include "engine/io/file/url.h"
#include "engine/parallel/thread_pool.h"
#include "engine/scene/light/sky_map.h"
#include "engine/scene/sampling/mesh_parts.h"
#include "engine/store/commit.h"
#include "engine/trace/disc_tracer.h"

namespace ptc {
namespace {

/// Minimum of bytes for a page cache, even where a cache for fewer pages would be possible.
constexpr std::uint64_t kMinCacheBytes = std::uint64_t{16} << 20;

/// Bytes of the direction buffers and receiver cells' lists of one thread (spec/notes/lists.md).
constexpr std::uint64_t kGatherBytes = std::uint64_t{16} << 20;
/// Points of a leaf that these bytes have room for.
constexpr std::uint64_t kUsualLeaf = 64;
/// Bytes that each further point of a leaf adds: a cell may open the 8 leaves of a group at once,
/// and so may those around it, of which some 8 leave as much.
constexpr std::uint64_t kLeafPointBytes = std::uint64_t{8} * 40 * 8;
// Rays at the surfels are traced when no gather lives, in what was charged for gathers
static_assert(DiscTracer::kBytes <= kGatherBytes);

}  // namespace

MemoryBudget budget_of(std::uint64_t cap_bytes, std::string job) {
  MemoryBudget budget(cap_bytes, std::move(job));
  budget.charge("buffers", kBufferBytes);
  return budget;
}

ThreadsThatFit threads_that_fit(const RunOptions& run,
                                const std::function<std::uint64_t(unsigned threads)>& left) {
  for (unsigned threads = ThreadPool::count(run.threads);; --threads) {
    try {
      return {threads, left(threads)};
    } catch (const LimitError&) {
      if (threads == 1) throw;
    }
  }
}

const std::filesystem::path& with_directory_under(const std::filesystem::path& scene,
                                                  const RunOptions& run) {
  const InputFile file(scene);
  const Superblock superblock = read_superblock(file, read_file_header(file));
  MemoryBudget budget(run.memory_bytes, "this scene");
  budget.charge("the directory of " + file_name(scene),
                ContainerReader::kMaxPageBytes * superblock.page_count);
  budget.require();
  return scene;
}

void charge_directory(MemoryBudget& budget, const ContainerReader& container) {
  budget.charge(
      "the directory of " + file_name(container.path()),
      ContainerReader::kPageBytes * container.page_count() * (container.parts().empty() ? 1 : 2));
  if (container.file().is_remote()) budget.charge(RemoteFile::kMemory, RemoteFile::kMemoryBytes);
}

void charge_textures(MemoryBudget& budget, const std::vector<Material>& materials) {
  if (const std::uint64_t bytes = texture_bytes(materials); bytes > 0)
    budget.charge("textures", bytes);
}

std::shared_ptr<TextureStore> texture_store(const RunOptions& run,
                                            const std::filesystem::path& target) {
  return TextureStore::make(texture_cap(run), roomiest_temp_dir(run, target));
}

void charge_sky(MemoryBudget& budget, const Sky& sky) {
  if (!sky.map) return;
  const TextureStore* const store = sky.map->store();
  budget.charge("the picture of the sky",
                sky.map->bytes() + (store ? store->cache_bytes() : 0) + SkyDensity::bytes(sky));
}

void charge_mesh(MemoryBudget& budget, const Mesh& mesh, const RayScene* rays) {
  budget.charge("the mesh", bytes_of(mesh));
  charge_textures(budget, mesh.materials);
  if (rays) budget.charge("rays at the mesh", rays->bytes());
}

std::uint64_t cache_bytes_left(MemoryBudget budget, const ContainerReader& scene, unsigned gathers,
                               unsigned readers, BackEnd back_end) {
  charge_directory(budget, scene);
  const std::uint64_t leaf = std::max<std::uint64_t>(scene.superblock().leaf_points, kUsualLeaf);
  budget.charge("threads that gather",
                gathers * (kGatherBytes + kLeafPointBytes * (leaf - kUsualLeaf)));
  return budget.rest("the page cache",
                     std::max(kMinCacheBytes, PageCache::min_bytes(scene, readers, back_end)));
}

}  // namespace ptc
