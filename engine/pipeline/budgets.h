// What the stages of the pipeline charge to a memory budget.
#pragma once

#include <cstdint>

#include "engine/base/memory_budget.h"
#include "engine/cache/page_cache.h"
#include "engine/io/mesh/mesh.h"
#include "engine/scene/ray_scene.h"
#include "engine/store/reader.h"

namespace ptc {

/// Open pages, blocks of points and receivers, and the program itself.
inline constexpr std::uint64_t kBufferBytes = std::uint64_t{32} << 20;

/// Least memory that the sort of a build is given.
inline constexpr std::uint64_t kMinSortBytes = std::uint64_t{48} << 20;

/// A budget that kBufferBytes are charged to.
[[nodiscard]] MemoryBudget budget_of(std::uint64_t cap_bytes, std::string job);

/// Charges the directory of an open container.
void charge_directory(MemoryBudget& budget, const ContainerReader& container);

/// Charges a mesh and what Embree keeps of it.
/// @param rays  of the mesh, or null
void charge_mesh(MemoryBudget& budget, const Mesh& mesh, const RayScene* rays);

/// Charges a gather from `scene` on `threads` threads.
/// @return bytes that are left for its page cache
/// @throws LimitError when they are too few
[[nodiscard]] std::uint64_t cache_bytes_left(MemoryBudget budget, const ContainerReader& scene,
                                             unsigned threads, BackEnd back_end);

}  // namespace ptc
