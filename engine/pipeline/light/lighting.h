// One run of the gather, or of rays in its place: what shading points and rendering a picture have
// in common.
//
// Between two pictures of a sequence comes begin_picture().
//
//   Lighting()  ->  prepare()        ->  tune()       ->  shade() ...  ->  finish()  ->  check()
//   open the        divide memory,       settings by      block by         complete      rays at
//   scene           earlier bounces      pilots           block            the report    a sample
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
#include "engine/pipeline/light/receiver_light.h"
#include "engine/pipeline/quality/check.h"
#include "engine/pipeline/quality/estimate.h"
#include "engine/pipeline/quality/mirror_rays.h"
#include "engine/pipeline/quality/tuning.h"
#include "engine/pipeline/run.h"
#include "engine/scene/light/lights.h"
#include "engine/scene/sampling/sampler.h"
#include "engine/shade/lost_pages.h"
#include "engine/shade/shader.h"
#include "engine/store/reader.h"
#include "engine/trace/ray_shader.h"

namespace ptc {

/// A request for what surfaces would reflect if they were rough mirrors (spec/shading.md#glossy).
struct GlossyRequest {
  /// Roughness, 0 to 1, as glTF and most renderers have it; 0 is a polished mirror. Empty: nothing
  /// is reflected.
  std::optional<float> roughness;
  /// Rays of each receiver, 1 or more; 0: as many as meet LightingRequest::error, or kMirrorRays.
  unsigned rays = 0;
};

/// The common part of the requests to shade points and to render a picture: the scene whose surfels
/// light the receivers, the quality and the resources.
struct LightingRequest {
  /// Container whose surfels occlude and emit. Of a mesh or a cloud, a container is built for the
  /// run.
  std::filesystem::path scene;
  /// Meshes, clouds and containers that are joined with `scene` in a container for the run.
  std::vector<std::filesystem::path> joined;
  /// What a container that is built for the run records as the names of its inputs; empty: their
  /// file names.
  std::string scene_names;
  /// How densely the meshes of a scene that is built for the run are sampled.
  SamplingOptions sampling;
  /// Axis that points up, x, y or z, in a scene that is built for the run; empty: as its files say,
  /// else y.
  std::string up;
  /// Reflections of the light before it reaches a receiver, at most. Every bounce but the last
  /// shades all points of the scene. 0: occlusion and sky alone, whatever GatherOptions::bleeding
  /// says.
  unsigned bounces = 1;
  /// Container with the light of all bounces but the last, as bounce_part() and join_parts() make
  /// it of `scene`. Empty: the run makes it.
  std::filesystem::path bounced;
  /// Settings of the gather, between speed and error. With `error` only its sides count.
  GatherOptions gather;
  /// Error to meet, above 0 and at most 1, as CheckError::relative(); it chooses the settings of
  /// `gather`, or rays in its place (spec/shading.md#error). Empty: `gather` is used as it is.
  std::optional<double> error;
  /// Rays of each receiver, which take the place of the gather, as TuningReport::receiver_rays; 0:
  /// the gather shades. Excludes `error` and `estimate`.
  unsigned receiver_rays = 0;
  /// Estimates the error of every receiver, for about twice the time. Needs `error` or `check`.
  bool estimate = false;
  GlossyRequest glossy;
  /// Groups of lights whose shadows are found, too (spec/shading.md#shadows).
  std::vector<std::string> shadows;
  float lift = 0.15F;  ///< height of a receiver above its surfel, in radii of the surfel
  BackEnd back_end = BackEnd::pread;  ///< how pages are read
  /// Shades past pages of the scene that break a rule, and reports them. Excludes `error`, `check`
  /// and more than one bounce, which need every point.
  bool tolerate_damage = false;
  CheckRequest check;  ///< how many receivers are compared with rays
  RunOptions run;      ///< memory, threads and temporary directories
};

/// The light that reaches the receivers of a run straight from lamps, by shadow rays at the discs
/// of the scene (spec/shading.md#emission).
struct LampRays {
  /// Whether surfels that emit light the receivers, by rays or else by the gather. Where they do
  /// not, receivers get nothing of that light, because the caller brings it.
  bool emitters = false;
  LightRig rig;            ///< whose suns, point and spot lights light the receivers
  LightSampling sampling;  ///< rays of each receiver; without area rays emitters are gathered
};

/// Checks the numbers of a request, each for itself.
/// @throws RequestError when a setting of the gather, the error asked for or the lift is out of
///         range
void check_ranges(const LightingRequest& request);

/// Says whether the settings of a gather, between speed and error, are those that hold when nothing
/// is said.
[[nodiscard]] bool has_usual_settings(const GatherOptions& gather) noexcept;

/// The damage of a scene that was shaded past damaged pages (spec/shading.md#damage).
struct DamageReport {
  /// Damaged pages that the run needed, by number, with the rule that each breaks.
  std::map<std::uint32_t, std::string> pages;
  std::uint64_t points = 0;    ///< points on these pages, neither shaded nor seen
  std::size_t node_pages = 0;  ///< number of node pages among them; a salvage builds them again
  DamageCounts stand_ins;      ///< clusters drawn in place of lost ones, with a bound on the error
};

/// The results and the costs of a run.
struct LightingReport {
  std::uint64_t receivers = 0;             ///< number of receivers that were shaded
  unsigned bounces = 1;                    ///< as LightingRequest::bounces
  double shade_cpu_seconds = 0;            ///< CPU time of the last bounce, all threads
  double bounce_cpu_seconds = 0;           ///< CPU time of earlier bounces' gathers, all threads
  double glossy_cpu_seconds = 0;           ///< CPU time of reflections, all threads
  double lamp_cpu_seconds = 0;             ///< CPU time of LampRays at receivers, all threads
  GatherOptions settings;                  ///< of the last bounce's gather; unused by rays
  GatherCounts gather;                     ///< work of the last bounce's gather; none by rays
  CacheStatistics cache;                   ///< page cache of the last bounce
  std::optional<TuningReport> tuning;      ///< present when an error was asked for
  std::optional<MirrorTuning> mirrors;     ///< present when it chose the rays of reflections
  std::optional<EstimateReport> estimate;  ///< present when estimates were asked for
  std::optional<CheckReport> check;        ///< present when a check was asked for
  std::optional<DamageReport> damage;      ///< present when damage was tolerated
  std::optional<float> exposure;           ///< that was chosen for a picture, stops
  StageSeconds seconds;                    ///< wall time of each stage
};

/// One run of the gather, phase by phase: prepare(), tune(), shade() any number of times, finish(),
/// check().
/// Memory: within the cap of the request.   Threads: one caller at a time.
class Lighting {
 public:
  /// Checks the request and opens the scene.
  /// @param request   must outlive this
  /// @param report    is filled by the phases; must outlive this
  /// @param progress  gets the stages; must outlive this
  /// @throws RequestError when a part of the request is out of range or excludes another;
  ///         FormatError, std::system_error
  Lighting(const LightingRequest& request, LightingReport& report, Progress& progress);
  ~Lighting();

  /// The open container of the request.
  [[nodiscard]] const ContainerReader& scene() const noexcept { return scene_; }
  /// The threads of the run.
  [[nodiscard]] const Executor& executor() const noexcept { return executor_; }
  /// The list to which damaged pages are added; null when damage is an error.
  [[nodiscard]] LostPages* lost() const noexcept { return lost_.get(); }

  /// Gives the rest of the budget to the page cache, then shades the bounces before the last.
  /// @param budget    already charged with everything else that the caller takes
  /// @param sky       sky that lights the receivers
  /// @param lamps     whose light rays bring to receivers; it is part of their irradiance
  /// @param variants  as ShadeOptions::variants
  /// @param eye       from where receivers are looked at, scene units; for reflections alone
  /// @param target    output of the run; its directory gets temporary files when the request names
  ///                  no directories for them
  /// @throws LimitError when the cap is too small; FormatError, std::system_error
  void prepare(MemoryBudget budget, const Sky& sky, const LampRays& lamps, unsigned variants,
               const glm::dvec3& eye, const std::filesystem::path& target);

  /// Chooses the settings and prepares the estimates, as far as the request asks for them.
  /// @param find_pilots  returns receivers that stand for the run; called only when needed
  /// @param sparse       receivers lie far apart and share little: unless the request names an
  ///                     error or settings, the gather takes coarser ones
  ///                     (spec/shading.md#sparse-pictures)
  /// @pre prepare()
  void tune(const std::function<std::vector<Pilot>()>& find_pilots, bool sparse = false);

  /// Begins a range of a run's receivers: rays are those of a run that has shaded all before it.
  /// @param first  number of the first receiver of the range
  /// @pre nothing is shaded yet
  void begin_range(std::uint64_t first) noexcept { first_ = first; }

  /// Begins another picture, in which rays are the same as in the first one.
  /// @param eye  as for prepare()
  void begin_picture(const glm::dvec3& eye) noexcept {
    mirrors_.eye = eye;
    shaded_before_ = report_.receivers;
  }

  /// The memory of the page cache, bytes, which is free for other uses between two phases.
  /// @pre prepare()
  [[nodiscard]] std::uint64_t cache_bytes() const noexcept { return options_.cache_bytes; }
  /// How pages are read.
  [[nodiscard]] BackEnd back_end() const noexcept { return request_.back_end; }

  /// The settings of the gather that shade() uses, unless it traces rays.
  [[nodiscard]] const GatherOptions& gather() const noexcept { return options_.gather; }
  /// The number of rays by which shade() shades a receiver; 0: by the gather.
  [[nodiscard]] unsigned receiver_rays() const noexcept {
    return report_.tuning ? report_.tuning->receiver_rays : request_.receiver_rays;
  }

  /// Shades a block of receivers. They should follow the Z-curve from call to call, because
  /// neighbours share pages.
  /// @param counts  as for Shader::shade_variants(); empty: variant 0 shades them all
  /// @return        one result for each receiver, valid until the next call
  /// @throws FormatError when a page is damaged and damage is not tolerated; std::system_error
  /// @pre tune()
  LitReceivers shade(std::span<const Receiver> receivers, std::span<const std::size_t> counts = {});

  /// Writes a part of the scene with the light of the last bounce (bounce_part()).
  /// @param part  index among the parts of scene()
  /// @pre prepare()
  void write_bounce(std::size_t part, const std::filesystem::path& target);

  /// Completes the report and frees the page cache. Nothing can be shaded afterwards.
  void finish();

  /// Compares a sample of the shaded receivers with rays, if the request asks for a check.
  /// @param seen  light and mesh that the rays meet besides the surfels
  /// @pre finish()
  void check(const CheckScene& seen);

 private:
  /// Collects the lamps at which rays are cast, and charges what that takes.
  void plan_lamps(MemoryBudget& budget, const LampRays& lamps);
  /// Adds the light of a set of lamps to the results of receivers.
  /// @param first  number of the first receiver
  void add_lamps(std::size_t set, std::span<const Receiver> receivers, std::uint64_t first);
  /// Returns what lights the points of earlier bounces by rays at emitters; null where their
  /// emitters have lit them, or nothing emits.
  [[nodiscard]] ReceiverLight* point_emitters() const;
  /// Returns the options of rays that show the sky as it is.
  [[nodiscard]] RayOptions own_rays() const;

  const LightingRequest& request_;
  LightingReport& report_;
  Progress& progress_;
  ThreadPool executor_;
  ContainerReader scene_;
  std::unique_ptr<LostPages> lost_;
  /// The scene with the light of earlier bounces; null for fewer than two bounces.
  std::unique_ptr<ContainerReader> bounced_;
  ShadeOptions options_;
  bool has_sky_map_ = false;
  std::function<glm::vec3(const glm::vec3&)> mirrored_sky_;  ///< the sky that mirrors show
  std::unique_ptr<ReceiverLight> lamps_;                     ///< null: no rays are cast at lamps
  bool has_emitters_ = false;  ///< whether the first set of lamps_ is of emitters
  std::unique_ptr<Estimator> estimator_;
  std::unique_ptr<Shader> shader_;   ///< null where rays shade the receivers
  std::unique_ptr<RayShader> rays_;  ///< null where the gather shades, and nothing is reflected
  Mirrors mirrors_;
  std::uint64_t mirror_bytes_ = 0;   ///< of rays_ beside a gather
  std::uint64_t shaded_before_ = 0;  ///< receivers of earlier pictures
  std::uint64_t first_ = 0;          ///< number of the first receiver of a range
  std::optional<CheckSample> sample_;
  std::vector<Shading> results_;
  std::vector<glm::vec3> arrives_;
  std::vector<Reflection> reflections_;
  std::vector<ErrorEstimate> estimates_;

  /// The container that receivers look at.
  [[nodiscard]] const ContainerReader& lit() const noexcept {
    return bounced_ ? *bounced_ : scene_;
  }
};

}  // namespace ptc
