// Container to shaded points (engine/pipeline.h).
#include <algorithm>
#include <cstring>
#include <numbers>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include "engine/base/memory.h"
#include "engine/bounces.h"
#include "engine/check.h"
#include "engine/estimate.h"
#include "engine/io/record.h"
#include "engine/pipeline.h"
#include "engine/shade/shader.h"
#include "engine/stages.h"
#include "engine/store/writer.h"
#include "engine/tuning.h"
#include "format/checksum.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr std::size_t kBatch = 16 * Shader::kBlock;  // receivers in memory at once
constexpr std::uint16_t kGroup = 1;  // of the channels that shading adds

/// What shading says of a point, in the order of the channels.
struct ShadedChannels {
  static constexpr std::size_t kPlain = 1 + 3 + 3 + 3 + 3;
  static constexpr std::size_t kFloats = kPlain + 2;  // with estimates

  static std::vector<Channel> channels(bool estimates) {
    std::vector<Channel> channels{{"occlusion", ChannelType::half, 1, kGroup},
                                  {"bent_normal", ChannelType::half, 3, kGroup},
                                  {"irradiance", ChannelType::half, 3, kGroup},
                                  {"sky", ChannelType::half, 3, kGroup},
                                  {"indirect", ChannelType::half, 3, kGroup}};
    if (!estimates) return channels;
    channels.push_back({"occlusion_error", ChannelType::half, 1, kGroup});
    channels.push_back({"irradiance_error", ChannelType::half, 1, kGroup});
    return channels;
  }
  static std::vector<PointColumn> columns(bool estimates) {
    std::vector<PointColumn> columns;
    for (const Channel& c : channels(estimates)) columns.push_back({c.name, c.components});
    return columns;
  }
  static std::size_t count(bool estimates) { return estimates ? kFloats : kPlain; }
};

using ShadedValues = std::array<float, ShadedChannels::kFloats>;

/// Values of a shaded surfel: outgoing radiance is albedo / pi times what arrives.
ShadedValues values_of(const Shading& s, const glm::vec3& albedo, const ErrorEstimate& estimate) {
  const glm::vec3 out = albedo * (s.irradiance + s.sky) * std::numbers::inv_pi_v<float>;
  return {s.occlusion,    s.bent_normal.x, s.bent_normal.y, s.bent_normal.z, s.irradiance.r,     s.irradiance.g,
          s.irradiance.b, s.sky.r,         s.sky.g,         s.sky.b,         out.r,              out.g,
          out.b,          estimate.occlusion, estimate.irradiance};
}

/// Some of a container's points in order, in blocks.
class PointCursor {
 public:
  /// @param wanted  how many, evenly spread; at most as many as there are
  /// @param from    the first of those wanted that next() gives, below `wanted`
  /// @param lost    where damaged pages are told, whose points are passed over; null: they are errors
  PointCursor(const ContainerReader& container, std::uint64_t wanted, std::uint64_t from = 0, LostPages* lost = nullptr)
      : container_(container), wanted_(wanted), lost_(lost), payload_(container.page_payload_limit()) {
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
      const std::uint64_t share = share_ + wanted_ * container_.entry(container_.point_pages()[page_]).record_count;
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
  bool whole_ = true;  // the page at hand
  std::uint64_t share_ = 0;  // wanted_ for each point passed, less the points for each one taken
  std::vector<std::byte> payload_;
  PageDecoder decoder_;
  std::size_t page_ = 0;
  std::uint32_t at_ = 0;
  std::uint32_t count_ = 0;
};

/// Takes shaded points in order.
class ShadedSink {
 public:
  virtual ~ShadedSink() = default;
  /// @param estimates  as many, or none where the sink was made without
  virtual void write(std::span<const Surfel> surfels, std::span<const Shading> shading,
                     std::span<const ErrorEstimate> estimates) = 0;
  virtual void finish() = 0;
};

class PlySink : public ShadedSink {
 public:
  PlySink(const std::filesystem::path& target, std::uint64_t count, bool estimates)
      : floats_(ShadedChannels::count(estimates)), writer_(target, count, ShadedChannels::columns(estimates)) {}
  void write(std::span<const Surfel> surfels, std::span<const Shading> shading,
             std::span<const ErrorEstimate> estimates) override {
    std::vector<float> values;
    values.reserve(surfels.size() * floats_);
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      const ShadedValues v =
          values_of(shading[i], surfels[i].albedo, estimates.empty() ? ErrorEstimate{} : estimates[i]);
      values.insert(values.end(), v.begin(), v.begin() + static_cast<std::ptrdiff_t>(floats_));
    }
    writer_.write(surfels, values);
  }
  void finish() override { writer_.finish(); }

 private:
  std::size_t floats_;  // of a point
  PlyWriter writer_;
};

/// A copy of the receivers' container with one attribute page behind each point page. Channels of
/// an earlier shading are left out.
class ContainerSink : public ShadedSink {
 public:
  ContainerSink(const std::filesystem::path& target, const ContainerReader& from, const std::string& settings,
                bool estimates)
      : from_(from),
        floats_(ShadedChannels::count(estimates)),
        meta_(from.meta()),
        writer_(target, {.page_shift = from.header().page_shift, .uuid = uuid_for(from, settings), .frame = from.header().frame}) {
    std::erase_if(meta_.channels, [](const Channel& c) { return c.group == kGroup; });
    const std::vector<Channel> added = ShadedChannels::channels(estimates);
    meta_.channels.insert(meta_.channels.begin(), added.begin(), added.end());
    meta_.text["shading"] = settings;
    columns_ = packed_group_columns(meta_.channels, kGroup);
    copy_pages();
  }

  void write(std::span<const Surfel> surfels, std::span<const Shading> shading,
             std::span<const ErrorEstimate> estimates) override {
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      values_.push_back(
          values_of(shading[i], surfels[i].albedo, estimates.empty() ? ErrorEstimate{} : estimates[i]));
      if (values_.size() == page_points()) flush();
    }
  }

  void finish() override {
    if (!values_.empty()) flush();
    writer_.finish(meta_, from_.superblock());
  }

 private:
  static Uuid uuid_for(const ContainerReader& from, const std::string& settings) {
    std::string text(reinterpret_cast<const char*>(from.header().uuid.data()), sizeof(Uuid));
    text += settings;
    const std::array<std::uint64_t, 2> hash = xxh3_128(std::as_bytes(std::span(text)));
    Uuid uuid;
    std::memcpy(uuid.data(), hash.data(), uuid.size());
    return uuid;
  }

  [[nodiscard]] std::size_t page_points() const {
    const std::uint64_t left = from_.superblock().points - written_;
    return static_cast<std::size_t>(std::min<std::uint64_t>(from_.superblock().points_per_page, left));
  }

  /// Point and node pages keep their numbers, so that references hold: they precede all others.
  void copy_pages() {
    std::vector<std::byte> stored;
    for (std::uint32_t page = 0; page < from_.page_count(); ++page) {
      const DirectoryEntry& entry = from_.entry(page);
      const bool earlier = entry.type == PageType::attribute && entry.group == kGroup;
      if (entry.type == PageType::meta || earlier) continue;
      const PageHeader header = from_.read_stored_page(page, stored);
      writer_.write_stored_page(writer_.reserve_page(),
                                {.type = header.type,
                                 .group = header.group,
                                 .level = header.level,
                                 .record_count = header.record_count,
                                 .first_key = header.first_key,
                                 .last_key = header.last_key},
                                header.coding, header.raw_bytes, stored);
    }
  }

  void flush() {
    const std::size_t count = values_.size();
    std::vector<std::byte> payload(count * floats_ * 2);
    for (std::size_t c = 0; c < floats_; ++c) {
      for (std::size_t i = 0; i < count; ++i) {
        const std::uint16_t half = encode_half(values_[i][c]);
        std::memcpy(payload.data() + 2 * (c * count + i), &half, 2);
      }
    }
    writer_.write_page(writer_.reserve_page(),
                       {.type = PageType::attribute, .group = kGroup, .record_count = static_cast<std::uint32_t>(count)},
                       payload, columns_);
    written_ += count;
    values_.clear();
  }

  const ContainerReader& from_;
  std::size_t floats_;  // of a point
  Meta meta_;
  std::vector<PackedColumn> columns_;
  ContainerWriter writer_;
  std::vector<ShadedValues> values_;
  std::uint64_t written_ = 0;
};

std::string settings_text(const ShadeRequest& request, const GatherOptions& g) {
  std::string text = fmt::format("solid_angle {} parallax {} inflation {} resolution {} sides {} lift {}",
                                 g.solid_angle, g.parallax, g.inflation, g.resolution,
                                 g.sides == Sides::both ? "both" : "front", request.lift);
  if (request.bounces != 1) text += fmt::format(" bounces {}", request.bounces);
  if (request.estimate) text += " estimates";
  return text;
}

/// The container of the receivers of a request; a cloud is built into one for the time of the run.
std::unique_ptr<ContainerReader> open_receivers(const ShadeRequest& request, const std::filesystem::path& target,
                                                Progress& progress) {
  if (request.receivers.extension() == ".ptcx") return std::make_unique<ContainerReader>(request.receivers);
  BuildRequest build{.inputs = {request.receivers}, .lights = LightRig{}, .profile = Profile::raw, .run = request.run};  // they need no light
  return make_temporary(roomiest_temp_dir(request.run, target),
                        [&](const std::filesystem::path& path) { build_container(build, path, progress); });
}

/// Shades what a cursor gives, batch by batch.
/// @param estimator  or null
/// @return CPU seconds of the gather
double shade_all(PointCursor& cursor, Shader& shader, Estimator* estimator, float lift, ShadedSink& sink,
                 CheckSample& check, Progress& progress) {
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

std::unique_ptr<ShadedSink> make_sink(const std::filesystem::path& target, const ContainerReader& receivers,
                                      std::uint64_t points, const std::string& settings, bool estimates) {
  if (target.extension() == ".ply") return std::make_unique<PlySink>(target, points, estimates);
  return std::make_unique<ContainerSink>(target, receivers, settings, estimates);
}

}  // namespace

ShadeReport shade_container(const ShadeRequest& request, const std::filesystem::path& target, Progress& progress) {
  ShadeReport report;
  check_estimate_request(request.estimate, request.error, request.check);
  check_damage_request(request.tolerate_damage, request.bounces, request.error, request.check);
  if (request.tolerate_damage && request.receivers.empty() && target.extension() != ".ply") {
    throw std::invalid_argument("a container would keep what is damaged: name a .ply, or salvage the scene first");
  }
  const Executor executor(request.run.threads);
  const ContainerReader scene(request.scene);
  const std::unique_ptr<ContainerReader> other =
      request.receivers.empty() ? nullptr : open_receivers(request, target, progress);
  const ContainerReader& receivers = other ? *other : scene;
  const std::uint64_t all = receivers.superblock().points;
  const std::uint64_t wanted = request.count == 0 ? all : std::min(request.count, all);
  const std::unique_ptr<LostPages> lost = request.tolerate_damage ? std::make_unique<LostPages>(scene) : nullptr;
  LostPages* const receivers_lost = other ? nullptr : lost.get();
  const std::uint64_t points = receivers_lost ? count_whole(receivers, wanted, *receivers_lost) : wanted;
  if (wanted < all && target.extension() != ".ply") {
    throw std::invalid_argument("a container of some of the points cannot be written: name a .ply, or shade them all");
  }

  const Sky sky = request.sky ? *request.sky : recorded_lights(scene).sky;
  ShadeOptions options{
      .cache_bytes = cache_bytes_left(request.run, kBufferBytes + (other ? open_bytes(*other) : 0), scene,
                                      readers_of(executor, request.estimate), request.back_end,
                                      "shading"),
      .back_end = request.back_end,
      .gather = request.gather,
      .sky = sky_function(sky),
      .lost = lost.get()};
  options.gather.bleeding = request.bounces > 0;
  const std::unique_ptr<ContainerReader> bounced =
      bounce_light(scene, {request.bounces, options, request.lift, roomiest_temp_dir(request.run, target)}, executor, report,
                   progress);
  const ContainerReader& lit = bounced ? *bounced : scene;
  ReceiverPlaces compared;
  std::vector<Pilot> pilots;
  if (request.error || request.estimate) pilots = pilots_of(receivers, points, request.lift);
  std::vector<Shading> traced;  // by rays, of the pilots
  if (request.error) {
    const Stage stage(report.seconds, progress, "tune", 0, "receivers");
    report.tuning = tune(lit, options, *request.error, pilots, executor, progress, compared, traced);
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
  const std::unique_ptr<ShadedSink> sink =
      make_sink(target, receivers, points, settings_text(request, options.gather), request.estimate);
  CheckSample check(request.check, std::move(compared));
  {
    const Stage stage(report.seconds, progress, "shade", points, "points");
    Shader shader(lit, options, executor);
    PointCursor cursor(receivers, wanted, 0, receivers_lost);
    report.shade_cpu_seconds = shade_all(cursor, shader, estimator.get(), request.lift, *sink, check, progress);
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
    const Stage stage(report.seconds, progress, "check", std::uint64_t{2} * request.check.receivers, "references");
    report.check = check.compare(lit, request.gather.sides, sky, nullptr, nullptr, {{}, request.bounces},
                                 options.cache_bytes, executor, progress);
  }
  return report;
}

}  // namespace ptc
