// Lobes of rough mirrors, against integrals of Walter's formula and sums over all discs.
#include <cmath>
#include <numbers>
#include <random>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/basis.h"
#include "engine/parallel/thread_pool.h"
#include "engine/shade/reference/lobe_rays.h"
#include "engine/trace/ray_shader.h"
#include "tests/shade/gather_scene.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// What a microfacet surface of GGX that absorbs nothing reflects of a direction, times the cosine:
/// D G / (4 n.v), as Walter et al. 2007 and Heitz 2014 write it.
double reflected(const glm::dvec3& n, const glm::dvec3& v, const glm::dvec3& l, double alpha) {
  const double nv = glm::dot(n, v), nl = glm::dot(n, l);
  if (nv <= 0 || nl <= 0) return 0;
  const double nh = glm::dot(n, glm::normalize(v + l)), square = alpha * alpha;
  const double spread = nh * nh * (square - 1) + 1;
  const double facets = square / (std::numbers::pi * spread * spread);
  const auto smith = [&](double c) { return (std::sqrt(1 + square * (1 / (c * c) - 1)) - 1) / 2; };
  return facets / (1 + smith(nv) + smith(nl)) / (4 * nv);
}

/// A direction in the plane of x and z.
glm::vec3 tilted(float cosine) {
  return {std::sqrt(1 - cosine * cosine), 0, cosine};
}

}  // namespace

TEST_CASE("lobe: means over its directions are integrals over the hemisphere", "[shade]") {
  const glm::vec3 normal = glm::normalize(glm::vec3(0.3F, -0.5F, 0.8F));
  const Basis basis(normal);
  for (const float roughness : {0.25F, 0.5F, 0.8F, 1.0F}) {
    for (const float cosine : {0.98F, 0.5F, 0.15F}) {
      CAPTURE(roughness, cosine);
      const glm::vec3 eye = basis.to_world(tilted(cosine));
      // The integrals of what is reflected, and of the same times the direction
      const double alpha = static_cast<double>(roughness) * static_cast<double>(roughness);
      constexpr int kSteps = 1200;
      double all = 0;
      glm::dvec3 mean(0);
      for (int j = 0; j < kSteps; ++j) {
        const double z = (j + 0.5) / kSteps, sine = std::sqrt(1 - z * z);
        for (int i = 0; i < kSteps; ++i) {
          const double turn = 2 * std::numbers::pi * (i + 0.5) / kSteps;
          const glm::dvec3 l(sine * std::cos(turn), sine * std::sin(turn), z);
          const double f = reflected({0, 0, 1}, glm::dvec3(tilted(cosine)), l, alpha);
          all += f;
          mean += f * l;
        }
      }
      const double step = 2 * std::numbers::pi / kSteps / kSteps;
      // Sum up the same integrals over the directions of a lobe
      LobeRays lobe;
      lobe_directions(normal, eye, roughness, 16384, 5, lobe);
      double drawn = 0;
      glm::dvec3 sum(0);
      for (std::size_t i = 0; i < lobe.directions.size(); ++i) {
        const auto weight = static_cast<double>(lobe.weights[i]);
        CHECK(glm::length(lobe.directions[i]) == Approx(1).epsilon(1e-5));
        drawn += weight / 16384;
        sum += weight / 16384 * glm::dvec3(lobe.directions[i]);
      }
      CHECK(drawn == Approx(all * step).epsilon(0.004));
      const glm::dvec3 expected = glm::dvec3(basis.to_world(glm::vec3(mean * step)));
      CHECK(glm::length(sum - expected) < 0.004);
    }
  }
}

TEST_CASE("lobe: a polished mirror reflects one direction, and none from behind", "[shade]") {
  LobeRays lobe;
  lobe_directions({0, 0, 1}, tilted(0.6F), 0, 4, 1, lobe);
  REQUIRE(lobe.directions.size() == 4);
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(glm::length(lobe.directions[i] - glm::vec3(-0.8F, 0, 0.6F)) < 1e-5F);
    CHECK(lobe.weights[i] == Approx(1));
  }
  for (const glm::vec3& eye : {glm::vec3(0.8F, 0, -0.6F), glm::vec3(0)}) {
    lobe_directions({0, 0, 1}, eye, 0.5F, 4, 1, lobe);
    CHECK(lobe.directions.empty());
    const Reflection none = sum_lobe(lobe, {}, [](const glm::vec3&) { return glm::vec3(1); });
    CHECK(none.radiance == glm::vec3(0));
    CHECK(none.occlusion == 0);
  }
}

TEST_CASE("lobe: what mirrors show is the sum over all discs and the sky", "[trace]") {
  // Balls of one radiance each, and mirrors between them
  std::vector<Surfel> surfels;
  for (int i = 0; i < 6; ++i) {
    const std::size_t first = surfels.size();
    add_sphere(surfels, {std::cos(i), std::sin(i), 0.2 * i}, 0.35, 0.1, glm::vec3(0.5F));
    for (std::size_t k = first; k < surfels.size(); ++k) {
      surfels[k].radiance = glm::vec3(1 + i, 6 - i, 1);
      surfels[k].emission = glm::vec3(0, 0, i % 2);
    }
  }
  const Scene scene(surfels);
  const auto sky = [](const glm::vec3& d) { return glm::vec3(0.5F + 0.5F * d.z); };
  std::vector<Receiver> mirrors;
  for (int i = 0; i < 6; ++i)
    mirrors.push_back({{0.1 * i - 0.3, 0.05 * i, 0.5}, glm::normalize(glm::vec3(i - 2, 1, 1))});
  const glm::dvec3 eye(0.2, 3, 4);
  const ThreadPool executor(2);
  std::mt19937 bits(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (const float roughness : {0.5F, 0.9F}) {
    std::vector<Reflection> ours(mirrors.size());
    RayShader(*scene.container, {.sky = sky, .emission = false}, executor)
        .reflect(mirrors, {.eye = eye, .roughness = roughness, .rays = 4096}, 3, ours);
    const double alpha = static_cast<double>(roughness) * static_cast<double>(roughness);
    for (std::size_t m = 0; m < mirrors.size(); ++m) {
      CAPTURE(roughness, m);
      const glm::dvec3 n(mirrors[m].normal), v = glm::normalize(eye - mirrors[m].position);
      const Basis basis(mirrors[m].normal);
      glm::dvec3 light(0);
      double covered = 0, all = 0;
      constexpr int kRays = 20'000;
      for (int ray = 0; ray < kRays; ++ray) {
        // An even direction over the hemisphere, in strata of its height
        const double z = (ray + uniform(bits)) / kRays, turn = 2 * std::numbers::pi * uniform(bits);
        const double sine = std::sqrt(1 - z * z);
        const glm::vec3 l =
            basis.to_world(glm::vec3(sine * std::cos(turn), sine * std::sin(turn), z));
        const double f = reflected(n, v, glm::dvec3(l), alpha) * 2 * std::numbers::pi / kRays;
        // The nearest disc along it
        double nearest = 1e30;
        glm::dvec3 seen(sky(l));
        for (const Surfel& s : surfels) {
          const glm::dvec3 to = s.position - mirrors[m].position, normal(s.normal);
          const double t = glm::dot(to, normal) / glm::dot(glm::dvec3(l), normal);
          const glm::dvec3 off = glm::dvec3(l) * t - to;
          if (!(t > 0) || t >= nearest || glm::dot(off, off) > std::pow(double(s.radius), 2))
            continue;
          nearest = t;
          seen = glm::dot(to, normal) < 0 ? glm::dvec3(s.radiance + s.emission) : glm::dvec3(0);
        }
        light += f * seen;
        all += f;
        if (nearest < 1e30) covered += f;
      }
      const double noise = roughness < 0.7F ? 0.04 : 0.02;
      for (int c = 0; c < 3; ++c)
        CHECK(static_cast<double>(ours[m].radiance[c]) ==
              Approx(light[c]).epsilon(noise).margin(noise * 0.3));
      CHECK(static_cast<double>(ours[m].occlusion) ==
            Approx(all > 0 ? covered / all : 0).margin(noise));
    }
  }
}
