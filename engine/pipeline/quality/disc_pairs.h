// Compares what rays find at the discs of a container with what is true of the same receivers.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/memory_budget.h"
#include "engine/pipeline/quality/error_sums.h"
#include "engine/scene/light/lights.h"
#include "engine/shade/shading.h"
#include "engine/store/reader.h"

namespace ptc {

/// Rays of each of the two sets of a receiver.
struct RayPair {
  unsigned rays = 512;
  std::uint64_t seed = 0;
};

/// Traces two independent sets of rays from each receiver at the discs of a container, with the
/// light of its surfels. What emits counts where no emitters lit the surfels.
/// @param left  memory for the rays
/// @return      two results for each receiver, side by side
/// @throws LimitError, FormatError, std::system_error
[[nodiscard]] std::vector<Shading> trace_pairs(const ContainerReader& scene, const Sky& sky,
                                               std::span<const Receiver> receivers,
                                               const RayPair& pair, const MemoryBudget& left,
                                               const Executor& executor);

/// Returns the errors of pairs of results whose rays went along the directions of the true ones, so
/// that the noise which both share is no part of them.
/// @param ours, truth  two results for each receiver, side by side
[[nodiscard]] BoundedError error_of_pairs(std::span<const Shading> ours,
                                          std::span<const Shading> truth);

}  // namespace ptc
