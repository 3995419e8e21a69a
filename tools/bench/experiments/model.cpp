#include "tools/bench/experiments/model.h"

#include <memory>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/octree/build_pages.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/temporary_container.h"
#include "engine/shade/reference/brute_force.h"
#include "engine/store/container_points.h"
#include "tools/bench/references/methods.h"
#include "tools/bench/references/reference.h"

namespace ptc::bench {
namespace {

/// The bytes of all pages as they are stored.
double stored_bytes(const ContainerReader& container) {
  double sum = 0;
  for (std::uint32_t page = 0; page < container.page_count(); ++page)
    sum += container.entry(page).stored_bytes;
  return sum;
}

/// Builds a container of the same points with another number of points in a leaf.
std::unique_ptr<ContainerReader> with_leaves(const ContainerReader& from, std::uint32_t leaf_points,
                                             const std::filesystem::path& work) {
  return make_temporary_container(work, [&](const std::filesystem::path& path) {
    ContainerPoints points(from);
    ContainerWriter writer(path, {.page_shift = from.header().page_shift,
                                  .frame = from.header().frame,
                                  .point_bytes = from.header().point_bytes});
    Progress silent;
    const Superblock superblock =
        build_pages(points, writer, {.leaf_points = leaf_points}, ThreadPool(), silent);
    writer.finish(from.meta(), superblock);
  });
}

/// Measures the gather of PTCX, at the default setting except for the resolution, against rays.
class GatherStudy {
 public:
  GatherStudy(const BenchScene& scene, const ReceiverSet& set, const Checked& checked,
              const Reference& reference, const Executor& executor)
      : scene_(scene), set_(set), checked_(checked), reference_(reference), executor_(executor) {}

  [[nodiscard]] ModelRow measure(const ContainerReader& container, unsigned resolution,
                                 unsigned repeats, ModelRow row) const {
    const unsigned threads = executor_.threads();
    const std::uint64_t bytes = PageCache::bytes_for(container, threads, container.page_count());
    PageCache cache(container, {.memory_bytes = bytes, .threads = threads});
    const GatherOptions options{.resolution = resolution};
    const auto method =
        make_gather(container, scene_.lights().sky, set_, checked_, options, cache, executor_);
    Costs costs;
    for (unsigned repeat = 0; repeat < repeats; ++repeat) costs.add(method->run());
    row.scene = scene_.name();
    row.solid_angle = static_cast<double>(options.solid_angle);
    row.us = costs.cpu_us(method->receivers());
    row.wall_us = costs.wall_us(method->receivers());
    compare(row, method->result().checked, reference_.mean);
    return row;
  }

 private:
  const BenchScene& scene_;
  const ReceiverSet& set_;
  const Checked& checked_;
  const Reference& reference_;
  const Executor& executor_;
};

}  // namespace

void compare(ModelRow& row, std::span<const Shading> ours, std::span<const Shading> reference) {
  row.occlusion = over_mean(error_statistics(occlusion_of(ours), occlusion_of(reference)));
  row.irradiance = over_mean(error_statistics(irradiance_of(ours), irradiance_of(reference)));
}

SceneModel measure_model(const BenchScene& scene, const ModelOptions& options,
                         const std::filesystem::path& work, const Executor& executor,
                         Progress& progress) {
  // Choose the receivers
  const ReceiverSet& set = scene.sets().front();
  if (set.name != "camera" || set.receivers.empty()) {
    throw DataError(scene.name() + ": nothing to measure: the camera sees nothing");
  }
  const Checked checked = choose_checked(scene, set, options.checked);
  std::vector<Receiver> receivers;
  for (const std::size_t i : checked.receivers) receivers.push_back(set.receivers[i]);

  // Trace their reference
  progress.begin(scene.name() + ", reference", 0, "rays");
  const DiscRays oracle(scene.surfels(), Sides::both, {});
  const auto trace = [&](const Receiver& r, unsigned rays, std::uint64_t seed) {
    return oracle.trace(r, rays, seed);
  };
  const Reference reference =
      make_reference(set, checked, {.half = options.reference_rays}, trace, executor);
  progress.end();
  // Study payloads
  SceneModel model{.scene = scene.name(),
                   .surfels = scene.surfels().size(),
                   .nodes = scene.container().superblock().nodes,
                   .receivers = receivers.size(),
                   .rays = 2 * options.reference_rays,
                   .occlusion_noise = reference.occlusion_noise,
                   .irradiance_noise = reference.irradiance_noise,
                   .rows = study_payloads(scene, receivers, options, executor, progress)};

  // Study leaves, directions and pages
  const GatherStudy gathers(scene, set, checked, reference, executor);
  progress.begin(scene.name() + ", leaves, directions",
                 options.leaf_points.size() + options.resolutions.size(), "rows");
  for (const std::uint32_t leaf_points : options.leaf_points) {
    const auto container = with_leaves(scene.container(), leaf_points, work);
    const double bytes = stored_bytes(*container) / static_cast<double>(model.surfels);
    const ModelRow row{
        .axis = "leaf", .variant = std::to_string(leaf_points), .bytes = bytes, .per = "point"};
    model.rows.push_back(
        gathers.measure(*container, GatherOptions{}.resolution, options.repeats, row));
    progress.advance(1);
  }
  for (const unsigned resolution : options.resolutions) {
    constexpr double kPixelBytes = 8;  // nearness and colour of a pixel
    const ModelRow row{.axis = "directions",
                       .variant = std::to_string(resolution),
                       .bytes = 6 * kPixelBytes * resolution * resolution,
                       .per = "cube"};
    model.rows.push_back(gathers.measure(scene.container(), resolution, options.repeats, row));
    progress.advance(1);
  }
  progress.end();
  for (ModelRow& row : study_pages(scene, options)) model.rows.push_back(std::move(row));
  return model;
}

}  // namespace ptc::bench
