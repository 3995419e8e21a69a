#include "tools/bench/stability/lab.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/common.hpp>

#include "engine/base/numbers.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/mesh_reference.h"
#include "engine/scene/ray_scene.h"
#include "engine/shade/reference/brute_force.h"
#include "engine/trace/disc_visibility.h"
#include "tools/bench/scenes/work_file.h"
#include "tools/bench/shapes/surfels.h"

namespace ptc::bench {
namespace {

constexpr std::uint64_t kCacheBytes = 64U << 20;
constexpr std::uint64_t kMostSurfels = 2'000'000;

}  // namespace

glm::vec3 white_sky(const glm::vec3&) {
  return glm::vec3(1);
}

SmallScene::SmallScene(const Lab& lab, std::span<const Surfel> surfels) : lab_(lab) {
  const WorkFile file(lab.work, ".stability.ptcx");
  write_scene(file.path(), {surfels.begin(), surfels.end()});
  open(file.path());
}

SmallScene::SmallScene(const Lab& lab, const Mesh& mesh, const LightRig& lights,
                       std::uint64_t points)
    : lab_(lab) {
  const WorkFile file(lab.work, ".stability.ptcx");
  BuildRequest request{.mesh = std::make_shared<const Mesh>(mesh), .lights = lights};
  request.sampling.count = points;
  request.run.threads = lab.executor.threads();
  Progress silent;
  build_container(request, file.path(), silent);
  open(file.path());
}

void SmallScene::open(const std::filesystem::path& path) {
  bytes_ = std::filesystem::file_size(path);
  container_ = std::make_unique<ContainerReader>(path);
}

std::vector<Surfel> SmallScene::surfels() const {
  return load_surfels(*container_, kMostSurfels);
}

double SmallScene::radius() const {
  double sum = 0;
  const std::vector<Surfel> all = surfels();
  for (const Surfel& surfel : all) sum += static_cast<double>(surfel.radius);
  return sum / static_cast<double>(all.size());
}

std::vector<Shading> SmallScene::shade(std::span<const Receiver> receivers, const SkyLight& sky,
                                       const GatherOptions& gather) const {
  ShadeOptions options{.cache_bytes = kCacheBytes,
                       .gather = gather,
                       .sky = sky,
                       .visibility = disc_visibility(gather.sides)};
  std::vector<Shading> shadings(receivers.size());
  Progress silent;
  Shader(*container_, options, lab_.executor).shade(receivers, shadings, silent);
  return shadings;
}

std::vector<Shading> SmallScene::trace(std::span<const Receiver> receivers, unsigned rays,
                                       const SkyLight& sky) const {
  const std::vector<Surfel> all = surfels();
  const DiscRays discs(all, Sides::both, sky);
  std::vector<Shading> shadings(receivers.size());
  lab_.executor.for_each(receivers.size(), [&](std::size_t i, unsigned) {
    shadings[i] = discs.trace(receivers[i], rays, i);
  });
  return shadings;
}

std::vector<Shading> trace_at_mesh(const Lab& lab, const Mesh& mesh, const LightRig& lights,
                                   std::span<const Receiver> receivers, unsigned rays) {
  const RayScene scene(mesh);
  const DirectLight light(scene, lights);
  std::vector<Shading> shadings(receivers.size());
  lab.executor.for_each(receivers.size(), [&](std::size_t i, unsigned) {
    const RayTraced traced =
        trace_mesh(scene, light, receivers[i].position, receivers[i].normal, rays, {}, i);
    shadings[i] = {
        .occlusion = traced.occlusion, .irradiance = traced.irradiance, .sky = traced.sky};
  });
  return shadings;
}

std::vector<Receiver> receivers_on_grid(unsigned width, unsigned height,
                                        const std::function<Receiver(double, double)>& place) {
  std::vector<Receiver> receivers;
  for (unsigned y = 0; y < height; ++y) {
    for (unsigned x = 0; x < width; ++x)
      receivers.push_back(place((x + 0.5) / width, (y + 0.5) / height));
  }
  return receivers;
}

glm::vec3 openness(const Shading& shading) {
  return glm::vec3(1 - shading.occlusion);
}

glm::vec3 brightness(const Shading& shading) {
  return (shading.irradiance + shading.sky) / kPi;
}

std::vector<glm::vec3> values(std::span<const Shading> shadings,
                              glm::vec3 (*value)(const Shading&)) {
  std::vector<glm::vec3> all;
  for (const Shading& shading : shadings) all.push_back(value(shading));
  return all;
}

std::vector<glm::vec3> grey(std::size_t count, double value) {
  return std::vector(count, glm::vec3(static_cast<float>(value)));
}

double largest_difference(std::span<const glm::vec3> a, std::span<const glm::vec3> b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const double difference =
          std::abs(static_cast<double>(a[i][c]) - static_cast<double>(b[i][c]));
      if (!(difference <= largest)) largest = difference;  // what is no number, too
      if (std::isnan(largest)) return largest;
    }
  }
  return largest;
}

double rms_difference(std::span<const glm::vec3> a, std::span<const glm::vec3> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const glm::dvec3 difference = glm::dvec3(a[i]) - glm::dvec3(b[i]);
    for (int c = 0; c < 3; ++c) sum += difference[c] * difference[c];
  }
  return std::sqrt(sum / (3 * static_cast<double>(a.size())));
}

double relative_rms(std::span<const glm::vec3> ours, std::span<const glm::vec3> truth) {
  return rms_difference(ours, truth) / mean_value(truth);
}

double mean_value(std::span<const glm::vec3> all) {
  double sum = 0;
  for (const glm::vec3& value : all) {
    for (int c = 0; c < 3; ++c) sum += static_cast<double>(value[c]);
  }
  return sum / (3 * static_cast<double>(all.size()));
}

}  // namespace ptc::bench
