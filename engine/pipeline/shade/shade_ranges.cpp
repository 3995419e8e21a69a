// The results of a range, in a file of the farm alone:
//
//   | magic | plan | scene | first receiver | receivers |  each u64
//   for each batch:  | XXH3-64 u64 | results, 40 bytes for each receiver |
#include "engine/pipeline/shade/shade_ranges.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/octree/build_pages.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/point_marks.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/pipeline/convert/point_files.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/shade/receivers.h"
#include "engine/pipeline/shade/shaded_sink.h"
#include "engine/store/writer.h"
#include "format/checksum.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMagic = 0x4445'4441'4853'5450;  // "PTSHADED"
constexpr std::size_t kHeadWords = 5;
static_assert(sizeof(Shading) == 10 * sizeof(float));  // written as they lie in memory

using Head = std::array<std::uint64_t, kHeadWords>;

/// A range of receivers, by number.
struct Receivers {
  std::uint64_t first = 0, end = 0;
};

/// Returns the receivers of a range: whole batches, but for the last one of all.
Receivers receivers_of(std::uint64_t wanted, RangeNumber range) {
  const std::uint64_t batches = (wanted + kReceiverBatch - 1) / kReceiverBatch;
  const auto begin = [&](std::uint64_t i) {
    return std::min(batches * i / range.of * kReceiverBatch, wanted);
  };
  return {begin(range.number), begin(range.number + 1)};
}

Head head_of(std::uint64_t plan, const ContainerReader& scene, const Receivers& receivers) {
  return {kMagic, plan, scene.superblock().xxh3, receivers.first, receivers.end - receivers.first};
}

/// Reads the results of one range batch by batch.
class RangeResults {
 public:
  RangeResults(const std::filesystem::path& path, const Head& expected)
      : file_(path), left_(expected[4]) {
    const std::uint64_t batches = (left_ + kReceiverBatch - 1) / kReceiverBatch;
    Head head{};
    require(file_.size() >= sizeof head, "the file is shorter than it was");
    file_.read_at(0, std::as_writable_bytes(std::span(head)));
    require(head == expected, "the results are of another run, scene or range");
    require(file_.size() - sizeof head == batches * sizeof(std::uint64_t) + left_ * sizeof(Shading),
            "the file has another length than its results");
    at_ = sizeof head;
  }

  /// Returns the next results, at most kReceiverBatch; none at the end.
  std::span<const Shading> next() {
    results_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(left_, kReceiverBatch)));
    if (results_.empty()) return {};
    std::uint64_t xxh3 = 0;
    file_.read_at(at_, std::as_writable_bytes(std::span(&xxh3, 1)));
    const auto bytes = std::as_writable_bytes(std::span(results_));
    file_.read_at(at_ + sizeof xxh3, bytes);
    if (xxh3_64(bytes) != xxh3)
      throw DataError(file_.path().string() + ": offset " + std::to_string(at_) +
                      ": results are damaged");
    at_ += sizeof xxh3 + bytes.size();
    left_ -= results_.size();
    return results_;
  }

 private:
  void require(bool holds, const char* text) const {
    if (!holds) throw DataError(file_.path().string() + ": " + text);
  }

  InputFile file_;
  std::uint64_t left_, at_ = 0;
  std::vector<Shading> results_;
};

/// Divides the memory of a run over the points of its own scene.
void prepare_points(const ShadeRequest& request, const std::filesystem::path& target,
                    Lighting& lighting, Progress& progress) {
  const ContainerReader& scene = lighting.scene();
  const Sky sky = recorded_lights(scene, request.run, target, progress).sky;
  lighting.prepare(budget_of(request.run.memory_bytes, "shading"), sky,
                   {.emitters = !lit_by_emitters(scene)}, 1, glm::dvec3(0), target);
}

/// Takes surfels of receivers, the rows of their channels, and their light.
using TakeLit = std::function<void(std::span<const Surfel> surfels, std::span<const std::byte> rows,
                                   const LitReceivers& lit)>;

/// Shades receivers batch by batch.
/// @param groups  of the channels of rows, those of their rises among them
void shade_receivers(const ShadeRequest& request, const Receivers& receivers,
                     const std::vector<std::uint8_t>& groups, Lighting& lighting,
                     const TakeLit& take) {
  if (receivers.first == receivers.end) return;
  const ContainerReader& scene = lighting.scene();
  lighting.begin_range(receivers.first);
  PointCursor cursor(scene, groups, selected_of(scene, request.count), receivers.first);
  const Lifting lifting(scene.header().frame, cursor.channels(), request.lift);
  std::vector<Surfel> surfels(kReceiverBatch);
  std::vector<Receiver> batch(kReceiverBatch);
  std::vector<std::byte> rows;
  for (std::uint64_t at = receivers.first; at < receivers.end;) {
    const std::size_t count = cursor.next(
        std::span(surfels).first(std::min<std::uint64_t>(kReceiverBatch, receivers.end - at)),
        &rows);
    if (count == 0) throw DataError(request.scene.string() + ": it has fewer points than it says");
    lifting.place(std::span(surfels).first(count), rows, batch);
    take(std::span(surfels).first(count), rows, lighting.shade(std::span(batch).first(count)));
    at += count;
  }
}

}  // namespace

void check_shade_by_ranges(const ShadeRequest& request, const std::filesystem::path& target) {
  check_ranges(request);
  require_request(output_format(target).has_value(), "target",
                  "a farm writes shaded points to a file of points, such as .ply");
  require_request(request.receivers.empty() && request.joined.empty() && !request.original_order,
                  "receivers", "a farm shades the points of its scene, in their order");
  require_request(!request.estimate && request.check.receivers == 0, "check",
                  "a farm shades without estimates and checks");
  require_request(!request.glossy.roughness && request.shadows.empty() && !request.light_groups &&
                      !request.sky && !request.tolerate_damage &&
                      request.gather.around.diagonals == 0,
                  "glossy", "a farm shades occlusion, irradiance and the sky of the scene alone");
}

TuningReport choose_settings(const ShadeRequest& request, const std::filesystem::path& target,
                             Progress& progress) {
  LightingReport report;
  Lighting lighting(request, report, progress);
  prepare_points(request, target, lighting, progress);
  lighting.tune([&] {
    return pilots_of(lighting.scene(), selected_of(lighting.scene(), request.count), request.lift);
  });
  return report.tuning.value();
}

void shade_range(const ShadeRequest& request, RangeNumber range, std::uint64_t plan,
                 const std::filesystem::path& target, Progress& progress) {
  // Open the scene and divide the memory
  LightingReport report;
  Lighting lighting(request, report, progress);
  const ContainerReader& scene = lighting.scene();
  prepare_points(request, target, lighting, progress);
  lighting.tune({});

  // Shade the range
  const std::uint64_t wanted = selected_of(scene, request.count);
  const Receivers receivers = receivers_of(wanted, range);
  OutputFile file(target);
  const Head head = head_of(plan, scene, receivers);
  file.append(std::as_bytes(std::span(head)));
  const Stage stage(report.seconds, progress, "shade", receivers.end - receivers.first, "points");
  shade_receivers(
      request, receivers, rise_groups(scene.meta().channels), lighting,
      [&](std::span<const Surfel>, std::span<const std::byte>, const LitReceivers& lit) {
        const auto bytes = std::as_bytes(lit.shading);
        const std::uint64_t xxh3 = xxh3_64(bytes);
        file.append(std::as_bytes(std::span(&xxh3, 1)));
        file.append(bytes);
      });
  file.publish();
}

bool shade_tile(const ShadeRequest& request, RangeNumber range, const std::filesystem::path& target,
                Progress& progress) {
  // Open the scene and divide the memory
  LightingReport report;
  Lighting lighting(request, report, progress);
  const ContainerReader& scene = lighting.scene();
  const Receivers receivers = receivers_of(selected_of(scene, request.count), range);
  if (receivers.first == receivers.end) return false;
  prepare_points(request, target, lighting, progress);
  lighting.tune({});

  // Shade the range
  const std::uint64_t count = receivers.end - receivers.first;
  PointWriteInfo info =
      shaded_points(scene, count, settings_text(request, request.gather, request.receiver_rays),
                    request.colour_from, output_format(target));
  note_changed_values(target, info, progress);
  const std::unique_ptr<ShadedSink> sink = make_shaded_sink(target, scene, info, {});
  const Stage stage(report.seconds, progress, "shade", count, "points");
  shade_receivers(request, receivers, groups_without_shading(scene), lighting,
                  [&](std::span<const Surfel> surfels, std::span<const std::byte> rows,
                      const LitReceivers& lit) { sink->write(surfels, rows, lit, {}); });
  sink->finish();
  return true;
}

void shade_part(const ShadeRequest& request, std::size_t part, const std::filesystem::path& target,
                Progress& progress) {
  LightingReport report;
  Lighting lighting(request, report, progress);
  const ContainerReader& scene = lighting.scene();
  MemoryBudget budget = budget_of(request.run.memory_bytes, "a bounce of light");
  budget.charge(
      "the output's directory",
      ContainerWriter::memory_bytes(scene.parts()[part]->page_count(), scene.header().page_shift,
                                    lighting.executor().threads()) +
          held_pages_bytes(scene.header().page_shift));
  lighting.prepare(std::move(budget), {}, {.emitters = !lit_by_emitters(scene)}, 1, glm::dvec3(0),
                   target);
  lighting.write_bounce(part, target);
}

void collect_shading(const ShadeRequest& request, const std::vector<std::filesystem::path>& results,
                     std::uint64_t plan, const std::filesystem::path& target, Progress& progress) {
  // Open the scene and the target
  const ContainerReader scene(with_directory_under(request.scene, request.run));
  MemoryBudget budget = budget_of(request.run.memory_bytes, "collecting");
  charge_directory(budget, scene);
  budget.require();
  const std::uint64_t wanted = selected_of(scene, request.count);
  PointWriteInfo info =
      shaded_points(scene, wanted, settings_text(request, request.gather, request.receiver_rays),
                    request.colour_from, output_format(target));
  note_changed_values(target, info, progress);
  const std::unique_ptr<ShadedSink> sink = make_shaded_sink(target, scene, info, {});

  // Write the points of all ranges with their results
  StageSeconds seconds;
  const Stage stage(seconds, progress, "collect", wanted, "points");
  const std::vector<std::uint8_t> groups = groups_without_shading(scene);
  PointCursor cursor(scene, groups, wanted);
  std::vector<Surfel> surfels(kReceiverBatch);
  std::vector<std::byte> rows;
  for (std::size_t i = 0; i < results.size(); ++i) {
    const Receivers receivers = receivers_of(wanted, {i, results.size()});
    RangeResults range(results[i], head_of(plan, scene, receivers));
    while (true) {
      const std::span<const Shading> shading = range.next();
      if (shading.empty()) break;
      const auto some = std::span(surfels).first(shading.size());
      if (cursor.next(some, &rows) != some.size())
        throw DataError(request.scene.string() + ": it has fewer points than it says");
      sink->write(some, rows, {.shading = shading}, {});
      progress.advance(some.size());
    }
  }
  sink->finish();
}

}  // namespace ptc
