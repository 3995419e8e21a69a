// All methods on one set of receivers of one scene.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/shade/reference/brute_force.h"
#include "tools/bench/experiments/accuracy.h"
#include "tools/bench/references/methods.h"
#include "tools/bench/references/reference.h"

namespace ptc::bench {

/// Rays at one scene, which outlive what is measured against them.
struct SceneRays {
  const DiscRays* oracle = nullptr;    ///< truth for ptcx and plain
  const RayBaseline* discs = nullptr;  ///< null: not measured
  const RayBaseline* mesh = nullptr;   ///< null for a cloud
};

/// Measures everything in turn, as often as asked: what disturbs the machine for a while disturbs
/// all.
class SetRun {
 public:
  /// Traces the references. All arguments outlive this.
  SetRun(const BenchScene& scene, const ReceiverSet& set, const AccuracyOptions& options,
         const SceneRays& rays, const Executor& executor, Progress& progress);
  ~SetRun();

  void measure(Progress& progress);
  /// Of the faster of single rays and packets, with speedups. Call once.
  [[nodiscard]] std::vector<AccuracyRow> rows();
  [[nodiscard]] ReferenceNote note() const;

 private:
  struct Entry;

  void trace_references(const SceneRays& rays);
  void add(std::string method, std::string setting, std::vector<Quantity> jobs,
           const Reference& reference, std::unique_ptr<Method> run);
  void add_gathers();
  void add_rays(const std::string& name, const RayBaseline& baseline, const Reference& reference);
  [[nodiscard]] std::vector<AccuracyRow> timed_rows() const;
  [[nodiscard]] Entry& entry_of(const AccuracyRow& row);
  void compare(AccuracyRow& row);
  [[nodiscard]] std::vector<Quantity> both_jobs() const;

  const BenchScene& scene_;
  const ReceiverSet& set_;
  const AccuracyOptions& options_;
  const Executor& executor_;
  Checked checked_;
  PageCache cache_;
  Reference ours_;
  std::optional<Reference> discs_, mesh_;
  bool has_light_ = false;
  std::vector<std::unique_ptr<Entry>> entries_;
};

}  // namespace ptc::bench
