// Bisection over a ladder of settings, with a bound on the error at each step.
//
// A few receivers may be off by far more than all others, and decide about the error of the run. So
// that they are found, many candidates are shaded at two coarse rungs, and those are compared more
// often that receive much light, or on which the two rungs differ; all the less does each count.
//
// Half of the pilots choose a rung, the other half confirm it: the rung that looks best at some
// pilots looks too good at them. A rung counts as good enough when its error is below what is asked
// in 95 of 100 resamples of the pilots, not just in their mean. The noise of the rays does not
// count as error (error_sums.h), so the rays need only be as many as make it small.
//
// Rays have no error but their noise, which the pilots' two results tell. So they are as many as
// bring that to what is asked, and both halves of the pilots confirm it at results of as many rays.
// What a receiver costs either way is a sum over counts, so that the choice is the same each time.
#include "engine/pipeline/quality/tuning.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "engine/base/memory.h"
#include "engine/pipeline/quality/candidates.h"
#include "engine/pipeline/quality/error_sums.h"
#include "engine/pipeline/quality/pilot_rays.h"
#include "engine/trace/ray_shader.h"

namespace ptc {
namespace {

/// Settings none of which is both slower and less exact than another on most scenes. Usual errors
/// are means over the terrain, the city and the dragon.
constexpr std::array kLadder{
    Rung{0.4F, 0.8F, 16, 0.114},     Rung{0.2F, 0.4F, 16, 0.075},
    Rung{0.1F, 0.4F, 16, 0.074},     Rung{0.06F, 0.3F, 16, 0.063},
    Rung{0.06F, 0.3F, 32, 0.051},    Rung{0.03F, 0.2F, 32, 0.036},
    Rung{0.02F, 0.15F, 32, 0.027},   Rung{0.014F, 0.12F, 32, 0.024},
    Rung{0.014F, 0.12F, 48, 0.020},  Rung{0.01F, 0.1F, 48, 0.019},
    Rung{0.007F, 0.085F, 48, 0.017}, Rung{0.005F, 0.07F, 48, 0.015},
    Rung{0.003F, 0.06F, 48, 0.0134}, Rung{0.002F, 0.05F, 64, 0.0117},
    Rung{0.001F, 0.03F, 64, 0.010},
};

// Microseconds of CPU for a receiver, without the reading of pages, fitted to 81 runs of five
// scenes and 1,000 to 200,000 receivers: the gather for a block of surfels, a cluster, and the
// pixels of a direction buffer of 16 a side; rays for the list of a receiver, and for a ray.
constexpr double kBlockCost = 0.17, kClusterCost = 0.037, kPixelsCost = 0.63;
constexpr double kListCost = 50, kRayCost = 0.35;

// Attempts to find how many rays confirm what is asked, the least growth of their number from one
// to the next, and what they are multiples of
constexpr unsigned kAttempts = 4;
constexpr double kGrowth = 1.3;
constexpr unsigned kRayStep = 32;
// Most rays of a receiver: their memory fits what is charged for a thread that gathers
constexpr unsigned kMostRays = 1U << 17;
// Seed of results by rays, far from those that they are compared with
constexpr std::uint64_t kOwnSeed = std::uint64_t{1} << 32;

/// The search of tune() and climb(): survey() if it chooses what is compared, trace, then
/// begin_shading(), then choose() and measure(), and at the end choose_rays().
class Tuner {
 public:
  /// @param pilots  must outlive this, as must the others
  Tuner(const ContainerReader& scene, const ShadeOptions& options, std::span<const Pilot> pilots,
        const Executor& executor)
      : scene_(scene),
        view_(scene),
        options_(options),
        pilots_(pilots),
        executor_(executor),
        errors_(ladder().size()),
        works_(ladder().size()) {}

  /// Chooses among the candidates of all pilots those that are compared.
  /// @param pilots  those that it was made for
  void survey(std::span<Pilot> pilots) {
    const std::vector<std::size_t> all = every_pilot(pilots);
    std::vector<std::vector<Compared>> candidates;
    for (const Pilot& pilot : pilots) candidates.push_back(candidates_of(pilot));
    const auto of = [&](std::size_t i) -> std::span<const Compared> { return candidates[i]; };
    begin_shading();
    const auto coarse = shade(kSurveyed[0], all, of), fine = shade(kSurveyed[1], all, of);
    cache_.reset();
    return_freed_memory();
    choose_compared(pilots, coarse, fine);
  }

  /// Traces the compared receivers, as trace_for() or trace_evenly().
  template <class Trace>
  void trace(const Trace& trace_with) {
    RayShader discs(scene_, ray_options(options_), executor_);
    rays_ = trace_with(discs);
  }

  /// Gives the memory of the rays, which are gone, to a page cache.
  void begin_shading() {
    return_freed_memory();
    cache_ = std::make_unique<PageCache>(
        scene_, CacheOptions{.memory_bytes = options_.cache_bytes,
                             .threads = executor_.threads() * options_.readers(),
                             .back_end = options_.back_end});
  }

  /// Shades all receivers of the pilots' stretches at a rung.
  void shade_stretches(std::size_t rung) {
    std::vector<std::vector<Compared>> whole(pilots_.size());
    for (std::size_t i = 0; i < pilots_.size(); ++i) {
      for (std::size_t at = pilots_[i].begin; at < pilots_[i].end; ++at) whole[i].push_back({at});
    }
    shade(rung, every_pilot(pilots_),
          [&](std::size_t i) -> std::span<const Compared> { return whole[i]; });
  }

  /// Returns the cheapest rung that meets `asked` at the choosing and at the confirming pilots; the
  /// size of the ladder when there is none.
  std::size_t choose(double asked) {
    std::size_t rung = cheapest(asked);
    while (rung < ladder().size() && bounded_error(errors_of(rung, kConfirming)).high > asked)
      ++rung;
    return rung;
  }

  /// Finds how many rays of a receiver meet `asked`, as choose() finds a rung, if they cost less
  /// than the gather at a rung. Frees the page cache: no rung can be measured afterwards.
  /// @return  0 when there are none
  unsigned choose_rays(double asked, std::size_t rung, Progress& progress) {
    const double gather = gather_cost(ladder()[rung], works_[rung]);
    double rays = rays_.rays_for(asked);
    cache_.reset();
    return_freed_memory();
    RayShader discs(scene_, ray_options(options_), executor_);
    own_.resize(rays_.compared.size());
    for (unsigned attempt = 0; attempt < kAttempts; ++attempt) {
      const auto steps =
          static_cast<unsigned>(std::ceil(std::min<double>(rays, kMostRays) / kRayStep));
      const unsigned count = kRayStep * std::max(1U, steps);
      if (ray_cost(count) >= gather) return 0;
      discs.trace(rays_.compared, count, kOwnSeed, own_, progress);
      const double error = std::max(bounded_error(own_errors(kChoosing)).high,
                                    bounded_error(own_errors(kConfirming)).high);
      if (error <= asked) return count;
      rays = std::max(kGrowth * count, count * rays_.rays_for(asked) / rays_.rays_for(error));
    }
    return 0;
  }

  /// Returns the error of the rays that choose_rays() found at the confirming pilots.
  [[nodiscard]] BoundedError measure_rays() const {
    return bounded_error(own_errors(pilots_.size() < 2 ? kChoosing : kConfirming));
  }

  /// Returns the error of a rung at the confirming pilots.
  /// @param all  at the choosing pilots, too
  BoundedError measure(std::size_t rung, bool all) {
    std::vector<ErrorSums> errors = errors_of(rung, kConfirming);
    if (all) {
      const std::vector<ErrorSums>& others = errors_of(rung, kChoosing);
      errors.insert(errors.begin(), others.begin(), others.end());
    }
    return bounded_error(errors);
  }

  [[nodiscard]] std::uint64_t shaded() const { return shaded_; }
  [[nodiscard]] const PilotRays& rays() const { return rays_; }

 private:
  static constexpr std::size_t kChoosing = 0, kConfirming = 1;  // even and odd pilots

  /// Returns the cheapest rung that meets `asked` at the choosing pilots, provided that errors fall
  /// along the ladder; the size of the ladder when there is none.
  std::size_t cheapest(double asked) {
    // Rungs below `low` are too coarse, rungs from `high` on are good enough
    std::size_t low = 0, high = ladder().size();
    std::size_t at = rung_of(asked);
    while (low < high) {
      at = std::clamp(at, low, high - 1);
      const double error = bounded_error(errors_of(at, kChoosing)).high;
      if (error <= asked) {
        high = at;
      } else {
        low = at + 1;
      }
      at = error > 0 ? rung_of(ladder()[at].usual_error * asked / error) : 0;
    }
    return high;
  }

  /// Returns the first rung whose usual error is at most `error`; the size of the ladder when there
  /// is none.
  static std::size_t rung_of(double error) {
    const auto found =
        std::ranges::find_if(ladder(), [&](const Rung& rung) { return rung.usual_error <= error; });
    return static_cast<std::size_t>(found - ladder().begin());
  }

  /// Returns the errors of each pilot of a part at a rung, shaded at the first call.
  const std::vector<ErrorSums>& errors_of(std::size_t rung, std::size_t part) {
    std::vector<ErrorSums>& errors = errors_[rung][part];
    if (!errors.empty() || pilots_.size() <= part) return errors;
    std::vector<std::size_t> pilots;
    for (std::size_t i = part; i < pilots_.size(); i += 2) pilots.push_back(i);
    const auto results = shade(rung, pilots, [&](std::size_t i) -> std::span<const Compared> {
      return pilots_[i].compared;
    });
    for (std::size_t k = 0; k < pilots.size(); ++k) {
      errors.push_back(
          compare(pilots[k], [&](std::size_t i) -> const Shading& { return results[k][i]; }));
    }
    return errors;
  }

  /// Shades receivers of some pilots at a rung.
  /// @param some_of  returns the receivers of a pilot: some_of(number)
  /// @return         their results, pilot by pilot
  template <class SomeOf>
  std::vector<std::vector<Shading>> shade(std::size_t rung, std::span<const std::size_t> pilots,
                                          const SomeOf& some_of) {
    ShadedPilots shaded =
        shade_pilots(view_, *cache_, options_, ladder()[rung].options(options_.gather), pilots_,
                     pilots, some_of, executor_);
    // In the order of the pilots: sums of floats must not depend on which thread shades which
    for (const GatherWork& work : shaded.works) works_[rung].add(work);
    shaded_ += shaded.receivers;
    return std::move(shaded.results);
  }

  /// Returns the errors of each pilot of a part at the results by rays.
  [[nodiscard]] std::vector<ErrorSums> own_errors(std::size_t part) const {
    std::vector<ErrorSums> errors;
    for (std::size_t i = part; i < pilots_.size(); i += 2) {
      const std::size_t first = first_of(i);
      errors.push_back(
          compare(i, [&](std::size_t k) -> const Shading& { return own_[first + k]; }));
    }
    return errors;
  }

  /// Returns the index of the first compared receiver of a pilot.
  [[nodiscard]] std::size_t first_of(std::size_t pilot) const {
    std::size_t first = 0;
    for (std::size_t i = 0; i < pilot; ++i) first += pilots_[i].compared.size();
    return first;
  }

  /// Compares the results of a pilot with its rays.
  /// @param result  returns the result of the k-th compared receiver: result(k)
  template <class Result>
  [[nodiscard]] ErrorSums compare(std::size_t index, const Result& result) const {
    const std::size_t first = 2 * first_of(index);
    const std::vector<Compared>& compared = pilots_[index].compared;
    ErrorSums sums;
    for (std::size_t k = 0; k < compared.size(); ++k) {
      const Shading* rays = &rays_.traced[first + 2 * k];
      sums.add(result(k), rays[0], rays[1], compared[k].weight);
    }
    return sums;
  }

  const ContainerReader& scene_;
  const SceneView view_;
  const ShadeOptions& options_;
  std::span<const Pilot> pilots_;
  const Executor& executor_;
  std::unique_ptr<PageCache> cache_;
  PilotRays rays_;
  // By rung and part, one for each pilot; empty where the pilots are not shaded yet
  std::vector<std::array<std::vector<ErrorSums>, 2>> errors_;
  std::vector<GatherWork> works_;  // by rung
  std::vector<Shading> own_;       // results of the compared receivers by rays
  std::uint64_t shaded_ = 0;
};

}  // namespace

std::span<const Rung> ladder() {
  return kLadder;
}

double gather_cost(const Rung& rung, const GatherWork& work) {
  const double side = rung.resolution / 16.0;
  const double sum =
      kBlockCost * work.surfel_blocks + kClusterCost * work.clusters + kRayCost * work.rays;
  return (work.receivers > 0 ? sum / work.receivers : 0) + kPixelsCost * side * side;
}

double ray_cost(unsigned rays) {
  return kListCost + kRayCost * rays;
}

TuningReport tune(const ContainerReader& scene, const ShadeOptions& options, double asked,
                  bool by_rays, std::span<Pilot> pilots, const Executor& executor,
                  Progress& progress, std::vector<Shading>& traced) {
  // Choose what is compared, and trace rays there
  Tuner tuner(scene, options, pilots, executor);
  const double start = cpu_seconds();
  tuner.survey(pilots);
  const double before = cpu_seconds();
  tuner.trace([&](RayShader& discs) { return trace_for(pilots, asked, discs, progress); });
  const double tracing_done = cpu_seconds();

  // Choose the setting
  tuner.begin_shading();
  const std::size_t chosen = tuner.choose(asked);
  const bool met = chosen < ladder().size();
  const std::size_t rung = std::min(chosen, ladder().size() - 1);

  // Report the setting and its error
  TuningReport report{.asked = asked,
                      .met = met,
                      .gather = ladder()[rung].options(options.gather),
                      .setting = static_cast<unsigned>(rung),
                      .settings = static_cast<unsigned>(ladder().size()),
                      .pilots = tuner.rays().compared.size(),
                      .rays = static_cast<unsigned>(std::lround(2 * tuner.rays().rays)),
                      .ray_cpu_seconds = tracing_done - before};
  const auto tell = [&](const BoundedError& measured) {
    report.measured = measured.error;
    report.low = measured.low;
    report.high = measured.high;
  };
  tell(tuner.measure(rung, !met || pilots.size() < 2));
  report.shaded = tuner.shaded();
  report.shade_cpu_seconds = before - start + cpu_seconds() - tracing_done;

  // See whether rays cost less
  if (by_rays) {
    const double before_rays = cpu_seconds();
    report.receiver_rays = tuner.choose_rays(asked, rung, progress);
    if (report.receiver_rays > 0) {
      report.met = true;
      tell(tuner.measure_rays());
    }
    report.ray_cpu_seconds += cpu_seconds() - before_rays;
  }
  traced = tuner.rays().traced;
  return report;
}

std::vector<RungError> climb(const ContainerReader& scene, const ShadeOptions& options,
                             std::span<const Pilot> pilots, unsigned rays, const Executor& executor,
                             Progress& progress) {
  Tuner tuner(scene, options, pilots, executor);
  tuner.trace([&](RayShader& discs) { return trace_evenly(pilots, rays, discs, progress); });
  tuner.begin_shading();
  std::vector<RungError> rungs;
  for (std::size_t rung = 0; rung < ladder().size(); ++rung) {
    const std::uint64_t shaded = tuner.shaded();
    const double before = cpu_seconds();
    tuner.shade_stretches(rung);
    const auto count = static_cast<double>(std::max<std::uint64_t>(1, tuner.shaded() - shaded));
    const double seconds = cpu_seconds() - before;
    rungs.push_back({tuner.measure(rung, true).error, seconds * 1e6 / count});
  }
  return rungs;
}

}  // namespace ptc
