#include "engine/pipeline/light/bounces.h"

#include <algorithm>
#include <numbers>
#include <vector>

#include <fmt/format.h>

#include "engine/base/memory.h"
#include "engine/io/cloud/record.h"
#include "engine/octree/build_pages.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/temporary_container.h"
#include "engine/shade/lift.h"
#include "engine/store/container_points.h"
#include "engine/store/writer.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr std::size_t kBatch = 16 * Shader::kBlock;  // points in memory at once

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
/// plus what a shader finds. Points are shaded kBatch at a time, as next() asks for them.
class BouncedPoints : public PointStream {
 public:
  BouncedPoints(const ContainerReader& first, Shader& shader, float lift, Progress& progress)
      : frame_(first.header().frame),
        points_(first),
        shader_(shader),
        lift_(lift),
        progress_(progress),
        records_(kBatch),
        receivers_(kBatch),
        results_(kBatch) {}

  std::size_t next(std::span<PointRecord> out) override {
    if (at_ == count_) shade_batch();
    const std::size_t count = std::min(out.size(), count_ - at_);
    std::copy_n(records_.begin() + static_cast<std::ptrdiff_t>(at_), count, out.begin());
    at_ += count;
    return count;
  }

  [[nodiscard]] double cpu_seconds() const { return cpu_; }

 private:
  void shade_batch() {
    // Read the next points and shade them
    at_ = 0;
    count_ = points_.next(records_);
    for (std::size_t i = 0; i < count_; ++i)
      receivers_[i] = lifted(to_surfel(records_[i], frame_), lift_, frame_);
    const double before = ptc::cpu_seconds();
    shader_.shade(std::span(receivers_).first(count_), std::span(results_).first(count_),
                  progress_);
    cpu_ += ptc::cpu_seconds() - before;

    // Add the light that they reflect
    for (std::size_t i = 0; i < count_; ++i) {
      PointRecord& record = records_[i];
      for (std::size_t c = 0; c < 3; ++c) {
        const float reflects =
            static_cast<float>(record.albedo[c]) * (std::numbers::inv_pi_v<float> / 255);
        const float bounced =
            reflects * std::max(0.0F, results_[i].irradiance[static_cast<int>(c)]);
        record.radiance[c] = encode_half(decode_half(record.radiance[c]) + bounced);
      }
    }
  }

  Frame frame_;
  ContainerPoints points_;
  Shader& shader_;
  float lift_;
  Progress& progress_;
  std::vector<PointRecord> records_;
  std::vector<Receiver> receivers_;
  std::vector<Shading> results_;
  std::size_t count_ = 0, at_ = 0;  // points of the batch, and the next one to hand out
  double cpu_ = 0;
};

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
  // Shade the points more coarsely than the receivers, by the light of surfaces alone: that of
  // emitters which lit the points is in their radiance
  ShadeOptions shade = options.shade;
  shade.sky = {};
  shade.gather = coarser(shade.gather);
  shade.gather.emission = !lit_by_emitters(scene);
  shade.variants = 1;

  // Write one container for each bounce but the last, each lit by the one before
  const Superblock& from = scene.superblock();
  std::unique_ptr<ContainerReader> lit;
  for (unsigned bounce = 1; bounce < options.bounces; ++bounce) {
    const Stage stage(report.seconds, progress, fmt::format("bounce {}", bounce), from.points,
                      "points");
    const auto write = [&](const std::filesystem::path& path) {
      Shader shader(lit ? *lit : scene, shade, executor);
      BouncedPoints points(scene, shader, options.lift, progress);
      ContainerWriter writer(path, {.page_shift = scene.header().page_shift,
                                    .frame = scene.header().frame,
                                    .point_bytes = scene.header().point_bytes});
      Progress silent;
      const BuildOptions tree{.leaf_points = std::max(1U, from.leaf_points)};
      writer.finish({}, build_pages(points, writer, tree, executor, silent));
      report.bounce_cpu_seconds += points.cpu_seconds();
    };
    lit = make_temporary_container(options.temp_dir, write);
  }
  return lit;
}

}  // namespace ptc
