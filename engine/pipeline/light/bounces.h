// Light of more than one bounce (spec/shading.md#bounces).
#pragma once

#include <filesystem>
#include <memory>

#include "engine/base/memory_budget.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/shade/shader.h"
#include "engine/store/reader.h"

namespace ptc {

struct BounceOptions {
  unsigned bounces = 1;  ///< of light that reaches a receiver
  ShadeOptions
      shade;  ///< of the receivers; the points are shaded more coarsely, and without the sky
  float lift = 0.15F;  ///< in radii of a surfel
  std::filesystem::path temp_dir;
};

/// Charges the two temporary containers of which one is read while the next is written; nothing for
/// one bounce or none.
void charge_bounces(MemoryBudget& budget, const ContainerReader& scene, unsigned bounces,
                    unsigned threads);

/// What receivers look at to see light of `bounces` bounces: the points and the tree of `scene`,
/// with the radiance of every point as first lit plus albedo / pi times its irradiance of a bounce
/// less.
///
/// The points are shaded in their order, so they need no second sort; one temporary container a
/// bounce, two at once. Depends on neither threads nor cap.
/// @param report  gets a stage and the CPU time of every pass
/// @return        null for one bounce or none: the scene itself
/// @throws RequestError when the surfels are lit by emissive triangles that are surfels
/// too;
///         FormatError, std::system_error
/// Memory: the cache of `shade`, what charge_bounces() charges, and buffers within kBufferBytes.
[[nodiscard]] std::unique_ptr<ContainerReader> bounce_light(const ContainerReader& scene,
                                                            const BounceOptions& options,
                                                            const Executor& executor,
                                                            LightingReport& report,
                                                            Progress& progress);

}  // namespace ptc
