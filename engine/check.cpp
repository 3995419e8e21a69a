#include "engine/check.h"

#include <algorithm>
#include <cmath>

#include "engine/base/memory.h"
#include "engine/shade/brute_force.h"
#include "engine/stages.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMostSurfels = 50'000'000;

CheckError errors(std::span<const Shading> ours, std::span<const Shading> rays) {
  CheckError e;
  double irradiance_square = 0;
  const double count = static_cast<double>(ours.size());
  for (std::size_t i = 0; i < ours.size(); ++i) {
    const double occlusion = static_cast<double>(ours[i].occlusion - rays[i].occlusion);
    e.occlusion_rms += occlusion * occlusion / count;
    e.occlusion_bias += occlusion / count;
    e.occlusion_mean += static_cast<double>(rays[i].occlusion) / count;
    for (int c = 0; c < 3; ++c) {
      const double irradiance = static_cast<double>(ours[i].irradiance[c] - rays[i].irradiance[c]);
      irradiance_square += irradiance * irradiance / (3 * count);
      e.irradiance_bias += irradiance / (3 * count);
      e.irradiance_mean += static_cast<double>(rays[i].irradiance[c]) / (3 * count);
    }
  }
  e.occlusion_rms = std::sqrt(e.occlusion_rms);
  if (e.irradiance_mean > 0) {
    e.irradiance_rms = std::sqrt(irradiance_square) / e.irradiance_mean;
    e.irradiance_bias /= e.irradiance_mean;
  }
  return e;
}

/// Calls body(i) for all i and returns the CPU microseconds of one call.
template <class Body>
double timed(std::size_t count, const Executor& executor, const Body& body) {
  const double before = cpu_seconds();
  executor.for_each(count, [&](std::size_t i, unsigned) { body(i); });
  return (cpu_seconds() - before) * 1e6 / static_cast<double>(count);
}

}  // namespace

void CheckSample::add(std::span<const Receiver> receivers, std::span<const Shading> results) {
  if (request_.receivers == 0) return;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    ++seen_;
    if (receivers_.size() < request_.receivers) {
      receivers_.push_back(receivers[i]);
      results_.push_back(results[i]);
    } else if (const std::uint64_t slot = bits_() % seen_; slot < request_.receivers) {
      receivers_[slot] = receivers[i];
      results_[slot] = results[i];
    }
  }
}

CheckReport CheckSample::compare(const ContainerReader& scene, Sides sides, const Sky& sky,
                                 const DirectLight* light, const RayScene* mesh,
                                 const LightPaths& paths, const Executor& executor, Progress& progress) const {
  CheckReport report{.receivers = receivers_.size(), .rays = request_.rays};
  if (receivers_.empty()) return report;
  std::vector<Shading> traced(receivers_.size());
  {
    const std::vector<Surfel> surfels = load_surfels(scene, kMostSurfels);
    const DiscRays discs(surfels, sides, sky_function(sky));
    report.disc_microseconds = timed(receivers_.size(), executor, [&](std::size_t i) {
      traced[i] = discs.trace(receivers_[i], request_.rays, i);
      progress.advance(1);
    });
  }
  report.discs = errors(results_, traced);
  if (!light || !mesh) return report;
  report.mesh_microseconds = timed(receivers_.size(), executor, [&](std::size_t i) {
    const RayTraced seen = trace_mesh(*mesh, *light, receivers_[i].position, receivers_[i].normal,
                                      request_.rays, paths, i);
    traced[i] = {.occlusion = seen.occlusion, .irradiance = seen.irradiance, .sky = seen.sky};
    progress.advance(1);
  });
  report.mesh = errors(results_, traced);
  return report;
}

}  // namespace ptc
