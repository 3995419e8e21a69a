#include "tools/bench/accuracy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <random>

#include <fmt/format.h>

#include "engine/measure/flip.h"
#include "engine/shade/brute_force.h"
#include "engine/shade/receiver_cell.h"
#include "engine/stages.h"
#include "tools/bench/methods.h"
#include "tools/bench/rivals.h"

namespace ptc::bench {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

using Values = std::vector<float>;

Values occlusion_of(const std::vector<Shading>& shadings) {
  Values values;
  for (const Shading& s : shadings) values.push_back(s.occlusion);
  return values;
}

Values irradiance_of(const std::vector<Shading>& shadings) {
  Values values;
  for (const Shading& s : shadings) values.insert(values.end(), {s.irradiance.r, s.irradiance.g, s.irradiance.b});
  return values;
}

double relative_rms(const Values& ours, const Values& reference) {
  return over_mean(error_statistics(ours, reference)).rms;
}

/// Two independent halves and their mean.
struct Reference {
  std::vector<Shading> mean, window;
  double occlusion_noise = 0, irradiance_noise = 0;
};

using TraceOne = std::function<Shading(const Receiver&, std::uint64_t seed)>;

Reference make_reference(const ReceiverSet& set, const Checked& checked, const TraceOne& trace, const Executor& executor) {
  const auto trace_all = [&](const std::vector<std::size_t>& indices, std::uint64_t salt) {
    std::vector<Shading> results(indices.size());
    executor.for_each(indices.size(), [&](std::size_t i, unsigned) {
      results[i] = trace(set.receivers[indices[i]], salt + indices[i]);
    });
    return results;
  };
  constexpr std::uint64_t kFirst = std::uint64_t{1} << 40, kSecond = std::uint64_t{2} << 40;  // far from the methods' seeds
  const std::vector<Shading> a = trace_all(checked.receivers, kFirst), b = trace_all(checked.receivers, kSecond);
  Reference reference{.window = trace_all(checked.window, kFirst)};
  for (std::size_t i = 0; i < a.size(); ++i) {
    Shading s;
    s.occlusion = 0.5F * (a[i].occlusion + b[i].occlusion);
    s.irradiance = 0.5F * (a[i].irradiance + b[i].irradiance);
    reference.mean.push_back(s);
  }
  // Halves differ by sqrt(2) times the error of one, their mean has 1 / sqrt(2) of it.
  reference.occlusion_noise = 0.5 * relative_rms(occlusion_of(a), occlusion_of(b));
  reference.irradiance_noise = 0.5 * relative_rms(irradiance_of(a), irradiance_of(b));
  return reference;
}

/// A random choice of receivers in the order of the Z-curve, and the window's.
Checked choose(const BenchScene& scene, const ReceiverSet& set, unsigned wanted) {
  Checked checked;
  std::vector<std::size_t> all(set.receivers.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  std::mt19937_64 bits;  // its default seed
  std::ranges::sample(all, std::back_inserter(checked.receivers), wanted, bits);
  const Frame& frame = scene.container().superblock().frame;
  std::ranges::sort(checked.receivers, {}, [&](std::size_t i) { return receiver_key(frame, set.receivers[i].position, 0); });
  for (const Pixel& pixel : set.window) {
    if (pixel.receiver != ReceiverSet::kNone) checked.window.push_back(pixel.receiver);
  }
  return checked;
}

/// The window as a picture: grey for occlusion, else lit surfaces.
/// @param shadings  one for each pixel that sees something
Image picture(const ReceiverSet& set, const std::vector<Shading>& shadings, Quantity job, const glm::vec3& sky, float gain) {
  Image image{.width = set.window_width, .height = set.window_height};
  std::size_t next = 0;
  for (const Pixel& pixel : set.window) {
    if (pixel.receiver == ReceiverSet::kNone) {
      image.pixels.emplace_back(0.0F);
      continue;
    }
    const Shading& s = shadings[next++];
    if (job == Quantity::occlusion) {
      image.pixels.emplace_back(1 - s.occlusion);
    } else {
      const glm::vec3 bounced = pixel.albedo * (s.irradiance * std::numbers::inv_pi_v<float> + sky * (1 - s.occlusion));
      image.pixels.push_back(gain * (pixel.direct + bounced));
    }
  }
  return image;
}

/// The exposure that shows all but the brightest fiftieth.
float exposure(const Image& image) {
  std::vector<float> values;
  for (const glm::vec3& p : image.pixels) values.push_back(std::max({p.r, p.g, p.b}));
  if (values.empty()) return 1;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 49 / 50);
  std::ranges::nth_element(values, at);
  return *at > 0 ? 1 / *at : 1;
}

/// A method to be measured, and what becomes of it.
struct Entry {
  std::string method, setting;
  std::vector<Quantity> jobs;
  const Reference* reference;
  std::unique_ptr<Method> run;
  std::vector<double> us;
};

/// All methods on one set of receivers.
class SetRun {
 public:
  SetRun(const BenchScene& scene, const ReceiverSet& set, const AccuracyOptions& options, const RayBaseline& discs,
         const RayBaseline* mesh, const DiscRays& oracle, const Executor& executor)
      : scene_(scene), set_(set), options_(options), executor_(executor), checked_(choose(scene, set, options.checked)),
        cache_(scene.container(),
               {.memory_bytes = PageCache::bytes_for(scene.container(), executor.threads(), scene.container().page_count()),
                .threads = executor.threads()}) {
    ours_ = make_reference(set, checked_, [&](const Receiver& r, std::uint64_t seed) {
      return oracle.trace(r, options.reference_rays, seed);
    }, executor);
    const auto baseline = [&](const RayBaseline& rays) {
      return make_reference(set, checked_, [&](const Receiver& r, std::uint64_t seed) {
        return rays.trace(r, RayBaseline::Job::bleeding, RayBaseline::Packets::sixteen, options.reference_rays, seed);
      }, executor);
    };
    discs_ = baseline(discs);
    if (mesh) mesh_ = baseline(*mesh);
    has_light_ = error_statistics(irradiance_of(ours_.mean), irradiance_of(ours_.mean)).reference_mean > 0;
    add_gathers();
    add_rays("embree-discs", discs, discs_);
    if (mesh) add_rays("embree-mesh", *mesh, *mesh_);
  }

  void measure(Progress& progress) {
    progress.begin(scene_.name() + " " + set_.name, options_.repeats * entries_.size(), "runs");
    for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
      for (Entry& entry : entries_) {
        entry.us.push_back(entry.run->run());
        progress.advance(1);
      }
    }
    progress.end();
  }

  [[nodiscard]] std::vector<AccuracyRow> rows() {
    std::vector<AccuracyRow> rows;
    for (Entry& entry : entries_) {
      const Shadings result = entry.run->result();
      for (const Quantity job : entry.jobs) rows.push_back(row_of(entry, result, job));
    }
    keep_faster_packets(rows);
    set_speedups(rows);
    return rows;
  }

  [[nodiscard]] ReferenceNote note() const {
    const Values occlusion = occlusion_of(ours_.mean), irradiance = irradiance_of(ours_.mean);
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

 private:
  [[nodiscard]] std::vector<Quantity> both_jobs() const {
    return has_light_ ? std::vector{Quantity::occlusion, Quantity::bleeding} : std::vector{Quantity::occlusion};
  }

  void add_gathers() {
    for (const GatherOptions& options : options_.settings) {
      entries_.push_back({"ptcx", fmt::format("{} sr, {} rad, R {}", options.solid_angle, options.parallax, options.resolution),
                          both_jobs(), &ours_, make_gather(scene_, set_, checked_, options, cache_, executor_), {}});
    }
    for (const float solid_angle : options_.plain_solid_angles) {
      entries_.push_back({"plain", fmt::format("{} sr", solid_angle), both_jobs(), &ours_,
                          make_plain(scene_, set_, checked_, {.solid_angle = solid_angle}, cache_, executor_), {}});
    }
  }

  void add_rays(const std::string& name, const RayBaseline& baseline, const Reference& reference) {
    for (const unsigned rays : options_.rays) {
      for (const auto packets : {RayBaseline::Packets::single, RayBaseline::Packets::sixteen}) {
        const std::string setting = fmt::format("{} rays, {}", rays, packets == RayBaseline::Packets::single ? "single" : "packets");
        for (const Quantity job : both_jobs()) {
          const auto kind = job == Quantity::occlusion ? RayBaseline::Job::occlusion : RayBaseline::Job::bleeding;
          entries_.push_back({name, setting, {job}, &reference,
                              make_rays(baseline, set_, checked_, {kind, packets, rays}, executor_), {}});
        }
      }
    }
  }

  [[nodiscard]] AccuracyRow row_of(const Entry& entry, const Shadings& result, Quantity job) const {
    AccuracyRow row{.scene = scene_.name(),
                    .set = set_.name,
                    .method = entry.method,
                    .setting = entry.setting,
                    .job = job,
                    .receivers = entry.run->receivers(),
                    .us_per_receiver = spread_of(entry.us),
                    .flip = flip_of(result.window, entry.reference->window, job),
                    .occlusion_rms_mesh = kNone,
                    .irradiance_rms_mesh = kNone};
    const GatherCounts counts = entry.run->counts();
    if (counts.receivers > 0) {
      const auto mean = [&](std::uint64_t count) { return count * 1000 / counts.receivers; };
      row.counts = {1000, mean(counts.cells), mean(counts.groups), mean(counts.surfel_blocks), mean(counts.clusters), mean(counts.surfels),
                    mean(counts.retests)};
    }
    const Values occlusion = occlusion_of(result.checked);
    row.occlusion = over_mean(error_statistics(occlusion, occlusion_of(entry.reference->mean)));
    if (mesh_) row.occlusion_rms_mesh = relative_rms(occlusion, occlusion_of(mesh_->mean));
    if (job == Quantity::occlusion) {
      row.irradiance = {.rms = kNone, .bias = kNone, .percentile_99 = kNone, .reference_mean = kNone};
      return row;
    }
    const Values irradiance = irradiance_of(result.checked);
    row.irradiance = over_mean(error_statistics(irradiance, irradiance_of(entry.reference->mean)));
    if (mesh_) row.irradiance_rms_mesh = relative_rms(irradiance, irradiance_of(mesh_->mean));
    return row;
  }

  [[nodiscard]] double flip_of(const std::vector<Shading>& ours, const std::vector<Shading>& reference, Quantity job) const {
    if (set_.window.empty()) return kNone;
    const glm::vec3 sky = scene_.lights().sky.radiance;
    const float gain = job == Quantity::occlusion ? 1 : exposure(picture(set_, reference, job, sky, 1));
    return mean_flip(picture(set_, ours, job, sky, gain), picture(set_, reference, job, sky, gain));
  }

  const BenchScene& scene_;
  const ReceiverSet& set_;
  const AccuracyOptions& options_;
  const Executor& executor_;
  Checked checked_;
  PageCache cache_;
  Reference ours_, discs_;
  std::optional<Reference> mesh_;
  bool has_light_ = false;
  std::vector<Entry> entries_;
};

}  // namespace

const char* name_of(Quantity job) noexcept { return job == Quantity::occlusion ? "occlusion" : "bleeding"; }

std::vector<GatherOptions> AccuracyOptions::default_settings() {
  std::vector<GatherOptions> settings;
  for (const auto& [solid_angle, parallax, resolution] :
       std::initializer_list<std::tuple<float, float, unsigned>>{{0.06F, 0.3F, 32},
                                                                 {0.03F, 0.2F, 32},
                                                                 {0.02F, 0.15F, 32},
                                                                 {0.01F, 0.1F, 32},
                                                                 {0.005F, 0.07F, 32},
                                                                 {0.003F, 0.05F, 48},
                                                                 {0.001F, 0.03F, 64}}) {
    settings.push_back({.solid_angle = solid_angle, .parallax = parallax, .resolution = resolution});
  }
  return settings;
}

SceneAccuracy measure_accuracy(const BenchScene& scene, const AccuracyOptions& options, const Executor& executor,
                               Progress& progress) {
  SceneAccuracy accuracy{.surfels = scene.surfels().size(), .triangles = scene.mesh().triangles.size()};
  constexpr Sides kSides = Sides::both;
  const RayBaseline discs(scene.surfels(), kSides);
  std::optional<RayBaseline> mesh;
  if (accuracy.triangles > 0) mesh.emplace(scene.mesh(), scene.surfels(), scene.spacing());
  const DiscRays oracle(scene.surfels(), kSides, {});
  for (const ReceiverSet& set : scene.sets()) {
    if (set.receivers.empty()) continue;
    SetRun run(scene, set, options, discs, mesh ? &*mesh : nullptr, oracle, executor);
    run.measure(progress);
    accuracy.references.push_back(run.note());
    const std::vector<AccuracyRow> rows = run.rows();
    accuracy.rows.insert(accuracy.rows.end(), rows.begin(), rows.end());
  }
  return accuracy;
}

}  // namespace ptc::bench
