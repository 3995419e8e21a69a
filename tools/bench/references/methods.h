// Ways to shade the same receivers, timed alike.
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

/// Which receivers of a set count: those whose error is measured, and the window of the picture.
struct Checked {
  std::vector<std::size_t> receivers;  ///< indices into the set, neighbours next to each other
  std::vector<std::size_t> window;     ///< likewise, one for each pixel that sees something
};

/// A random choice of receivers in the order of the Z-curve, the same each time, and the window's.
[[nodiscard]] Checked choose_checked(const BenchScene& scene, const ReceiverSet& set,
                                     unsigned wanted);

/// Shadings of them, in the same order.
struct Shadings {
  std::vector<Shading> checked, window;
};

class Method {
 public:
  virtual ~Method() = default;
  /// Shades all its receivers once.
  virtual Cost run() = 0;
  /// Receivers that run() times.
  [[nodiscard]] virtual std::size_t receivers() const = 0;
  /// What the last run gave; the window may take a run of its own.
  [[nodiscard]] virtual Shadings result() = 0;
  /// What all runs together did; zeros of methods that do not gather.
  [[nodiscard]] virtual GatherCounts counts() const { return {}; }
};

/// The hierarchical gather of the whole set, pages in `cache`.
[[nodiscard]] std::unique_ptr<Method> make_gather(const ContainerReader& container, const Sky& sky,
                                                  const ReceiverSet& set, const Checked& checked,
                                                  const GatherOptions& options, PageCache& cache,
                                                  const Executor& executor);
/// The plain gather of those checked.
[[nodiscard]] std::unique_ptr<Method> make_plain(const BenchScene& scene, const ReceiverSet& set,
                                                 const Checked& checked,
                                                 const GatherOptions& options, PageCache& cache,
                                                 const Executor& executor);
/// Rays from those checked.
struct RaySetting {
  RayBaseline::Job job;
  RayBaseline::Packets packets;
  unsigned rays;
};
[[nodiscard]] std::unique_ptr<Method> make_rays(const RayBaseline& baseline, const ReceiverSet& set,
                                                const Checked& checked, const RaySetting& setting,
                                                const Executor& executor);

}  // namespace ptc::bench
