#include "engine/pipeline/light/bounces.h"

#include <algorithm>
#include <numbers>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "engine/base/memory.h"
#include "engine/io/cloud/record.h"
#include "engine/octree/build_pages.h"
#include "engine/pipeline/light/relit_points.h"
#include "engine/pipeline/parts/part_edges.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/temporary_container.h"
#include "engine/shade/lift.h"
#include "engine/store/writer.h"
#include "format/scalar.h"

namespace ptc {
namespace {

/// Returns the coarser settings of the bounces before the last: a receiver sees many points, and
/// their errors average out over them. The solid angle and the resolution stay: clusters that hold
/// something bright and what hides it, or thin things that are drawn too wide, are wrong everywhere
/// alike.
GatherOptions coarser(const GatherOptions& gather) {
  GatherOptions coarse = gather;
  coarse.around = {};
  coarse.parallax *= 2;
  return coarse;
}

/// The points of a scene with the light of one more bounce: the radiance that they were built with,
/// plus what a shader finds.
class BouncedPoints : public RelitPoints {
 public:
  /// @param emitters  as BounceOptions::emitters
  BouncedPoints(const ContainerReader& first, const PointRange& range, Shader& shader,
                ReceiverLight* emitters, float lift, Progress& progress)
      : RelitPoints(first, range, progress),
        frame_(first.header().frame),
        shader_(shader),
        emitters_(emitters),
        lift_(lift),
        receivers_(kBatch),
        results_(kBatch),
        arrives_(kBatch) {}

  [[nodiscard]] double cpu_seconds() const { return cpu_; }

 private:
  void relight(std::span<PointRecord> records, std::uint64_t first) override {
    const auto receivers = std::span(receivers_).first(records.size());
    for (std::size_t i = 0; i < records.size(); ++i)
      receivers_[i] = lifted(to_surfel(records[i], frame_), lift_, frame_);
    const double before = ptc::cpu_seconds();
    Progress silent;
    shader_.shade(receivers, std::span(results_).first(records.size()), silent);
    if (emitters_)
      emitters_->irradiance(0, receivers, first, std::span(arrives_).first(records.size()));
    cpu_ += ptc::cpu_seconds() - before;

    // Add the light that they reflect
    for (std::size_t i = 0; i < records.size(); ++i) {
      PointRecord& record = records[i];
      for (std::size_t c = 0; c < 3; ++c) {
        const float reflects =
            static_cast<float>(record.albedo[c]) * (std::numbers::inv_pi_v<float> / 255);
        const auto channel = static_cast<int>(c);
        const float bounced =
            reflects * (std::max(0.0F, results_[i].irradiance[channel]) + arrives_[i][channel]);
        record.radiance[c] = encode_half(decode_half(record.radiance[c]) + bounced);
      }
    }
  }

  Frame frame_;
  Shader& shader_;
  ReceiverLight* emitters_;
  float lift_;
  std::vector<Receiver> receivers_;
  std::vector<Shading> results_;
  std::vector<glm::vec3> arrives_;
  double cpu_ = 0;
};

/// Returns the settings with which the points of a scene are shaded: more coarsely than the
/// receivers, and by the light of surfaces alone: that of emitters is in the radiance of points
/// which they lit, or rays bring it.
ShadeOptions bounce_options(const ContainerReader& scene, const BounceOptions& options) {
  ShadeOptions shade = options.shade;
  shade.sky = {};
  shade.gather = coarser(shade.gather);
  shade.gather.emission = !lit_by_emitters(scene) && options.emitters == nullptr;
  shade.variants = 1;
  return shade;
}

/// Writes the points of a scene, or of a part of it, as `lit` lights them.
void write_bounce(const ContainerReader& scene, const ContainerReader& lit,
                  const BounceOptions& options, std::optional<std::size_t> part,
                  const std::filesystem::path& target, const Executor& executor,
                  LightingReport& report, Progress& progress) {
  Shader shader(lit, bounce_options(scene, options), executor);
  BouncedPoints points(scene, points_of(scene, part), shader, options.emitters, options.lift,
                       progress);
  ContainerWriter writer(target, {.page_shift = scene.header().page_shift,
                                  .uuid = part ? scene.parts()[*part]->header().uuid : Uuid{},
                                  .frame = scene.header().frame,
                                  .point_bytes = scene.header().point_bytes});
  Progress silent;
  TreeEdges edges;
  const BuildOptions tree{.leaf_points = std::max(1U, scene.superblock().leaf_points)};
  writer.finish({},
                build_pages(points, writer, tree, executor, silent, {}, part ? &edges : nullptr));
  if (part) write_edges(target, edges);
  report.bounce_cpu_seconds += points.cpu_seconds();
}

}  // namespace

void charge_bounces(MemoryBudget& budget, const ContainerReader& scene, unsigned bounces,
                    unsigned threads) {
  if (bounces < 2) return;
  budget.charge("the bounce that is read", ContainerReader::kPageBytes * scene.page_count());
  budget.charge(
      "the bounce that is written",
      ContainerWriter::memory_bytes(scene.page_count(), scene.header().page_shift, threads) +
          held_pages_bytes(scene.header().page_shift));
}

std::unique_ptr<ContainerReader> bounce_light(const ContainerReader& scene,
                                              const BounceOptions& options,
                                              const Executor& executor, LightingReport& report,
                                              Progress& progress) {
  // Write one container for each bounce but the last, each lit by the one before
  std::unique_ptr<ContainerReader> lit;
  for (unsigned bounce = 1; bounce < options.bounces; ++bounce) {
    const Stage stage(report.seconds, progress, fmt::format("bounce {}", bounce),
                      scene.superblock().points, "points");
    lit = make_temporary_container(options.temp_dir, [&](const std::filesystem::path& path) {
      write_bounce(scene, lit ? *lit : scene, options, {}, path, executor, report, progress);
    });
  }
  return lit;
}

void bounce_part(const ContainerReader& scene, const ContainerReader& lit,
                 const BounceOptions& options, std::size_t part,
                 const std::filesystem::path& target, const Executor& executor,
                 LightingReport& report, Progress& progress) {
  const Stage stage(report.seconds, progress, "bounce", points_of(scene, part).count(), "points");
  write_bounce(scene, lit, options, part, target, executor, report, progress);
}

}  // namespace ptc
