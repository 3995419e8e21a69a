// Container to shaded points (engine/pipeline/pipeline.h).
#include <algorithm>
#include <cstring>
#include <memory>
#include <numbers>
#include <optional>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include "engine/base/memory.h"
#include "engine/io/cloud/record.h"
#include "engine/pipeline/light/bounces.h"
#include "engine/pipeline/pipeline.h"
#include "engine/pipeline/quality/check.h"
#include "engine/pipeline/quality/estimate.h"
#include "engine/pipeline/quality/tuning.h"
#include "engine/pipeline/shade/shaded_sink.h"
#include "engine/pipeline/stages.h"
#include "engine/shade/shader.h"
#include "engine/store/writer.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr std::size_t kBatch = 16 * Shader::kBlock;  // receivers in memory at once

/// Some of a container's points in order, in blocks.
class PointCursor {
 public:
  /// @param wanted  how many, evenly spread; at most as many as there are
  /// @param from    the first of those wanted that next() gives, below `wanted`
  /// @param lost    where damaged pages are told, whose points are passed over; null: they are
  /// errors
  PointCursor(const ContainerReader& container, std::uint64_t wanted, std::uint64_t from = 0,
              LostPages* lost = nullptr)
      : container_(container),
        wanted_(wanted),
        lost_(lost),
        payload_(container.page_payload_limit()) {
    if (from == 0) return;
    const std::uint64_t points = container.superblock().points;
    const std::uint64_t passed = (from * points + wanted - 1) / wanted;  // so far `from` were taken
    share_ = passed * wanted - from * points;
    page_ = static_cast<std::size_t>(passed / container.superblock().points_per_page);
    if (page_ < container.point_pages().size()) read_page();
    at_ = static_cast<std::uint32_t>(passed % container.superblock().points_per_page);
  }

  std::size_t next(std::span<Surfel> out) {
    std::size_t filled = 0;
    while (filled < out.size()) {
      if (at_ == count_) {
        pass_pages();
        if (page_ == container_.point_pages().size()) break;
        read_page();
      }
      const PointPage points(payload_.data(), count_);
      for (; at_ < count_ && filled < out.size(); ++at_) {
        share_ += wanted_;
        if (share_ < container_.superblock().points) continue;
        share_ -= container_.superblock().points;
        if (whole_) out[filled++] = to_surfel(points[at_], container_.header().frame);
      }
    }
    return filled;
  }

 private:
  /// Goes by pages without a point that is wanted.
  void pass_pages() {
    for (; page_ < container_.point_pages().size(); ++page_) {
      const std::uint64_t share =
          share_ + wanted_ * container_.entry(container_.point_pages()[page_]).record_count;
      if (share >= container_.superblock().points) return;
      share_ = share;
    }
  }

  void read_page() {
    const std::uint32_t page = container_.point_pages()[page_++];
    whole_ = read_unless_lost(container_, page, payload_, decoder_, lost_);
    count_ = container_.entry(page).record_count;
    at_ = 0;
  }

  const ContainerReader& container_;
  std::uint64_t wanted_;
  LostPages* lost_;
  bool whole_ = true;        // the page at hand
  std::uint64_t share_ = 0;  // wanted_ for each point passed, less the points for each one taken
  std::vector<std::byte> payload_;
  PageDecoder decoder_;
  std::size_t page_ = 0;
  std::uint32_t at_ = 0;
  std::uint32_t count_ = 0;
};

std::string settings_text(const ShadeRequest& request, const GatherOptions& g) {
  std::string text =
      fmt::format("solid_angle {} parallax {} inflation {} resolution {} sides {} lift {}",
                  g.solid_angle, g.parallax, g.inflation, g.resolution,
                  g.sides == Sides::both ? "both" : "front", request.lift);
  if (request.bounces != 1) text += fmt::format(" bounces {}", request.bounces);
  if (request.estimate) text += " estimates";
  return text;
}

/// The container of the receivers of a request; a cloud is built into one for the time of the run.
std::unique_ptr<ContainerReader> open_receivers(const ShadeRequest& request,
                                                const std::filesystem::path& target,
                                                Progress& progress) {
  if (request.receivers.extension() == ".ptcx")
    return std::make_unique<ContainerReader>(request.receivers);
  // They need no light.
  BuildRequest build{.inputs = {request.receivers},
                     .lights = LightRig{},
                     .profile = Profile::raw,
                     .run = request.run};
  return make_temporary(
      roomiest_temp_dir(request.run, target),
      [&](const std::filesystem::path& path) { build_container(build, path, progress); });
}

/// Shades what a cursor gives, batch by batch.
/// @param estimator  or null
/// @return CPU seconds of the gather
double shade_all(PointCursor& cursor, Shader& shader, Estimator* estimator, float lift,
                 ShadedSink& sink, CheckSample& check, Progress& progress) {
  double cpu = 0;
  std::vector<Surfel> surfels(kBatch);
  std::vector<Receiver> batch(kBatch);
  std::vector<Shading> results(kBatch);
  while (const std::size_t count = cursor.next(surfels)) {
    for (std::size_t i = 0; i < count; ++i) batch[i] = lifted(surfels[i], lift);
    const double before = cpu_seconds();
    shader.shade(std::span(batch).first(count), std::span(results).first(count), progress);
    cpu += cpu_seconds() - before;
    const auto receivers = std::span(batch).first(count);
    const auto shaded = std::span(results).first(count);
    std::span<const ErrorEstimate> estimates;
    if (estimator) estimates = estimator->estimate(receivers, shaded);
    check.add(receivers, shaded, estimates);
    sink.write(std::span(surfels).first(count), shaded, estimates);
  }
  return cpu;
}

/// Runs of points that stand for all that are shaded.
std::vector<Pilot> pilots_of(const ContainerReader& container, std::uint64_t points, float radii) {
  const PilotPlan plan = plan_pilots(points);
  std::vector<Pilot> pilots(plan.count);
  std::vector<Surfel> surfels(plan.receivers);
  for (std::size_t i = 0; i < pilots.size(); ++i) {
    PointCursor cursor(container, points, i * plan.stride + (plan.stride - plan.receivers) / 2);
    const std::size_t count = cursor.next(surfels);
    pilots[i].receivers.resize(count);
    std::ranges::transform(std::span(surfels).first(count), pilots[i].receivers.begin(),
                           [&](const Surfel& s) { return lifted(s, radii); });
  }
  return pilots;
}

/// Points that are wanted and can be read.
std::uint64_t count_whole(const ContainerReader& container, std::uint64_t wanted, LostPages& lost) {
  PointCursor cursor(container, wanted, 0, &lost);
  std::vector<Surfel> block(Shader::kBlock);
  std::uint64_t count = 0;
  while (const std::size_t more = cursor.next(block)) count += more;
  return count;
}

}  // namespace

ShadeReport shade_container(const ShadeRequest& request, const std::filesystem::path& target,
                            Progress& progress) {
  ShadeReport report;
  check_estimate_request(request.estimate, request.error, request.check);
  check_damage_request(request.tolerate_damage, request.bounces, request.error, request.check);
  if (request.tolerate_damage && request.receivers.empty() && target.extension() != ".ply") {
    throw std::invalid_argument(
        "a container would keep what is damaged: name a .ply, or salvage the scene first");
  }
  const Executor executor(request.run.threads);
  const ContainerReader scene(request.scene);
  const std::unique_ptr<ContainerReader> other =
      request.receivers.empty() ? nullptr : open_receivers(request, target, progress);
  const ContainerReader& receivers = other ? *other : scene;
  const std::uint64_t all = receivers.superblock().points;
  const std::uint64_t wanted = request.count == 0 ? all : std::min(request.count, all);
  const std::unique_ptr<LostPages> lost =
      request.tolerate_damage ? std::make_unique<LostPages>(scene) : nullptr;
  LostPages* const receivers_lost = other ? nullptr : lost.get();
  const std::uint64_t points =
      receivers_lost ? count_whole(receivers, wanted, *receivers_lost) : wanted;
  if (wanted < all && target.extension() != ".ply") {
    throw std::invalid_argument(
        "a container of some of the points cannot be written: name a .ply, or shade them all");
  }

  const Sky sky = request.sky ? *request.sky : recorded_lights(scene).sky;
  const std::uint64_t taken = kBufferBytes + (other ? open_bytes(*other) : 0) +
                              sink_bytes(target, receivers) +
                              bounce_bytes(scene, request.bounces, executor.threads());
  ShadeOptions options{.cache_bytes = cache_bytes_left(request.run, taken, scene,
                                                       readers_of(executor, request.estimate),
                                                       request.back_end, "shading"),
                       .back_end = request.back_end,
                       .gather = request.gather,
                       .sky = sky_function(sky),
                       .lost = lost.get()};
  options.gather.bleeding = request.bounces > 0;
  const std::unique_ptr<ContainerReader> bounced = bounce_light(
      scene, {request.bounces, options, request.lift, roomiest_temp_dir(request.run, target)},
      executor, report, progress);
  const ContainerReader& lit = bounced ? *bounced : scene;
  ReceiverPlaces compared;
  std::vector<Pilot> pilots;
  if (request.error || request.estimate) pilots = pilots_of(receivers, points, request.lift);
  std::vector<Shading> traced;  // by rays, of the pilots
  if (request.error) {
    const Stage stage(report.seconds, progress, "tune", 0, "receivers");
    report.tuning =
        tune(lit, options, *request.error, pilots, executor, progress, compared, traced);
    options.gather = report.tuning->gather;
  }
  std::unique_ptr<Estimator> estimator;
  if (request.estimate) {
    const Stage stage(report.seconds, progress, "estimate", 0, "receivers");
    if (!request.error) {
      traced = trace_pilots(lit, options, pilots, request.check.rays, executor, progress, compared);
    }
    estimator = std::make_unique<Estimator>(lit, options, pilots, traced, executor);
    options.cache = &estimator->cache();
  }
  const std::unique_ptr<ShadedSink> sink = make_shaded_sink(
      target, receivers, points, settings_text(request, options.gather), request.estimate);
  CheckSample check(request.check, std::move(compared));
  {
    const Stage stage(report.seconds, progress, "shade", points, "points");
    Shader shader(lit, options, executor);
    PointCursor cursor(receivers, wanted, 0, receivers_lost);
    report.shade_cpu_seconds =
        shade_all(cursor, shader, estimator.get(), request.lift, *sink, check, progress);
    report.gather = shader.counts();
    report.cache = shader.cache_statistics();
  }
  if (estimator) {
    report.cache = estimator->cache_statistics();
    report.estimate = estimator->report();
    estimator.reset();  // its pages make room for rays
  }
  sink->finish();
  report.bounces = request.bounces;
  report.receivers = points;
  if (lost) report.damage = damage_report(scene, *lost, report.gather.damage);
  if (request.check.receivers > 0) {
    const Stage stage(report.seconds, progress, "check", std::uint64_t{2} * request.check.receivers,
                      "references");
    report.check = check.compare(lit, request.gather.sides, sky, nullptr, nullptr,
                                 {{}, request.bounces}, options.cache_bytes, executor, progress);
  }
  return report;
}

}  // namespace ptc
