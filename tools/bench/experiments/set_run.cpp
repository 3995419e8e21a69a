// One entry for each method, setting and quantity, and for rays both single and in packets:
//
//   trace references -> entries: ptcx, ptcx-rays, plain, embree-discs, embree-mesh
//   repeats times:      run every entry once                      (measure())
//   then:               rows -> keep faster packets -> errors -> speedups   (rows())
#include "tools/bench/experiments/set_run.h"

#include <algorithm>

#include <fmt/format.h>

#include "tools/bench/experiments/rivals.h"
#include "tools/bench/experiments/window.h"

namespace ptc::bench {
namespace {

constexpr ErrorStatistics kNoErrors{
    .rms = kNone, .bias = kNone, .percentile_99 = kNone, .reference_mean = kNone};

/// A cache with room for all pages, so that nothing that is timed waits for the disk.
CacheOptions whole_scene(const ContainerReader& container, unsigned threads) {
  return {.memory_bytes = PageCache::bytes_for(container, threads, container.page_count()),
          .threads = threads};
}

/// The mean counts of a receiver, times 1000.
GatherCounts mean_counts(const GatherCounts& counts) {
  if (counts.receivers == 0) return {};
  const auto mean = [&](std::uint64_t count) { return count * 1000 / counts.receivers; };
  return {.receivers = 1000,
          .cells = mean(counts.cells),
          .groups = mean(counts.groups),
          .surfel_blocks = mean(counts.surfel_blocks),
          .clusters = mean(counts.clusters),
          .surfels = mean(counts.surfels),
          .retests = mean(counts.retests)};
}

std::string setting_text(const GatherOptions& options) {
  std::string text =
      fmt::format("{} sr, {} rad, R {}", options.solid_angle, options.parallax, options.resolution);
  if (options.inflation != GatherOptions{}.inflation)
    text += fmt::format(", x {}", options.inflation);
  return text;
}

}  // namespace

/// A method at one setting, the times of its runs and its shadings.
struct SetRun::Entry {
  std::string method, setting;
  std::vector<Quantity> jobs;
  const Reference* reference;
  std::unique_ptr<Method> run;
  Costs costs;
  std::optional<Shadings> result;

  [[nodiscard]] bool has(Quantity job) const { return std::ranges::find(jobs, job) != jobs.end(); }
};

SetRun::SetRun(const BenchScene& scene, const ReceiverSet& set, const AccuracyOptions& options,
               const SceneRays& rays, const Executor& executor, Progress& progress)
    : scene_(scene),
      set_(set),
      options_(options),
      executor_(executor),
      checked_(choose_checked(scene, set, options.checked)),
      cache_(scene.container(), whole_scene(scene.container(), executor.threads())) {
  progress.begin(scene_.name() + " " + set_.name + ", references", 0, "rays");
  trace_references(rays);
  progress.end();
  add_own();
  if (discs_) add_rays("embree-discs", *rays.discs, *discs_);
  if (mesh_ && options_.measures("embree-mesh")) add_rays("embree-mesh", *rays.mesh, *mesh_);
}

SetRun::~SetRun() = default;

void SetRun::trace_references(const SceneRays& rays) {
  // The rays of references, with a window where pictures are compared
  const auto with_window = [&](bool window) {
    return ReferenceRays{.half = options_.reference_rays,
                         .window = window ? options_.window_rays : 0};
  };
  const auto trace_baseline = [&](const RayBaseline& baseline, bool window) {
    const auto trace = [&](const Receiver& receiver, unsigned count, std::uint64_t seed) {
      return baseline.trace(receiver, RayBaseline::Job::bleeding, RayBaseline::Packets::sixteen,
                            count, seed);
    };
    return make_reference(set_, checked_, with_window(window), trace, executor_);
  };
  const auto trace_oracle = [&](const Receiver& receiver, unsigned count, std::uint64_t seed) {
    return rays.oracle->trace(receiver, count, seed);
  };
  // Trace the reference of each model
  const bool own =
      options_.measures("ptcx") || options_.measures("ptcx-rays") || options_.measures("plain");
  ours_ = make_reference(set_, checked_, with_window(own), trace_oracle, executor_);
  if (rays.discs) discs_ = trace_baseline(*rays.discs, true);
  if (rays.mesh) mesh_ = trace_baseline(*rays.mesh, options_.measures("embree-mesh"));
  has_light_ = std::ranges::any_of(ours_.mean,
                                   [](const Shading& s) { return s.irradiance != glm::vec3(0); });
}

std::vector<Quantity> SetRun::both_jobs() const {
  if (!has_light_) return {Quantity::occlusion};
  return {Quantity::occlusion, Quantity::bleeding};
}

void SetRun::add(std::string method, std::string setting, std::vector<Quantity> jobs,
                 const Reference& reference, std::unique_ptr<Method> run) {
  entries_.push_back(std::make_unique<Entry>(Entry{
      std::move(method), std::move(setting), std::move(jobs), &reference, std::move(run), {}, {}}));
}

void SetRun::add_own() {
  if (options_.measures("ptcx")) {
    for (GatherOptions options : options_.settings) {
      for (const Quantity job : both_jobs()) {
        options.bleeding = job == Quantity::bleeding;
        add("ptcx", setting_text(options), {job}, ours_,
            make_gather(scene_.container(), scene_.lights().sky, set_, checked_, options, cache_,
                        executor_));
      }
    }
  }
  if (options_.measures("ptcx-rays")) {
    for (const unsigned rays : options_.own_rays) {
      for (const Quantity job : both_jobs()) {
        add("ptcx-rays", fmt::format("{} rays", rays), {job}, ours_,
            make_own_rays(scene_.container(), scene_.lights().sky, set_, checked_,
                          job == Quantity::bleeding, rays, executor_));
      }
    }
  }
  if (options_.measures("plain")) {
    for (const float solid_angle : options_.plain_solid_angles) {
      add("plain", fmt::format("{} sr", solid_angle), both_jobs(), ours_,
          make_plain(scene_, set_, checked_, {.solid_angle = solid_angle}, cache_, executor_));
    }
  }
}

void SetRun::add_rays(const std::string& name, const RayBaseline& baseline,
                      const Reference& reference) {
  using Packets = RayBaseline::Packets;
  for (const unsigned rays : options_.rays) {
    for (const Packets packets : {Packets::single, Packets::sixteen}) {
      const char* how = packets == Packets::single ? "single" : "packets";
      for (const Quantity job : both_jobs()) {
        const auto kind =
            job == Quantity::occlusion ? RayBaseline::Job::occlusion : RayBaseline::Job::bleeding;
        add(name, fmt::format("{} rays, {}", rays, how), {job}, reference,
            make_rays(baseline, set_, checked_, {kind, packets, rays}, executor_));
      }
    }
  }
}

void SetRun::measure(Progress& progress) {
  progress.begin(scene_.name() + " " + set_.name, options_.repeats * entries_.size(), "runs");
  for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
    for (const auto& entry : entries_) {
      entry->costs.add(entry->run->run());
      progress.advance(1);
    }
  }
  progress.end();
}

std::vector<AccuracyRow> SetRun::rows() {
  std::vector<AccuracyRow> rows = timed_rows();
  keep_faster_packets(rows);  // first, for the errors of rows that are dropped would take time
  for (AccuracyRow& row : rows) compare(row);
  set_speedups(rows);
  return rows;
}

std::vector<AccuracyRow> SetRun::timed_rows() const {
  std::vector<AccuracyRow> rows;
  for (const auto& entry : entries_) {
    for (const Quantity job : entry->jobs) {
      rows.push_back({.scene = scene_.name(),
                      .set = set_.name,
                      .method = entry->method,
                      .setting = entry->setting,
                      .job = job,
                      .receivers = entry->run->receivers(),
                      .us_per_receiver = entry->costs.cpu_us(entry->run->receivers()),
                      .wall_us_per_receiver = entry->costs.wall_us(entry->run->receivers()),
                      .counts = mean_counts(entry->run->counts()),
                      .occlusion_rms_mesh = kNone,
                      .irradiance_rms_mesh = kNone});
    }
  }
  return rows;
}

SetRun::Entry& SetRun::entry_of(const AccuracyRow& row) {
  return **std::ranges::find_if(entries_, [&](const auto& entry) {
    return entry->method == row.method && entry->setting == row.setting && entry->has(row.job);
  });
}

void SetRun::compare(AccuracyRow& row) {
  Entry& entry = entry_of(row);
  if (!entry.result) entry.result = entry.run->result();
  const Shadings& result = *entry.result;
  const Reference& reference = *entry.reference;
  row.flip =
      window_flip(set_, result.window, reference.window, row.job, scene_.lights().sky.radiance);
  const std::vector<float> occlusion = occlusion_of(result.checked);
  row.occlusion = over_mean(error_statistics(occlusion, occlusion_of(reference.mean)));
  if (mesh_) row.occlusion_rms_mesh = relative_rms(occlusion, occlusion_of(mesh_->mean));
  row.irradiance = kNoErrors;
  if (row.job == Quantity::occlusion) return;
  const std::vector<float> irradiance = irradiance_of(result.checked);
  row.irradiance = over_mean(error_statistics(irradiance, irradiance_of(reference.mean)));
  if (mesh_) row.irradiance_rms_mesh = relative_rms(irradiance, irradiance_of(mesh_->mean));
}

ReferenceNote SetRun::note() const {
  const std::vector<float> occlusion = occlusion_of(ours_.mean),
                           irradiance = irradiance_of(ours_.mean);
  ReferenceNote note{.scene = scene_.name(),
                     .set = set_.name,
                     .receivers = checked_.receivers.size(),
                     .rays = 2 * options_.reference_rays,
                     .occlusion_mean = error_statistics(occlusion, occlusion).reference_mean,
                     .irradiance_mean = error_statistics(irradiance, irradiance).reference_mean,
                     .occlusion_noise = ours_.occlusion_noise,
                     .irradiance_noise = ours_.irradiance_noise,
                     .occlusion_floor = kNone,
                     .irradiance_floor = kNone};
  if (mesh_) {
    note.occlusion_floor = relative_rms(occlusion, occlusion_of(mesh_->mean));
    note.irradiance_floor = relative_rms(irradiance, irradiance_of(mesh_->mean));
  }
  return note;
}

}  // namespace ptc::bench
