// What shading points and rendering a picture have in common: one run of the gather.
//
//   open the scene -> prepare: memory, earlier bounces -> tune: settings by pilots -> shade ... ->
//   finish
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/memory_budget.h"
#include "engine/base/progress.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/quality/check.h"
#include "engine/pipeline/quality/estimate.h"
#include "engine/pipeline/quality/tuning.h"
#include "engine/pipeline/run.h"
#include "engine/shade/lost_pages.h"
#include "engine/shade/shader.h"
#include "engine/store/reader.h"

namespace ptc {

/// How receivers are lit by the surfels of a container.
struct LightingRequest {
  std::filesystem::path scene;  ///< container whose surfels occlude and emit
  /// Bounces of light off surfaces; every bounce but the last shades all points of the scene. 0:
  /// occlusion and sky alone, whatever GatherOptions::bleeding says.
  unsigned bounces = 1;
  GatherOptions gather;
  /// The error to meet, above 0 and at most 1, as CheckError::relative(). It chooses `gather`,
  /// except for its sides.
  std::optional<double> error;
  /// Adds the estimated error of every receiver; needs `error` or `check`.
  bool estimate = false;
  float lift = 0.15F;  ///< receivers rise above their surfel by so many of its radii
  BackEnd back_end = BackEnd::pread;
  /// Goes on past pages of the scene that break a rule. Excludes `error`, `check` and more than one
  /// bounce, which need every point.
  bool tolerate_damage = false;
  CheckRequest check;
  RunOptions run;
};

/// A scene that was shaded past damaged pages (spec/shading.md#damage).
struct DamageReport {
  std::map<std::uint32_t, std::string> pages;  ///< needed and damaged, by number, with the reason
  std::uint64_t points = 0;                    ///< on these pages: neither shaded nor seen
  std::size_t node_pages = 0;                  ///< among these pages; a salvage builds them again
  DamageCounts stand_ins;  ///< what was drawn instead, with a bound on the error
};

/// What a run did.
struct LightingReport {
  std::uint64_t receivers = 0;
  unsigned bounces = 1;
  double shade_cpu_seconds = 0;   ///< CPU time of the gather alone, all threads
  double bounce_cpu_seconds = 0;  ///< CPU time of the gathers of earlier bounces, all threads
  GatherCounts gather;
  CacheStatistics cache;
  std::optional<TuningReport> tuning;      ///< when an error was asked for
  std::optional<EstimateReport> estimate;  ///< when estimates were asked for
  std::optional<CheckReport> check;        ///< when a check was asked for
  std::optional<DamageReport> damage;      ///< when damage was tolerated
  StageSeconds seconds;
};

/// Receivers that were shaded.
struct LitReceivers {
  std::span<const Shading> shading;
  std::span<const ErrorEstimate> estimates;  ///< empty when none were asked for
};

/// One run of the gather, phase by phase: prepare(), tune(), any number of shade(), finish().
/// Threads: one caller. Memory: within the cap of the request.
class Lighting {
 public:
  /// Checks the request and opens the scene.
  /// @param request   must outlive this
  /// @param report    gets what the run does; must outlive this
  /// @throws RequestError when a part of the request is out of range or excludes another;
  ///         FormatError, std::system_error
  Lighting(const LightingRequest& request, LightingReport& report, Progress& progress);
  ~Lighting();

  [[nodiscard]] const ContainerReader& scene() const noexcept { return scene_; }
  [[nodiscard]] const Executor& executor() const noexcept { return executor_; }
  /// Where damaged pages are noted; null when damage is an error.
  [[nodiscard]] LostPages* lost() const noexcept { return lost_.get(); }

  /// Takes what is left of the budget as page cache, then adds the light of earlier bounces.
  /// @param budget    charged with all that the caller takes besides
  /// @param variants  as ShadeOptions::variants
  /// @param target    tells where temporary files go when the run does not
  /// @throws LimitError when the cap is too small
  void prepare(MemoryBudget budget, const Sky& sky, unsigned variants,
               const std::filesystem::path& target);

  /// Chooses the settings and prepares estimates, as far as they are asked for.
  /// @param find_pilots  gives receivers that stand for the run; called when they are needed
  void tune(const std::function<std::vector<Pilot>()>& find_pilots);

  /// The settings that shade() uses.
  [[nodiscard]] const GatherOptions& gather() const noexcept { return options_.gather; }

  /// Shades receivers along the Z-curve; see Shader::shade(), also for `variant`.
  /// @return one result for each receiver, valid until the next call
  LitReceivers shade(std::span<const Receiver> receivers, unsigned variant = 0);

  /// Completes the report and gives back the memory of the page cache.
  void finish();

  /// Compares a sample of the receivers with rays, if a check is asked for. finish() comes first.
  void check(const CheckScene& seen);

 private:
  [[nodiscard]] Shader& shader();

  const LightingRequest& request_;
  LightingReport& report_;
  Progress& progress_;
  ThreadPool executor_;
  ContainerReader scene_;
  std::unique_ptr<LostPages> lost_;
  std::unique_ptr<ContainerReader> bounced_;  ///< the scene with earlier bounces; null: one bounce
  ShadeOptions options_;
  std::unique_ptr<Estimator> estimator_;
  std::unique_ptr<Shader> shader_;
  std::optional<CheckSample> sample_;
  std::vector<Shading> results_;

  [[nodiscard]] const ContainerReader& lit() const noexcept {
    return bounced_ ? *bounced_ : scene_;
  }
};

}  // namespace ptc
