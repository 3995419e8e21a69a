#include "engine/pipeline/quality/check.h"

#include "engine/base/memory.h"
#include "engine/pipeline/quality/error_sums.h"
#include "engine/pipeline/quality/mirror_rays.h"
#include "engine/trace/ray_shader.h"

namespace ptc {
namespace {

// Seed of the rays of a check: far from those that settings are chosen by
constexpr std::uint64_t kCheckSeed = std::uint64_t{1} << 34;

/// Sums up the errors of a set of receivers.
/// @param traced  two results by rays for each receiver, side by side
CheckError errors(std::span<const Shading> ours, std::span<const Shading> traced) {
  ErrorSums sums;
  for (std::size_t i = 0; i < ours.size(); ++i) sums.add(ours[i], traced[2 * i], traced[2 * i + 1]);
  return sums.error();
}

/// Calls body() and returns its CPU time in microseconds, divided by `count`.
template <class Body>
double cpu_microseconds(std::size_t count, const Body& body) {
  const double before = cpu_seconds();
  body();
  return (cpu_seconds() - before) * 1e6 / static_cast<double>(count);
}

}  // namespace

void CheckSample::add(std::span<const Receiver> receivers, const LitReceivers& lit) {
  if (request_.receivers == 0) return;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    const bool filling = receivers_.size() < request_.receivers;
    const std::uint64_t slot = filling ? receivers_.size() : bits_() % (seen_ + 1);
    ++seen_;
    if (slot >= request_.receivers || apart_.contains(receivers[i])) continue;
    if (filling) {
      receivers_.emplace_back();
      results_.emplace_back();
      if (!lit.estimates.empty()) estimates_.emplace_back();
      if (!lit.reflections.empty()) reflections_.emplace_back();
    }
    receivers_[slot] = receivers[i];
    results_[slot] = lit.shading[i];
    if (!lit.estimates.empty()) estimates_[slot] = lit.estimates[i];
    if (!lit.reflections.empty()) reflections_[slot] = lit.reflections[i];
  }
}

CheckReport CheckSample::compare(const ContainerReader& scene, const RayOptions& options,
                                 const Mirrors& mirrors, const CheckScene& seen,
                                 const Executor& executor, Progress& progress) const {
  // Shoot half of the rays from each of two copies: independent halves give the noise of the rays
  CheckReport report{.receivers = receivers_.size(), .rays = request_.rays};
  if (receivers_.empty()) return report;
  const std::vector<Receiver> twice = two_of_each(receivers_);
  const unsigned half = (request_.rays + 1) / 2;
  std::vector<Shading> traced(twice.size());

  // Trace rays at the surfels
  {
    RayShader discs(scene, options, executor);
    report.disc_microseconds = cpu_microseconds(
        receivers_.size(), [&] { discs.trace(twice, half, kCheckSeed, traced, progress); });
    report.discs = errors(results_, traced);
    if (!reflections_.empty()) {
      Mirrors more = mirrors;
      more.rays = half;
      std::vector<Reflection> reflected(twice.size());
      discs.reflect(twice, more, kCheckSeed, reflected);
      report.reflection = errors(as_shading(reflections_), as_shading(reflected));
    }
  }
  if (!estimates_.empty()) report.estimate = check_estimates(estimates_, results_, traced);

  // Trace rays at the mesh
  if (!seen.light || !seen.mesh) return report;
  report.mesh_microseconds = cpu_microseconds(receivers_.size(), [&] {
    executor.for_each(twice.size(), [&](std::size_t i, unsigned) {
      const RayTraced found = trace_mesh(*seen.mesh, *seen.light, twice[i].position,
                                         twice[i].normal, half, seen.paths, i);
      traced[i] = {.occlusion = found.occlusion, .irradiance = found.irradiance, .sky = found.sky};
      progress.advance(1);
    });
  });
  report.mesh = errors(results_, traced);
  return report;
}

}  // namespace ptc
