// Measures all methods on one set of receivers of one scene.
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

/// The ray tracers of one scene. They must outlive the SetRun.
struct SceneRays {
  const DiscRays* oracle = nullptr;    ///< the reference of ptcx, ptcx-rays and plain
  const RayBaseline* discs = nullptr;  ///< null: embree-discs is not measured
  const RayBaseline* mesh = nullptr;   ///< null for a cloud
};

/// Runs every method and setting once, then all of them again, and so on. A disturbance of the
/// machine that lasts a while then slows all methods, not one:
///
///   run 1: ptcx, plain, embree-discs, embree-mesh   run 2: ptcx, plain, ...
class SetRun {
 public:
  /// Traces the references. All arguments outlive this.
  SetRun(const BenchScene& scene, const ReceiverSet& set, const AccuracyOptions& options,
         const SceneRays& rays, const Executor& executor, Progress& progress);
  ~SetRun();

  /// Times all methods, AccuracyOptions::repeats runs each.
  void measure(Progress& progress);
  /// Returns the rows, with errors and speedups. Of single rays and packets only the faster stay.
  /// @pre called once, after measure()
  [[nodiscard]] std::vector<AccuracyRow> rows();
  /// Describes the reference of ptcx, ptcx-rays and plain.
  [[nodiscard]] ReferenceNote note() const;

 private:
  struct Entry;

  /// Traces the reference of each model that a method shades.
  void trace_references(const SceneRays& rays);
  void add(std::string method, std::string setting, std::vector<Quantity> jobs,
           const Reference& reference, std::unique_ptr<Method> run);
  /// Adds the settings of ptcx, ptcx-rays and plain.
  void add_own();
  /// Adds the rays of embree-discs or embree-mesh.
  void add_rays(const std::string& name, const RayBaseline& baseline, const Reference& reference);
  /// The rows with times and without errors.
  [[nodiscard]] std::vector<AccuracyRow> timed_rows() const;
  [[nodiscard]] Entry& entry_of(const AccuracyRow& row);
  /// Sets the errors of a row.
  void compare(AccuracyRow& row);
  /// Occlusion and bleeding, or occlusion alone in a scene without light.
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
