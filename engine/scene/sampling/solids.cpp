// Closed surfaces by their edges, solids among them by rays.
//
//     +-----------+        Every edge of a closed surface is used as often in one direction as in
//     | room   o  |  +--+  the other: by both triangles at it, counter-clockwise seen from outside.
//     |       ||| |  |..|  The volume of a solid is positive. From the back of the right box all
//     +-----------+  +--+  rays meet that back again; those in the room meet a lamp as well.
#include "engine/scene/sampling/solids.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include <glm/geometric.hpp>

#include "engine/base/low_discrepancy.h"
#include "engine/scene/sampling/directions.h"
#include "engine/scene/sampling/places_by_area.h"
#include "engine/scene/sampling/sub_triangle.h"
#include "engine/scene/step_off.h"

namespace ptc {
namespace {

constexpr std::uint32_t kRays = 64;         // from the back of a closed surface
constexpr std::uint32_t kOthers = 6;        // of those, that may meet fronts in a solid
constexpr std::size_t kMaxEmitters = 4096;  // places on emitters that are looked at, evenly spread
constexpr std::uint32_t kProbes = 3;        // rays that tell what a place lies in
constexpr int kMaxCrossings = 256;          // surfaces that such a ray is followed through

bool has_double_sided(const Mesh& mesh) {
  return std::any_of(mesh.materials.begin(), mesh.materials.end(),
                     [](const Material& m) { return m.double_sided; });
}

// Returns, for each vertex, the first of those at its position.
std::vector<std::uint32_t> welded(const Mesh& mesh) {
  std::vector<std::uint32_t> order(mesh.positions.size()), first(order.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto key = [&](std::uint32_t v) {
    const glm::vec3& p = mesh.positions[v];
    return std::array{p.x + 0.0F, p.y + 0.0F, p.z + 0.0F};  // -0 becomes 0
  };
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const auto left = key(a), right = key(b);
    return left != right ? left < right : a < b;
  });
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && key(order[i]) == key(order[i - 1]);
    first[order[i]] = same ? first[order[i - 1]] : order[i];
  }
  return first;
}

std::uint32_t root(std::span<std::uint32_t> parents, std::uint32_t v) {
  while (parents[v] != v) v = parents[v] = parents[parents[v]];
  return v;
}

// Marks the surfaces that have an edge used more often in one direction than in the other, or a
// part that light passes through.
void mark_open(const Mesh& mesh, std::span<const std::uint32_t> first,
               std::span<std::uint32_t> parents, std::vector<bool>& open) {
  std::vector<std::uint64_t> up, down;  // edges towards the greater vertex, and the others
  up.reserve(mesh.triangles.size() * 3 / 2);
  down.reserve(mesh.triangles.size() * 3 / 2);
  for (const auto& c : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t a = first[c[k]], b = first[c[(k + 1) % 3]];
      if (a < b) up.push_back(a << 32 | b);
      if (b < a) down.push_back(b << 32 | a);
    }
  }
  std::sort(up.begin(), up.end());
  std::sort(down.begin(), down.end());
  const auto mark = [&](std::uint64_t edge) {
    open[root(parents, static_cast<std::uint32_t>(edge >> 32))] = true;
  };
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (!mesh.materials[mesh.material_of[i]].is_opaque())
      open[root(parents, first[mesh.triangles[i][0]])] = true;
  }
  std::size_t i = 0, j = 0;
  while (i < up.size() || j < down.size()) {
    if (j == down.size() || (i < up.size() && up[i] < down[j])) {
      mark(up[i++]);
    } else if (i == up.size() || down[j] < up[i]) {
      mark(down[j++]);
    } else {
      ++i;
      ++j;
    }
  }
}

std::uint32_t solid_of(const Mesh& mesh, const Solids& solids, std::uint32_t triangle) {
  return solids.of_vertex[mesh.triangles[triangle][0]];
}

// Marks the closed surfaces that a place is inside of. A ray from inside leaves each once more than
// it enters.
void mark_around(const RayScene& scene, const Solids& solids, const glm::dvec3& place,
                 std::uint64_t seed, std::vector<bool>& rooms) {
  const SquarePoints points(seed);
  for (std::uint32_t probe = 0; probe < kProbes; ++probe) {
    const glm::vec2 square = points.square(probe);
    const float z = 2 * square.x - 1, turn = 2 * kPi * square.y;
    const float across = std::sqrt(std::max(0.0F, 1 - z * z));
    const glm::vec3 direction(across * std::cos(turn), across * std::sin(turn), z);
    std::vector<std::pair<std::uint32_t, int>> depths;  // closed surface, times it was left
    double from = 0;
    for (int i = 0; i < kMaxCrossings; ++i) {
      const auto hit =
          scene.closest(place, direction, from, std::numeric_limits<double>::infinity());
      if (!hit) break;
      from = hit->distance + scene.epsilon();
      const std::uint32_t solid = solid_of(scene.mesh(), solids, hit->triangle);
      if (solid == Solids::kNone) continue;
      auto at = std::find_if(depths.begin(), depths.end(),
                             [&](const auto& depth) { return depth.first == solid; });
      if (at == depths.end()) at = depths.insert(at, {solid, 0});
      at->second += hit->front ? -1 : 1;
    }
    for (const auto& [solid, depth] : depths) {
      if (depth > 0) rooms[solid] = true;
    }
  }
}

// Marks the closed surfaces that light begins in.
void mark_lit(const RayScene& scene, const Solids& solids, const LightRig& lights,
              std::vector<bool>& rooms) {
  std::uint64_t seed = 0;
  for (const PointLight& lamp : lights.points)
    mark_around(scene, solids, lamp.position, seed++, rooms);
  for (const SpotLight& lamp : lights.spots)
    mark_around(scene, solids, lamp.position, seed++, rooms);
  const Mesh& mesh = scene.mesh();
  std::vector<std::uint32_t> emitters;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    if (mesh.materials[mesh.material_of[i]].emission != glm::vec3(0)) emitters.push_back(i);
  }
  const std::size_t step = emitters.size() / kMaxEmitters + 1;
  for (std::size_t i = 0; i < emitters.size(); i += step) {
    const SurfaceHit at = scene.surface(emitters[i], 1 / 3.0F, 1 / 3.0F);
    if (const auto place = step_off(scene, at.position, at.geometric_normal))
      mark_around(scene, solids, *place, seed++, rooms);
  }
}

// Says whether rays from the back of a closed surface meet much beside backs.
bool holds_something(const RayScene& scene, std::uint64_t seed,
                     std::span<const std::uint32_t> triangles) {
  const PlacesByArea places(scene, triangles, ~seed);
  const SquarePoints points(seed);
  std::uint32_t others = 0;
  for (std::uint32_t i = 0; i < kRays && others <= kOthers; ++i) {
    const SurfaceHit at = places.place(i, kRays);
    const glm::vec3 inwards = -at.geometric_normal;
    const auto origin = step_off(scene, at.position, inwards);
    if (!origin) continue;
    const auto hit =
        scene.closest(*origin, Basis(inwards).to_world(cosine_direction(points.square(i))), 0,
                      std::numeric_limits<double>::infinity());
    if (!hit || hit->front) ++others;
  }
  return others > kOthers;
}

}  // namespace

bool looks_outwards(double volume, double area) {
  constexpr double kLeastVolume = 1e-9;  // over the area to the power of 1.5
  return volume > kLeastVolume * area * std::sqrt(area);
}

Solids find_solids(const Mesh& mesh) {
  Solids solids;
  if (!has_double_sided(mesh)) return solids;
  // Join what shares a position
  const std::vector<std::uint32_t> first = welded(mesh);
  std::vector<std::uint32_t> parents(first.size());
  std::iota(parents.begin(), parents.end(), 0U);
  for (const auto& c : mesh.triangles) {
    const std::uint32_t a = root(parents, first[c[0]]);
    for (std::size_t k = 1; k < 3; ++k) parents[root(parents, first[c[k]])] = a;
  }
  // Find what is closed and looks outwards
  std::vector<bool> open(first.size());
  mark_open(mesh, first, parents, open);
  std::vector<std::uint32_t> number(first.size(), Solids::kNone);
  std::vector<double> volume, area;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const std::uint32_t at = root(parents, first[mesh.triangles[i][0]]);
    if (open[at]) continue;
    if (number[at] == Solids::kNone) {
      number[at] = solids.count++;
      volume.push_back(0);
      area.push_back(0);
    }
    // Add a tetrahedron from a vertex of the surface, which keeps the digits of small things far
    // from 0
    const SubTriangle triangle = whole_triangle(mesh, i);
    const glm::dvec3 from_apex = triangle.corner[0] - glm::dvec3(mesh.positions[at]);
    volume[number[at]] += glm::dot(from_apex, triangle.normal()) / 6;
    area[number[at]] += triangle.area();
  }
  if (solids.count == 0) return solids;
  solids.of_vertex.resize(first.size());
  for (std::uint32_t v = 0; v < first.size(); ++v) {
    const std::uint32_t n = number[root(parents, first[v])];
    const bool outwards = n != Solids::kNone && looks_outwards(volume[n], area[n]);
    solids.of_vertex[v] = outwards ? n : Solids::kNone;
  }
  return solids;
}

void close_solids(Mesh& mesh, const Solids& solids, const RayScene& scene, const LightRig& lights) {
  if (solids.count == 0) return;
  // Find the rooms: first those with light in them, then those with anything else
  std::vector<bool> rooms(solids.count);
  mark_lit(scene, solids, lights, rooms);
  std::vector<std::uint32_t> triangles;  // of closed surfaces, one after another
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    if (solid_of(mesh, solids, i) != Solids::kNone) triangles.push_back(i);
  }
  const auto number = [&](std::uint32_t i) { return solid_of(mesh, solids, i); };
  std::stable_sort(triangles.begin(), triangles.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return number(a) < number(b); });
  for (auto at = triangles.begin(); at != triangles.end();) {
    const std::uint32_t solid = number(*at);
    const auto end =
        std::find_if(at, triangles.end(), [&](std::uint32_t i) { return number(i) != solid; });
    if (!rooms[solid]) rooms[solid] = holds_something(scene, solid, {at, end});
    at = end;
  }
  // Give the other triangles one-sided copies of their materials
  std::vector<std::size_t> copies(mesh.materials.size(), 0);  // 0: none yet
  for (const std::uint32_t i : triangles) {
    const std::uint16_t material = mesh.material_of[i];
    if (rooms[number(i)] || !mesh.materials[material].double_sided) continue;
    if (copies[material] == 0) {
      if (mesh.materials.size() == kMaxMaterials) continue;
      copies[material] = mesh.materials.size();
      mesh.materials.push_back(mesh.materials[material]);
      mesh.materials.back().double_sided = false;
    }
    mesh.material_of[i] = static_cast<std::uint16_t>(copies[material]);
  }
}

}  // namespace ptc
