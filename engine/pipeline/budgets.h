// How the pipeline divides a memory cap: what each of its stages charges to a MemoryBudget.
//
//   |<----------------------------- RunOptions::memory_bytes ----------------------------->|
//   | buffers | directory | mesh and rays | output's directory | ... | sort, or page cache |
//     fixed     by pages    by triangles    by pages                   whatever is left
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "engine/base/memory_budget.h"
#include "engine/cache/page_cache.h"
#include "engine/io/mesh/mesh.h"
#include "engine/pipeline/run.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/ray_scene.h"
#include "engine/store/reader.h"

namespace ptc {

/// Bytes that are set apart for open pages, blocks of points and receivers, and the program itself.
inline constexpr std::uint64_t kBufferBytes = std::uint64_t{32} << 20;

/// Minimum of bytes that the sort of a build is given.
inline constexpr std::uint64_t kMinSortBytes = std::uint64_t{32} << 20;

/// Returns a budget to which kBufferBytes are already charged.
/// @param job  what the memory is for, as in "the memory cap is too small for shading"
[[nodiscard]] MemoryBudget budget_of(std::uint64_t cap_bytes, std::string job);

/// The threads of a run, and the memory that they leave.
struct ThreadsThatFit {
  unsigned threads = 1;
  std::uint64_t bytes = 0;  ///< what `left` returned
};

/// Finds how many of a run's threads fit under its cap.
/// @param left  returns the memory that a number of threads leave, or throws LimitError
/// @throws LimitError when not even one thread fits; it is that of one thread
[[nodiscard]] ThreadsThatFit threads_that_fit(
    const RunOptions& run, const std::function<std::uint64_t(unsigned threads)>& left);

/// Checks that the directory of a container can be read under the cap of a run, before it is.
/// @return `scene`
/// @throws LimitError; FormatError, std::system_error as ContainerReader does
[[nodiscard]] const std::filesystem::path& with_directory_under(const std::filesystem::path& scene,
                                                                const RunOptions& run);

/// Charges the directory that an open container keeps in memory, and what it takes to read one from
/// a server.
void charge_directory(MemoryBudget& budget, const ContainerReader& container);

/// Charges the textures of materials.
void charge_textures(MemoryBudget& budget, const std::vector<Material>& materials);

/// Returns the memory that the textures of a run may take, or its sky: a quarter of its cap.
[[nodiscard]] constexpr std::uint64_t texture_cap(const RunOptions& run) noexcept {
  return run.memory_bytes / 4;
}

/// Returns what reads the pictures of a run, textures or a sky, into texture_cap().
/// @param target  as for roomiest_temp_dir()
[[nodiscard]] std::shared_ptr<TextureStore> texture_store(const RunOptions& run,
                                                          const std::filesystem::path& target);

/// Charges the picture of a sky, and what draws directions by its brightness.
void charge_sky(MemoryBudget& budget, const Sky& sky);

/// Charges a mesh and what Embree keeps of it.
/// @param rays  the ray scene of the mesh; null when the mesh is not traced
void charge_mesh(MemoryBudget& budget, const Mesh& mesh, const RayScene* rays);

/// Charges gathers from `scene`.
/// @param budget   a copy: the caller's budget stays as it is
/// @param gathers  that exist at once
/// @param readers  of the page cache that exist at once, at least one for each gather
/// @return         bytes that are left for the page cache of the gather
/// @throws LimitError when these are too few for a cache; the text names the least cap that works
[[nodiscard]] std::uint64_t cache_bytes_left(MemoryBudget budget, const ContainerReader& scene,
                                             unsigned gathers, unsigned readers, BackEnd back_end);

}  // namespace ptc
