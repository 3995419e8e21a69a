#include "engine/pipeline/quality/disc_pairs.h"

#include <cstddef>

#include "engine/base/progress.h"
#include "engine/pipeline/scene_record.h"
#include "engine/trace/ray_shader.h"

namespace ptc {

std::vector<Shading> trace_pairs(const ContainerReader& scene, const Sky& sky,
                                 std::span<const Receiver> receivers, const RayPair& pair,
                                 const MemoryBudget& left, const Executor& executor) {
  const std::uint64_t least =
      RayShader::least_bytes(scene, executor.threads(), RayOptions{}.back_end);
  RayShader discs(scene,
                  {.sky = [&](const glm::vec3& way) { return sky.at(way); },
                   .emission = !lit_by_emitters(scene),
                   .memory_bytes = left.rest("the page cache", least)},
                  executor);
  const std::vector<Receiver> twice = two_of_each(receivers);
  std::vector<Shading> traced(twice.size());
  Progress silent;
  discs.trace(twice, pair.rays, pair.seed, traced, silent);
  return traced;
}

BoundedError error_of_pairs(std::span<const Shading> ours, std::span<const Shading> truth) {
  std::vector<ErrorSums> errors(ours.size() / 2);
  for (std::size_t i = 0; i < errors.size(); ++i)
    errors[i].add(ours[2 * i], truth[2 * i], ours[2 * i + 1], truth[2 * i + 1]);
  return bounded_error(errors);
}

}  // namespace ptc
