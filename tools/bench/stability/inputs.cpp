// Rows of inputs that are odd, huge or turned.
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <numeric>

#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/light/sky_map.h"
#include "engine/scene/ray_scene.h"
#include "engine/scene/texture.h"
#include "engine/shade/reference/brute_force.h"
#include "tools/bench/scenes/work_file.h"
#include "tools/bench/shapes/meshes.h"
#include "tools/bench/shapes/random.h"
#include "tools/bench/shapes/surfels.h"
#include "tools/bench/stability/form_factors.h"
#include "tools/bench/stability/row.h"

namespace ptc::bench {
namespace {

/// A ball above a floor.
std::vector<Surfel> ball_on_floor(double spacing) {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, spacing, glm::vec3(0.5F));
  add_sphere(surfels, {0, 0, 0.6}, 0.5, spacing, {1, 0.4F, 0.1F});
  return surfels;
}

std::vector<Receiver> receivers_below_ball(double lift) {
  return receivers_on_grid(kReceiversAlong, kReceiversAlong, [&](double u, double v) {
    return Receiver{{2 * u - 1, 2 * v - 1, lift}, {0, 0, 1}};
  });
}

/// Shades ball_on_floor() whose surfels a function has changed, beside the unchanged one.
/// @param change  takes the surfels and a sequence of random numbers
template <class Change>
Field changed(const Lab& lab, const Change& change) {
  constexpr double kSpacing = 0.04;
  std::vector<Surfel> surfels = ball_on_floor(kSpacing);
  const auto receivers = receivers_below_ball(0.1 * kSpacing);
  Field field{.width = kReceiversAlong, .height = kReceiversAlong};
  field.truth = values(SmallScene(lab, surfels).shade(receivers), brightness);
  Random random(18);
  change(surfels, random);
  field.ours = values(SmallScene(lab, surfels).shade(receivers), brightness);
  return field;
}

/// A cloud in whose file every tenth point has another beside it, without normal or size.
Outcome degenerate_points(const Lab& lab) {
  constexpr double kSpacing = 0.04;
  const std::vector<Surfel> surfels = ball_on_floor(kSpacing);
  const WorkFile cloud(lab.work, ".stability.ply"), built(lab.work, ".stability.ptcx");
  {
    std::ofstream out(cloud.path());
    out.precision(9);
    out << "ply\nformat ascii 1.0\nelement vertex " << surfels.size() + surfels.size() / 10
        << "\nproperty double x\nproperty double y\nproperty double z\n"
           "property float nx\nproperty float ny\nproperty float nz\nproperty float radius\n"
           "property float radiance_r\nproperty float radiance_g\nproperty float radiance_b\n"
           "end_header\n";
    const auto write = [&](const std::string& position, const std::string& normal,
                           const std::string& radius, const glm::vec3& light) {
      out << position << ' ' << normal << ' ' << radius << ' ' << light.r << ' ' << light.g << ' '
          << light.b << '\n';
    };
    const auto text = [](const auto& v) {
      return std::to_string(v.x) + ' ' + std::to_string(v.y) + ' ' + std::to_string(v.z);
    };
    std::size_t odd = 0;
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      const Surfel& s = surfels[i];
      write(text(s.position), text(s.normal), std::to_string(s.radius), s.radiance);
      if (odd == surfels.size() / 10 || i % 10 != 0) continue;
      // Beside every tenth point one that is not whole
      switch (odd++ % 3) {
        case 0:
          write(text(s.position), "0 0 0", std::to_string(s.radius), s.radiance);
          break;
        case 1:
          write(text(s.position), text(s.normal), "0", s.radiance);
          break;
        default:
          write(text(s.position), "0 0 0", "0", s.radiance);
          break;
      }
    }
  }
  BuildRequest request{.inputs = {cloud.path()}};
  Progress silent;
  build_container(request, built.path(), silent);
  const ContainerReader container(built.path());
  const auto receivers = receivers_below_ball(0.1 * kSpacing);
  std::vector<Shading> shaded(receivers.size());
  Shader(container, {.cache_bytes = 64U << 20}, lab.executor).shade(receivers, shaded, silent);
  Field field{kReceiversAlong, kReceiversAlong, values(shaded, brightness),
              values(SmallScene(lab, surfels).shade(receivers), brightness)};
  const double rms = relative_rms(field.ours, field.truth);
  return {.figures = {{"light, RMS change over its mean", rms, 0.05}}, .field = std::move(field)};
}

/// Normals of a tenth of the points are turned over, and all of them have noise.
Outcome noisy_normals(const Lab& lab) {
  Field noisy = changed(lab, [](std::vector<Surfel>& surfels, Random& random) {
    for (Surfel& s : surfels) s.normal = glm::normalize(s.normal + 0.2F * random.direction());
  });
  Field flipped = changed(lab, [](std::vector<Surfel>& surfels, Random& random) {
    for (Surfel& s : surfels) s.normal = random.unit() < 0.1 ? -s.normal : s.normal;
  });
  const double by_flips = relative_rms(flipped.ours, flipped.truth),
               by_noise = relative_rms(noisy.ours, noisy.truth);
  return {.figures = {{"light, RMS change by noise of 0.2, over its mean", by_noise, 0.1},
                      {"light, RMS change by 10 % turned over, over its mean", by_flips, 0.2}},
          .field = std::move(flipped)};
}

/// A million points at one place.
Outcome coincident(const Lab& lab) {
  constexpr std::size_t kPoints = 1'000'000;
  std::vector<Surfel> surfels(
      kPoints,
      {.position = {0, 0, 1}, .normal = {0, 0, -1}, .radius = 0.5, .radiance = glm::vec3(1)});
  surfels.push_back({.position = {5, 5, 5}, .normal = {0, 0, 1}, .radius = 0.1F});
  const SmallScene scene(lab, surfels);
  const auto receivers = receivers_on_grid(4, 4, [](double u, double v) {
    return Receiver{{2 * u - 1, 2 * v - 1, 0}, {0, 0, 1}};
  });
  std::vector<glm::vec3> truth;
  for (const Receiver& r : receivers)
    truth.emplace_back(disc_form_factor(1, std::hypot(r.position.x, r.position.y), 0.5));
  const auto ours = values(scene.shade(receivers), brightness);
  return {.figures = {{"light, largest error", largest_difference(ours, truth), 0.02},
                      {"nodes for each point",
                       static_cast<double>(scene.container().superblock().nodes) / kPoints, 0.2,
                       false}},
          .field = {4, 4, ours, truth}};
}

/// A scene that is moved, scaled, and whose points come in another order.
Outcome moved(const Lab& lab) {
  constexpr double kSpacing = 0.04;
  const auto receivers = receivers_below_ball(0.1 * kSpacing);
  const std::vector<Surfel> surfels = ball_on_floor(kSpacing);
  const auto truth = values(SmallScene(lab, surfels).shade(receivers), brightness);
  const auto shade = [&](double scale, const glm::dvec3& offset, bool reversed) {
    std::vector<Surfel> other = surfels;
    if (reversed) std::ranges::reverse(other);
    for (Surfel& s : other) {
      s.position = s.position * scale + offset;
      s.radius *= static_cast<float>(scale);
    }
    std::vector<Receiver> places = receivers;
    for (Receiver& r : places) r.position = r.position * scale + offset;
    return values(SmallScene(lab, other).shade(places), brightness);
  };
  const auto far = shade(1, glm::dvec3(1e7, -2e7, 3e7), false);
  const auto small = shade(0x1p-10, {0, 0, 0}, false), reversed = shade(1, {0, 0, 0}, true);
  const auto large = shade(1e6, {0, 0, 0}, false);
  return {
      .figures = {{"light, largest change 37,000 km away", largest_difference(far, truth), 0.02},
                  {"light, largest change at 1/1024 of the size", largest_difference(small, truth),
                   0.0},
                  {"light, largest change at a million times the size",
                   largest_difference(large, truth), 0.03},
                  {"light, largest change in another order of points",
                   largest_difference(reversed, truth), 0.0}},
      .field = {kReceiversAlong, kReceiversAlong, far, truth}};
}

/// One point a million kilometres away: a thousandth of a metre is 12 orders below the extent.
Outcome twelve_orders(const Lab& lab) {
  Field field = changed(lab, [](std::vector<Surfel>& surfels, Random&) {
    surfels.push_back({.position = {1e9, 0, 0}, .normal = {1, 0, 0}, .radius = 1});
  });
  const double rms = relative_rms(field.ours, field.truth);
  return {.figures = {{"light, RMS change over its mean", rms, 0.02}}, .field = std::move(field)};
}

/// Needles of an aspect of a million, and one huge triangle: their discs cover what they cover.
Outcome needles(const Lab& lab) {
  Mesh mesh = empty_mesh();
  // A fan of 64 needles, side by side, which is a sheet of 1 x 1
  constexpr int kNeedles = 64;
  for (int i = 0; i < kNeedles; ++i) {
    const float low = static_cast<float>(i) / kNeedles, width = 1.0F / kNeedles;
    add_triangle(mesh, {0, low, 1}, {0, low + width, 1}, {1, low + width, 1});
    add_triangle(mesh, {0, low, 1}, {1, low + width, 1}, {1, low, 1});
    add_triangle(mesh, {0, low, 1}, {1, low, 1}, {1, low + 1e-6F, 1});
  }
  LightRig lights;
  const SmallScene scene(lab, mesh, lights, 20'000);
  double area = 0;
  for (const Surfel& s : scene.surfels()) area += 2 * std::pow(double{s.radius}, 2);
  const auto receivers =
      receivers_on_grid(kReceiversAlong, kReceiversAlong, [](double u, double v) {
        return Receiver{{1.6 * u - 0.3, 1.6 * v - 0.3, 0}, {0, 0, 1}};
      });
  const std::array<glm::dvec3, 4> sheet{{{0, 0, 1}, {0, 1, 1}, {1, 1, 1}, {1, 0, 1}}};
  std::vector<glm::vec3> truth;
  for (const Receiver& receiver : receivers) truth.emplace_back(1 - form_factor(receiver, sheet));
  const auto ours = values(scene.shade(receivers), openness);
  return {.figures = {{"area of the discs, error", std::abs(area - 1), 0.05},
                      {"occlusion, largest error", largest_difference(ours, truth), 0.02}},
          .field = {kReceiversAlong, kReceiversAlong, ours, truth}};
}

/// Ten dense spots in a space a million times as wide: bytes for each point.
Outcome sparse_and_wide(const Lab& lab) {
  Random random(22);
  const auto spots = [&](double extent) {
    std::vector<Surfel> surfels;
    for (int i = 0; i < 10; ++i)
      add_sphere(surfels, random.in_box(0, extent), 1, 0.02, glm::vec3(0.5F));
    return surfels;
  };
  const auto bytes = [&](const std::vector<Surfel>& surfels) {
    const SmallScene scene(lab, surfels);
    return static_cast<double>(scene.bytes()) / static_cast<double>(surfels.size());
  };
  const double compact = bytes(spots(2)), wide = bytes(spots(1e6));
  return {.figures = {{"bytes for each point, more than in a dense scene",
                       std::max(0.0, wide / compact - 1), 0.2}}};
}

/// A sky whose light comes from one pixel, over a ground with a ball: the shadow of a sun.
Outcome one_pixel_sun(const Lab& lab) {
  Mesh mesh = empty_mesh();
  add_quad(mesh, {-3, 0, 3}, {6, 0, 0}, {0, 0, -6});
  Mesh ball = sphere(0.5F, 24);
  for (const auto& t : ball.triangles) {
    const glm::vec3 up(0, 0.8F, 0);
    add_triangle(mesh, ball.positions[t[0]] + up, ball.positions[t[1]] + up,
                 ball.positions[t[2]] + up);
  }
  Image map{.width = 1024, .height = 512};
  map.pixels.assign(std::size_t{map.width} * map.height, glm::vec3(0.2F));
  map.pixels[120 * map.width + 400] = glm::vec3(64000);
  LightRig lights;
  lights.sky.radiance = glm::vec3(1);
  lights.sky.map = std::make_shared<const Texture>(map);
  lights.sky.map_path = "sun.exr";  // which the container records, and nothing here reads
  const SmallScene scene(lab, mesh, lights, 60'000);
  const double lift = 0.15 * scene.radius();
  const auto receivers =
      receivers_on_grid(kReceiversAlong, kReceiversAlong, [&](double u, double v) {
        return Receiver{{4 * u - 2, lift, 4 * v - 2}, {0, 1, 0}};
      });
  const auto shaded = scene.shade(receivers, sky_function(smooth_sky(lights.sky)));
  const RayScene rays(mesh);
  const DirectLight light(rays, lights);
  std::vector<glm::vec3> ours, truth(receivers.size());
  for (const Shading& shading : shaded) ours.push_back(shading.sky / kPi);
  lab.executor.for_each(receivers.size(), [&](std::size_t i, unsigned) {
    truth[i] = light
                   .irradiance(receivers[i].position, receivers[i].normal,
                               {.sun_rays = 1, .area_rays = 0, .sky_rays = 1024}, i)
                   .sky /
               kPi;
  });
  return {.figures = {{"light of the sky, RMS error over its mean", relative_rms(ours, truth), 0.1},
                      {"light of the sky, error of its mean",
                       std::abs(mean_value(ours) / mean_value(truth) - 1), 0.02}},
          .field = {kReceiversAlong, kReceiversAlong, ours, truth}};
}

constexpr std::array kInputRows = std::to_array<Row>({
    {"18", "cloud with points without normal or size", "values that are no numbers",
     degenerate_points},
    {"18", "normals with noise, and turned over", "light that is lost", noisy_normals},
    {"19", "million points at one place", "trees without end", coincident},
    {"20", "scene moved, scaled and reordered", "light that depends on the place", moved},
    {"20", "scene with a point 12 orders of magnitude away", "points that fall together",
     twelve_orders},
    {"21", "needles of an aspect of a million", "gaps, and discs that stick out", needles},
    {"22", "dense spots far apart", "memory for empty space", sparse_and_wide},
    {"33", "sky with a sun of one pixel", "blotches, and shadows that are lost", one_pixel_sun},
});

}  // namespace

std::span<const Row> rows_of_inputs() {
  return kInputRows;
}

}  // namespace ptc::bench
