// Every phase that reads the scene may use all the memory that prepare() found for the page cache,
// because no two of them run at once. Views of a sequence after the first are made beside the
// gather, with pages that the caller charged:
//
//   prepare()   bounces before the last   a cache for each, one after another
//   (caller)    the view of a picture     a cache
//   tune()      rays, gathers, rays       a cache for each, one after another
//   shade()     Shader, Estimator         one cache for both
//               or rays                   a cache
//               and rays for reflections  the same, or a share of a quarter
//   check()     rays                      a cache; finish() has freed that of shade()
#include "engine/pipeline/light/lighting.h"

#include <array>
#include <cmath>
#include <deque>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/light/bounces.h"
#include "engine/pipeline/scene_record.h"
#include "engine/scene/light/sky_map.h"
#include "engine/trace/disc_visibility.h"

namespace ptc {
namespace {

// Emitters at which rays are cast: share of the area of a scene, and number of surfels, at most
constexpr double kMostEmitting = 0.25;
constexpr std::uint64_t kMostEmitters = std::uint64_t{1} << 17;
constexpr std::uint64_t kEmittingSurfelBytes = 2 * kEmitterBytes;  // of a surfel, two triangles

/// @throws RequestError when parts of the request exclude each other
void check_combination(const LightingRequest& request) {
  require_request(request.receiver_rays == 0 || (!request.error && !request.estimate),
                  "receiver_rays", "rays that shade the receivers exclude `error` and `estimate`");
  require_request(request.receiver_rays == 0 || request.gather.around.is_plain(), "receiver_rays",
                  "rays that shade the receivers see the hemisphere at any distance: leave out the "
                  "limits of the occlusion");
  const bool traces_rays = request.error || request.check.receivers > 0;
  if (request.estimate && !traces_rays) {
    throw RequestError("estimate",
                       "`estimate` needs rays to compare with: ask for `error` or `check` as well");
  }
  if (!request.gather.around.is_plain() && (request.estimate || request.check.receivers > 0)) {
    throw RequestError("check",
                       "`check` and `estimate` compare with rays over the hemisphere at any "
                       "distance: leave out the limits of the occlusion");
  }
  if (!request.tolerate_damage) return;
  if (request.bounces > 1) {
    throw RequestError("tolerate_damage",
                       "`tolerate_damage` allows at most one bounce: further bounces read every "
                       "point. Salvage the scene first");
  }
  if (traces_rays) {
    throw RequestError("tolerate_damage",
                       "`tolerate_damage` excludes `error` and `check`: their rays read every "
                       "point. Salvage the scene first");
  }
  if (request.glossy.roughness || !request.shadows.empty()) {
    throw RequestError("tolerate_damage",
                       "`tolerate_damage` excludes `glossy.roughness` and `shadows`: their rays "
                       "read every point. Salvage the scene first");
  }
}

// Settings of the gather for receivers that lie far apart (spec/shading.md#sparse-pictures)
constexpr float kSparseSolidAngle = 0.06F, kSparseParallax = 0.3F;
constexpr unsigned kSparseResolution = 16;

/// Returns the length of the diagonal of a scene's bounds, scene units.
double diagonal_of(const ContainerReader& scene) {
  const Superblock& s = scene.superblock();
  return std::hypot(s.bounds_high[0] - s.bounds_low[0], s.bounds_high[1] - s.bounds_low[1],
                    s.bounds_high[2] - s.bounds_low[2]);
}

/// Sums up the damaged pages that a run met.
DamageReport damage_report(const ContainerReader& scene, const LostPages& lost,
                           const DamageCounts& stand_ins) {
  DamageReport report{.pages = lost.list(), .stand_ins = stand_ins};
  for (const auto& [page, why] : report.pages) {
    const DirectoryEntry& entry = scene.entry(page);
    if (entry.type == PageType::point) report.points += entry.record_count;
    if (entry.type == PageType::node) ++report.node_pages;
  }
  return report;
}

/// Checks a request before a constructor uses it. @throws RequestError
const LightingRequest& checked(const LightingRequest& request) {
  check_ranges(request);
  check_combination(request);
  return request;
}

}  // namespace

bool has_usual_settings(const GatherOptions& gather) noexcept {
  const GatherOptions usual;
  return gather.solid_angle == usual.solid_angle && gather.parallax == usual.parallax &&
         gather.inflation == usual.inflation && gather.resolution == usual.resolution;
}

void check_ranges(const LightingRequest& request) {
  constexpr unsigned kMaxRays = 1 << 24, kMaxBounces = 1000;
  const auto is_positive = [](float value) { return std::isfinite(value) && value > 0; };
  const GatherOptions& gather = request.gather;
  require_request(is_positive(gather.solid_angle), "gather.solid_angle",
                  "`gather.solid_angle` is not above 0 and finite");
  require_request(std::isfinite(gather.parallax) && gather.parallax >= 0, "gather.parallax",
                  "`gather.parallax` is not 0 or more and finite");
  require_request(is_positive(gather.inflation), "gather.inflation",
                  "`gather.inflation` is not above 0 and finite");
  require_request(gather.resolution >= 16 && gather.resolution <= 64 && gather.resolution % 16 == 0,
                  "gather.resolution", "`gather.resolution` is not 16, 32, 48 or 64");
  const Surroundings& around = gather.around;
  require_request(around.cone > 0 && around.cone <= 1.5707964F, "gather.around.cone",
                  "`gather.around.cone` is not above 0 and at most pi / 2");
  require_request(around.distance > 0, "gather.around.distance",
                  "`gather.around.distance` is not above 0");
  require_request(around.diagonals >= 0 && std::isfinite(around.diagonals),
                  "gather.around.diagonals",
                  "`gather.around.diagonals` is not 0 or more and finite");
  require_request(around.falloff <= 8, "gather.around.falloff",
                  "`gather.around.falloff` is above 8");
  require_request(request.receiver_rays <= kMaxRays, "receiver_rays",
                  "a receiver has more than 16777216 rays");
  require_request(!request.error || (*request.error > 0 && *request.error <= 1), "error",
                  "`error` is not above 0 and at most 1");
  require_request(request.check.rays >= 1 && request.check.rays <= kMaxRays, "check.rays",
                  "`check.rays` is not 1 to 16777216");
  require_request(request.bounces <= kMaxBounces, "bounces", "`bounces` is above 1000");
  require_request(!request.glossy.roughness ||
                      (*request.glossy.roughness >= 0 && *request.glossy.roughness <= 1),
                  "glossy.roughness", "`glossy.roughness` is not 0 to 1");
  require_request(request.glossy.rays <= kMaxRays, "glossy.rays",
                  "`glossy.rays` is above 16777216");
  require_request(std::isfinite(request.lift) && request.lift >= 0, "lift",
                  "`lift` is not 0 or more and finite");
}

Lighting::Lighting(const LightingRequest& request, LightingReport& report, Progress& progress)
    : request_(checked(request)),
      report_(report),
      progress_(progress),
      executor_(request.run.threads),
      scene_(with_directory_under(request.scene, request.run)) {
  if (request.tolerate_damage) lost_ = std::make_unique<LostPages>(scene_);
  report_.bounces = request.bounces;
}

Lighting::~Lighting() = default;

void Lighting::plan_lamps(MemoryBudget& budget, const LampRays& lamps) {
  options_.gather.emission = lamps.emitters;
  // Rays arrive by the cosine at the normal; and damaged pages may hold emitters or what hides them
  if (request_.bounces == 0 || !request_.gather.around.is_hemisphere() || lost_) return;
  // The scene alone decides on rays at emitters, so that neither cap nor threads change results
  std::uint64_t emitting = 0;
  if (lamps.emitters && lamps.sampling.area_rays > 0 && may_emit(scene_)) {
    const Stage stage(report_.seconds, progress_, "find emitters", 0, "points");
    const Emitting found = count_emitting(scene_);
    const bool few =
        found.count <= kMostEmitters && found.area <= kMostEmitting * scene_.superblock().area;
    if (few) emitting = found.count;
  }
  std::vector<LightRig> rigs;
  if (emitting > 0) rigs.emplace_back();
  if (has_lamps(lamps.rig)) rigs.push_back(normalised(lamps.rig));
  if (rigs.empty()) return;
  budget.charge("emitters", kEmittingSurfelBytes * emitting);
  budget.charge("rays at lamps", ReceiverLight::bytes(scene_, rigs, lamps.sampling,
                                                      executor_.threads(), request_.back_end));
  budget.require();
  has_emitters_ = emitting > 0;
  options_.gather.emission = lamps.emitters && !has_emitters_;
  std::deque<LightRays> sets;
  for (const LightRig& rig : rigs)
    sets.push_back(rays_at_lights(scene_, rig, request_.lift, sets.empty() ? emitting : 0));
  lamps_ = std::make_unique<ReceiverLight>(scene_, std::move(sets), lamps.sampling,
                                           request_.gather.sides, request_.back_end, executor_);
}

void Lighting::prepare(MemoryBudget budget, const Sky& sky, const LampRays& lamps,
                       unsigned variants, const glm::dvec3& eye,
                       const std::filesystem::path& target) {
  if (request_.bounced.empty()) {
    charge_bounces(budget, scene_, request_.bounces, executor_.threads());
  } else {
    bounced_ =
        std::make_unique<ContainerReader>(with_directory_under(request_.bounced, request_.run));
    charge_directory(budget, *bounced_);
  }
  charge_sky(budget, sky);
  if (sky.map) budget.charge("the sky as it is gathered", smooth_sky_bytes());
  if (request_.glossy.roughness) {
    mirrors_ = {.eye = eye,
                .roughness = *request_.glossy.roughness,
                .rays = request_.glossy.rays > 0 ? request_.glossy.rays : kMirrorRays};
    const std::uint64_t most_rays = request_.error ? kMostMirrorRays : mirrors_.rays;
    mirror_bytes_ = RayShader::least_bytes(scene_, executor_.threads(), request_.back_end) +
                    executor_.threads() * RayShader::kRayBytes * most_rays;
    budget.charge("rays of mirrors", mirror_bytes_);
  }
  options_ = {.back_end = request_.back_end,
              .gather = request_.gather,
              .sky = sky_function(smooth_sky(sky)),
              .visibility = disc_visibility(request_.gather.sides),
              .lost = lost_.get(),
              .variants = variants};
  // Without light on any surface there is none to gather
  const bool is_lit = scene_.superblock().flux != std::array<double, 3>{};
  options_.gather.bleeding = request_.bounces > 0 && is_lit;
  plan_lamps(budget, lamps);
  options_.cache_bytes =
      cache_bytes_left(std::move(budget), scene_, (request_.estimate ? 2 : 1) * executor_.threads(),
                       readers_of(executor_, options_, request_.estimate), request_.back_end);
  if (Surroundings& around = options_.gather.around; around.diagonals > 0) {
    around.distance = around.diagonals * static_cast<float>(diagonal_of(scene_));
    around.diagonals = 0;
  }
  has_sky_map_ = sky.map != nullptr;
  mirrored_sky_ = sky_function(sky);
  if (bounced_) return;
  bounced_ = bounce_light(scene_,
                          {request_.bounces, options_, request_.lift, point_emitters(),
                           roomiest_temp_dir(request_.run, target)},
                          executor_, report_, progress_);
}

ReceiverLight* Lighting::point_emitters() const {
  return has_emitters_ && !lit_by_emitters(scene_) ? lamps_.get() : nullptr;
}

void Lighting::add_lamps(std::size_t set, std::span<const Receiver> receivers,
                         std::uint64_t first) {
  const double before = cpu_seconds();
  arrives_.resize(receivers.size());
  lamps_->irradiance(set, receivers, first, arrives_);
  for (std::size_t i = 0; i < receivers.size(); ++i) results_[i].irradiance += arrives_[i];
  report_.lamp_cpu_seconds += cpu_seconds() - before;
}

void Lighting::tune(const std::function<std::vector<Pilot>()>& find_pilots, bool sparse) {
  ReceiverPlaces compared;
  std::vector<Pilot> pilots;
  if (sparse && !request_.error && has_usual_settings(request_.gather)) {
    options_.gather.solid_angle = kSparseSolidAngle;
    options_.gather.parallax = kSparseParallax;
    options_.gather.resolution = kSparseResolution;
  }
  if (request_.error || request_.estimate) {
    pilots = find_pilots();
    return_freed_memory();
    std::vector<Shading> traced;  // two results by rays for each compared receiver

    // Choose the settings
    if (request_.error) {
      const Stage stage(report_.seconds, progress_, "tune", 0, "receivers");
      // Rays see the whole hemisphere, and of a picture of the sky a few pixels only; estimates are
      // fitted to gathers
      const Surroundings around = options_.gather.around;
      const bool by_rays = around.is_plain() && !has_sky_map_ && !request_.estimate;
      report_.tuning = ptc::tune(lit(), options_, *request_.error, by_rays, pilots, executor_,
                                 progress_, traced);
      options_.gather = report_.tuning->gather;
      options_.gather.around = around;
    }

    // Fit the estimates; tune() has traced the pilots already
    if (request_.estimate) {
      const Stage stage(report_.seconds, progress_, "estimate", 0, "receivers");
      if (!request_.error) {
        traced = trace_pilots(lit(), options_, pilots, request_.check.rays, executor_, progress_,
                              compared);
      }
      estimator_ = std::make_unique<Estimator>(lit(), options_, pilots, traced, executor_);
      options_.cache = &estimator_->cache();
    }
  }

  if (!request_.glossy.roughness) pilots.clear();
  return_freed_memory();  // that pilots took: what comes next takes it again
  report_.settings = options_.gather;

  // Start the sample for check(), without the pilots, and the gather or the rays
  sample_.emplace(request_.check, std::move(compared));
  RayOptions with = own_rays();
  if (receiver_rays() > 0) {
    with.memory_bytes += mirror_bytes_;
  } else {
    if (request_.glossy.roughness) {
      // Mirrors take a quarter of what a gather can spare
      const std::uint64_t least = PageCache::min_bytes(
          scene_, readers_of(executor_, options_, request_.estimate), request_.back_end);
      const std::uint64_t share = estimator_ ? 0 : (options_.cache_bytes - least) / 4;
      options_.cache_bytes -= share;
      with.memory_bytes = mirror_bytes_ + share;
    }
    shader_ = std::make_unique<Shader>(lit(), options_, executor_);
  }
  if (receiver_rays() > 0 || request_.glossy.roughness)
    rays_ = std::make_unique<RayShader>(lit(), with, executor_);
  if (request_.glossy.roughness && request_.error && request_.glossy.rays == 0) {
    const Stage stage(report_.seconds, progress_, "tune reflections", 0, "receivers");
    report_.mirrors = tune_mirrors(*rays_, pilots, mirrors_, *request_.error);
    mirrors_.rays = report_.mirrors->rays;
  }
}

RayOptions Lighting::own_rays() const {
  RayOptions with = ray_options(options_);
  with.sky = mirrored_sky_;
  return with;
}

LitReceivers Lighting::shade(std::span<const Receiver> receivers,
                             std::span<const std::size_t> counts) {
  const std::array all{receivers.size()};
  if (counts.empty()) counts = all;
  results_.resize(receivers.size());
  const std::uint64_t first = first_ + report_.receivers - shaded_before_;
  const std::uint64_t seed = kRunSeed + first;
  const double before = cpu_seconds();
  if (receiver_rays() > 0) {
    rays_->trace(receivers, receiver_rays(), seed, results_, progress_);
  } else {
    shader_->shade_variants(receivers, results_, progress_, counts);
  }
  report_.shade_cpu_seconds += cpu_seconds() - before;
  LitReceivers lit{.shading = results_};
  if (request_.glossy.roughness) {
    const double start = cpu_seconds();
    reflections_.resize(receivers.size());
    rays_->reflect(receivers, mirrors_, seed, reflections_);
    report_.glossy_cpu_seconds += cpu_seconds() - start;
    lit.reflections = reflections_;
  }
  report_.receivers += receivers.size();
  if (estimator_) {
    estimates_.clear();
    for (std::size_t variant = 0, from = 0; variant < counts.size(); from += counts[variant++]) {
      const std::span<const ErrorEstimate> some = estimator_->estimate(
          receivers.subspan(from, counts[variant]),
          std::span(results_).subspan(from, counts[variant]), static_cast<unsigned>(variant));
      estimates_.insert(estimates_.end(), some.begin(), some.end());
    }
    lit.estimates = estimates_;
  }
  // A check sees the light of surfaces, by whatever it came, and nothing else
  if (has_emitters_) add_lamps(0, receivers, first);
  sample_->add(receivers, lit);
  if (lamps_ && lamps_->size() > (has_emitters_ ? 1 : 0))
    add_lamps(lamps_->size() - 1, receivers, first);
  return lit;
}

void Lighting::write_bounce(std::size_t part, const std::filesystem::path& target) {
  bounce_part(scene_, lit(), {request_.bounces, options_, request_.lift, point_emitters(), {}},
              part, target, executor_, report_, progress_);
}

void Lighting::finish() {
  if (!shader_) {
    report_.cache = rays_->cache_statistics();
  } else {
    report_.gather = shader_->counts();
    report_.cache = shader_->cache_statistics();
  }
  if (estimator_) {
    report_.cache = estimator_->cache_statistics();
    report_.estimate = estimator_->report();
  }
  if (lost_) report_.damage = damage_report(scene_, *lost_, report_.gather.damage);
  estimator_.reset();
  shader_.reset();
  rays_.reset();
}

void Lighting::check(const CheckScene& seen) {
  if (request_.check.receivers == 0) return;
  const std::uint64_t references = (seen.mesh ? 4 : 2) * std::uint64_t{request_.check.receivers};
  const Stage stage(report_.seconds, progress_, "check", references, "references");
  RayOptions with = own_rays();
  with.emission |= has_emitters_;
  report_.check = sample_->compare(lit(), with, mirrors_, seen, executor_, progress_);
}

}  // namespace ptc
