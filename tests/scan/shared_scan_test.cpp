// Scanned models, sampled anew: their normals are known.
#include <cmath>
#include <numeric>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/io/mesh/mesh.h"
#include "tests/io/files.h"
#include "tests/scan/clouds.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Returns random points of a mesh, and the distance between neighbours.
std::pair<TrueCloud, double> sample(const Mesh& mesh, std::size_t count) {
  std::vector<double> area;
  const auto corner = [&](std::size_t t, std::size_t k) {
    return glm::dvec3(mesh.positions[mesh.triangles[t][k]]);
  };
  const auto across = [&](std::size_t t) {
    return glm::cross(corner(t, 1) - corner(t, 0), corner(t, 2) - corner(t, 0));
  };
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    area.push_back(glm::length(across(t)) / 2);
  const double total = std::reduce(area.begin(), area.end());
  Random random(41);
  TrueCloud cloud;
  double passed = 0;
  for (std::size_t t = 0; t < area.size(); ++t) {
    passed += area[t];
    while (static_cast<double>(cloud.size()) + 0.5 < passed / total * static_cast<double>(count)) {
      double u = random.uniform(), v = random.uniform();
      if (u + v > 1) u = 1 - u, v = 1 - v;
      const glm::dvec3 p =
          corner(t, 0) + u * (corner(t, 1) - corner(t, 0)) + v * (corner(t, 2) - corner(t, 0));
      cloud.push_back({p, glm::normalize(across(t))});
    }
  }
  return {cloud, std::sqrt(total / static_cast<double>(cloud.size()))};
}

}  // namespace

TEST_CASE("scan: normals of sampled models are right, with noise and without", "[scan][shared]") {
  const auto data = shared_data();
  if (!data) {
    WARN("skipped: the folder of real files is not on this machine");
    return;
  }
  for (const char* name : {"meshes/dragon_vrip.ply.gz", "meshes/cgal-armadillo.off"}) {
    CAPTURE(name);
    auto [cloud, spacing] = sample(read_mesh(*data / name).mesh, 1'000'000);
    const RawScan clean = raw_scan(cloud);
    const NormalErrors errors = compare(cloud, clean, complete(clean, {}, 2).records);
    CHECK(errors.median < 2);
    CHECK(errors.flipped < 0.005);
    add_noise(cloud, spacing / 2);
    const RawScan noisy = raw_scan(cloud);
    const NormalErrors more = compare(cloud, noisy, complete(noisy, {}, 2).records);
    CHECK(more.median < 8);
    CHECK(more.flipped < 0.005);
  }
}
