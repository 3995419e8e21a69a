// Ways to shade the same receivers, all timed in the same way.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/shade/shader.h"
#include "tools/bench/references/ray_baseline.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/scenes/bench_scene.h"

namespace ptc::bench {

/// The receivers of a set that are compared with a reference: a random choice, whose error is
/// measured, and the window of the picture.
struct Checked {
  std::vector<std::size_t> receivers;  ///< indices into the set, neighbours next to each other
  std::vector<std::size_t> window;     ///< indices, one for each pixel that sees something
};

/// Chooses receivers at random, the same ones each time, and puts them in the order of the Z-curve.
/// @param wanted  receivers whose error is measured; all where the set has fewer
[[nodiscard]] Checked choose_checked(const BenchScene& scene, const ReceiverSet& set,
                                     unsigned wanted);

/// The shadings of the receivers of a Checked, each list in its order.
struct Shadings {
  std::vector<Shading> checked, window;
};

/// One way to shade, set up for one set of receivers.
class Method {
 public:
  virtual ~Method() = default;
  /// Shades all receivers that it times once. @return what that took
  virtual Cost run() = 0;
  /// The number of receivers that run() shades.
  [[nodiscard]] virtual std::size_t receivers() const = 0;
  /// The shadings of the last run(). Those of the window may be computed by this call.
  [[nodiscard]] virtual Shadings result() = 0;
  /// The counts of all runs together; zeros where the method does not gather.
  [[nodiscard]] virtual GatherCounts counts() const { return {}; }
};

/// Makes the hierarchical gather of all receivers of the set, which takes pages from `cache`.
[[nodiscard]] std::unique_ptr<Method> make_gather(const ContainerReader& container, const Sky& sky,
                                                  const ReceiverSet& set, const Checked& checked,
                                                  const GatherOptions& options, PageCache& cache,
                                                  const Executor& executor);
/// Makes the plain gather of the checked receivers: one after another, each from the root, without
/// what neighbours share.
[[nodiscard]] std::unique_ptr<Method> make_plain(const BenchScene& scene, const ReceiverSet& set,
                                                 const Checked& checked,
                                                 const GatherOptions& options, PageCache& cache,
                                                 const Executor& executor);

/// Makes rays from the checked receivers through the octree, by pages that all stay in memory.
/// @param bleeding  whether the light of what they meet is looked up, too
/// @param rays      rays per receiver, a square number
[[nodiscard]] std::unique_ptr<Method> make_own_rays(const ContainerReader& container,
                                                    const Sky& sky, const ReceiverSet& set,
                                                    const Checked& checked, bool bleeding,
                                                    unsigned rays, const Executor& executor);

/// How a ray tracer shades.
struct RaySetting {
  RayBaseline::Job job;
  RayBaseline::Packets packets;
  unsigned rays;  ///< rays per receiver, a power of two from 16 to 65536
};
/// Makes rays from the checked receivers.
[[nodiscard]] std::unique_ptr<Method> make_rays(const RayBaseline& baseline, const ReceiverSet& set,
                                                const Checked& checked, const RaySetting& setting,
                                                const Executor& executor);

}  // namespace ptc::bench
