// A scene is built, then lit by other lights in two ways, and both are compared with many rays at
// the mesh:
//
//   mesh --> container --> ptclight ------> irradiance of all surfels --+
//     |                                                                 +--> errors
//     +---------------> rays by Embree ---> irradiance of some ---------+
//
// The irradiance of a surfel is the mean over the middles of the four quarters of its square cell,
// for all of them.
#include "tools/bench/experiments/relight.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include "engine/base/basis.h"
#include "engine/io/cloud/record.h"
#include "engine/parallel/thread_pool.h"
#include "engine/ptc.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/ray_scene.h"
#include "engine/shade/reference/cosine_rays.h"
#include "engine/store/container_points.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

constexpr unsigned kPlaces = 4;

/// A light that is measured.
struct Light {
  const char* name;
  LightRig rig;
  bool sky;  ///< the sky alone; else suns alone
};

std::vector<Light> lights_to_measure() {
  LightRig sun, wide, sky;
  sun.suns.push_back({.to_sun = sun_direction(40, 35)});
  wide.suns.push_back({.to_sun = sun_direction(40, 35), .angular_radius = 0.1F});
  sky.sky.radiance = {0.6F, 0.8F, 1.0F};
  return {{"sun", sun, false}, {"sun of 11 degrees", wide, false}, {"sky", sky, true}};
}

/// Numbers of rays of each place, of a light that is the sky or not.
LightSampling rays_of_place(bool sky, unsigned rays) {
  return {.sun_rays = sky ? 0 : rays, .area_rays = 0, .sky_rays = sky ? rays : 0};
}

/// Lights surfels by rays at their mesh.
class MeshLight {
 public:
  MeshLight(const RayScene& scene, const LightRig& rig) : light_(scene, rig) {}

  /// Returns the irradiance of a place of a surfel, in green, W/m^2.
  /// @param reach  distance from the surfel's middle, in radii along each axis of its cell
  [[nodiscard]] double at(const Surfel& surfel, unsigned place, float reach,
                          const LightSampling& sampling, std::uint64_t seed) const {
    const Basis basis(surfel.normal);
    const float x = place & 1 ? reach : -reach, y = place & 2 ? reach : -reach;
    const glm::dvec3 position =
        surfel.position + glm::dvec3(surfel.radius * (x * basis.x + y * basis.y) +
                                     kLift * surfel.radius * surfel.normal);
    const DirectLight::Result light =
        light_.irradiance(position, surfel.normal, sampling, seed * kPlaces + place);
    return static_cast<double>(light.local.g + light.sky.g);
  }
  [[nodiscard]] double at(const Surfel& surfel, const LightSampling& sampling,
                          std::uint64_t seed) const {
    double sum = 0;
    for (unsigned place = 0; place < kPlaces; ++place)
      sum += at(surfel, place, kQuarter, sampling, seed);
    return sum / kPlaces;
  }

 private:
  static constexpr float kLift = 0.15F;         // as LightingRequest::lift
  static constexpr float kQuarter = 0.353553F;  // half of the half edge, in radii

  DirectLight light_;
};

/// The irradiance of some surfels.
struct Truth {
  std::vector<double> values;
  std::vector<char> away;  ///< whether light is even around, so that no shadow ends near
  double mean = 0;
};

Truth make_truth(const MeshLight& light, std::span<const Surfel> surfels, bool sky, unsigned rays,
                 const Executor& executor) {
  Truth truth{.values = std::vector<double>(surfels.size()),
              .away = std::vector<char>(surfels.size())};
  executor.for_each(surfels.size(), [&](std::size_t i, unsigned) {
    const LightSampling sampling = rays_of_place(sky, rays);
    truth.values[i] = light.at(surfels[i], sampling, i);
    // A border of a shadow lies between places of other light, within two and a half radii
    double low = truth.values[i], high = low;
    for (const float reach : {0.353553F, 1.0F, 1.8F}) {
      for (unsigned place = 0; place < kPlaces; ++place) {
        const double value = light.at(surfels[i], place, reach, rays_of_place(sky, 16), i);
        low = std::min(low, value);
        high = std::max(high, value);
      }
    }
    truth.away[i] = high - low <= 0.05 * high || high == 0;
  });
  for (const double value : truth.values) truth.mean += value / static_cast<double>(surfels.size());
  return truth;
}

void add_errors(const Truth& truth, std::span<const double> values, bool sky, RelightRow& row) {
  double square = 0, near = 0, count = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double off = (values[i] - truth.values[i]) / truth.mean;
    row.mean += off / static_cast<double>(values.size());
    square += off * off;
    if (!truth.away[i]) continue;
    near += off * off;
    ++count;
  }
  row.rms = std::sqrt(square / static_cast<double>(values.size()));
  if (!sky && count > 0) row.away = std::sqrt(near / count);
}

/// Every so many surfels of a container, evenly spread.
std::vector<Surfel> some_surfels(const ContainerReader& container, std::uint64_t wanted) {
  const std::uint64_t all = container.superblock().points,
                      step = std::max<std::uint64_t>(1, all / wanted);
  std::vector<Surfel> some;
  ContainerPoints points(container);
  std::vector<PointRecord> block(4096);
  std::uint64_t first = 0;
  while (const std::size_t count = points.next(block)) {
    for (std::size_t i = 0; i < count; ++i) {
      if ((first + i) % step == step / 2)
        some.push_back(to_surfel(block[i], container.header().frame));
    }
    first += count;
  }
  return some;
}

/// The surfels that something sees from four radii away, and whose irradiance is told by what they
/// reflect. Others lie inside of walls and roofs.
std::vector<std::size_t> visible(std::span<const Surfel> surfels, const RayScene& mesh) {
  std::vector<std::size_t> places;
  std::vector<glm::vec3> directions;
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const Surfel& s = surfels[i];
    const glm::dvec3 from = s.position + glm::dvec3(0.15F * s.radius * s.normal);
    cosine_directions(s.normal, 64, i, directions);
    const bool seen = std::ranges::any_of(directions, [&](const glm::vec3& d) {
      return !mesh.closest(from, d, 0, 4 * static_cast<double>(s.radius));
    });
    if (seen && s.albedo.g > 0.1F) places.push_back(i);
  }
  return places;
}

}  // namespace

std::vector<RelightRow> measure_relight(const SceneChoice& choice, const RelightOptions& options,
                                        const std::filesystem::path& work, const RunOptions& run,
                                        Progress& progress) {
  // Build the scene, and choose surfels
  const WorkFile built(work, "-relight.ptcx"), lit(work, "-relit.ptcx");
  const LitScene made = build_scene(choice, {.points = options.points, .profile = Profile::exact},
                                    built.path(), run, progress);
  const ThreadPool executor(run.threads);
  const ContainerReader container(built.path());
  const std::uint64_t all = container.superblock().points;
  const std::vector<Surfel> sample = some_surfels(container, options.checked);
  const RayScene mesh(made.mesh);
  const std::vector<std::size_t> places = visible(sample, mesh);
  std::vector<Surfel> checked;
  for (const std::size_t i : places) checked.push_back(sample[i]);
  const std::vector<Surfel> timed_surfels = some_surfels(container, options.timed);

  std::vector<RelightRow> rows;
  for (const Light& light : lights_to_measure()) {
    const MeshLight by_mesh(mesh, light.rig);
    progress.begin("reference " + std::string(light.name), 0, "surfels");
    const Truth truth = make_truth(by_mesh, checked, light.sky, options.reference_rays, executor);
    progress.end();

    // Settings of ptclight: rays of each surfel, or those of the gather
    struct Setting {
      std::string name;
      LightRequest request;
    };
    std::vector<Setting> settings;
    LightRequest request{{.scene = built.path(), .run = run}};
    request.lights = light.rig;
    if (light.sky) {
      settings.push_back({"0.06 sr, 0.3 rad, R 32", request});
      settings.back().request.gather.solid_angle = 0.06F;
      settings.back().request.gather.parallax = 0.3F;
      settings.push_back({"default", request});
    } else {
      for (const unsigned rays : options.sun_rays) {
        settings.push_back({fmt::format("{} rays", rays), request});
        settings.back().request.light_sampling.sun_rays = rays;
      }
    }

    // Light by both in turn
    std::vector<Costs> ours(settings.size()), theirs(options.sun_rays.size());
    std::vector<std::vector<double>> our_values(settings.size()), their_values(theirs.size());
    std::vector<LightReport> reports(settings.size());
    Progress silent;
    progress.begin("light " + std::string(light.name),
                   options.repeats * (settings.size() + theirs.size()), "runs");
    for (unsigned repeat = 0; repeat < options.repeats; ++repeat) {
      for (std::size_t i = 0; i < settings.size(); ++i) {
        const Stopwatch clock;
        reports[i] = light_container(settings[i].request, lit.path(), silent);
        Cost cost = clock.cost();
        cost.cpu = reports[i].ray_cpu_seconds + reports[i].sky_cpu_seconds;
        ours[i].add(cost);
        if (repeat == 0) {
          const std::vector<Surfel> relit =
              some_surfels(ContainerReader(lit.path()), options.checked);
          for (const std::size_t place : places) {
            const Surfel& s = relit[place];
            our_values[i].push_back(
                static_cast<double>(std::numbers::pi_v<float> * s.radiance.g / s.albedo.g));
          }
        }
        progress.advance(1);
      }
      for (std::size_t i = 0; i < theirs.size(); ++i) {
        const LightSampling sampling =
            rays_of_place(light.sky, std::max(1U, options.sun_rays[i] / kPlaces));
        std::vector<double> values(timed_surfels.size());
        theirs[i].add(timed([&] {
          executor.for_each((values.size() + 255) / 256, [&](std::size_t block, unsigned) {
            for (std::size_t k = 256 * block; k < std::min(values.size(), 256 * (block + 1)); ++k)
              values[k] = by_mesh.at(timed_surfels[k], sampling, k);
          });
        }));
        if (repeat == 0) {
          for (std::size_t k = 0; k < checked.size(); ++k)
            their_values[i].push_back(by_mesh.at(checked[k], sampling, all + k));
        }
        progress.advance(1);
      }
    }
    progress.end();

    // Compare with the reference
    const auto add = [&](const char* method, const std::string& setting, const Costs& costs,
                         std::uint64_t surfels, double rays, const std::vector<double>& values) {
      RelightRow row{.scene = choice.name,
                     .light = light.name,
                     .method = method,
                     .setting = setting,
                     .surfels = surfels,
                     .threads = executor.threads(),
                     .rays = rays,
                     .us = costs.cpu_us(surfels),
                     .wall_us = costs.wall_us(surfels)};
      add_errors(truth, values, light.sky, row);
      rows.push_back(std::move(row));
    };
    for (std::size_t i = 0; i < settings.size(); ++i) {
      const double rays =
          light.sky ? kNone : static_cast<double>(reports[i].rays) / static_cast<double>(all);
      add("ptclight", settings[i].name, ours[i], all, rays, our_values[i]);
    }
    for (std::size_t i = 0; i < theirs.size(); ++i) {
      add("embree-mesh", fmt::format("{} rays", options.sun_rays[i]), theirs[i],
          timed_surfels.size(), options.sun_rays[i], their_values[i]);
    }
  }
  return rows;
}

}  // namespace ptc::bench
