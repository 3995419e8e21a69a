#include "engine/scene/sampling/surface_survey.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "engine/base/numbers.h"
#include "engine/scene/sampling/sampler.h"
#include "engine/scene/sampling/solids.h"
#include "engine/scene/sampling/sub_triangle.h"
#include "engine/scene/texture.h"

namespace ptc {
namespace {

/// Takes places at equal steps of a sum that is not known beforehand: whenever there are twice as
/// many as wanted, every second one goes, and the step doubles.
class EvenPlaces {
 public:
  explicit EvenPlaces(std::size_t wanted) : wanted_(wanted) {}

  /// Goes on by a weight.
  /// @param place  returns the place of a point that is due; its argument is 0 to 1
  template <typename Place>
  void add(double weight, const Place& place) {
    if (step_ == 0) step_ = weight / static_cast<double>(wanted_);
    for (due_ += weight; due_ > 0 && step_ > 0; due_ -= step_) {
      golden_ = std::fmod(golden_ + 0.618033988749895, 1.0);
      places_.push_back(place(golden_));
      if (places_.size() < 2 * wanted_) continue;
      for (std::size_t i = 0; i < wanted_; ++i) places_[i] = places_[2 * i];
      places_.resize(wanted_);
      step_ *= 2;
    }
  }

  [[nodiscard]] std::vector<glm::dvec3> take() { return std::move(places_); }

 private:
  std::size_t wanted_;
  std::vector<glm::dvec3> places_;
  double step_ = 0, due_ = 0;
  double golden_ = 0;  ///< multiples of the golden ratio spread evenly
};

/// Says of triangles that come one after another whether they enclose a solid. Every edge of a
/// closed surface is used as often in one direction as in the other, so that a sum of numbers made
/// from the edges, added for one direction and subtracted for the other, is 0. Of other surfaces
/// one in 2^64 has that sum.
class ClosedTest {
 public:
  /// @param shape  of the triangle
  void add(const MeshTriangle& triangle, const SubTriangle& shape) {
    std::array<std::uint64_t, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::vec3& p = triangle.positions[k];
      corners[k] = 0;
      for (const float x : {p.x, p.y, p.z})
        corners[k] = splitmix64(corners[k] ^ std::bit_cast<std::uint32_t>(x + 0.0F));  // -0 is 0
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t a = corners[k], b = corners[(k + 1) % 3];
      if (a < b) sum_ += splitmix64(a ^ splitmix64(b));
      if (b < a) sum_ -= splitmix64(b ^ splitmix64(a));
    }
    // Add a tetrahedron from a vertex of the surface, which keeps the digits of small things far
    // from 0
    if (!apex_) apex_ = shape.corner[0];
    volume_ += glm::dot(shape.corner[0] - *apex_, shape.normal()) / 6;
    area_ += shape.area();
  }

  /// Says whether the triangles are closed, with fronts that look outwards.
  [[nodiscard]] bool is_solid() const { return sum_ == 0 && looks_outwards(volume_, area_); }

 private:
  std::uint64_t sum_ = 0;
  std::optional<glm::dvec3> apex_;
  double volume_ = 0, area_ = 0;
};

/// Returns a place on the line from a corner of a triangle to the middle of the opposite edge.
/// @param golden  0 to 1; even steps of it give even shares of the area
glm::dvec3 place_on(const SubTriangle& shape, double golden) {
  const auto& [a, b, c] = shape.corner;
  return a + std::sqrt(golden) * 0.5 * ((b - a) + (c - a));
}

/// Returns about the share of light that a triangle stops, from a few of its places.
double mean_opacity(const MeshTriangle& triangle, const Material& material) {
  if (material.is_opaque()) return 1;
  constexpr unsigned kSide = 4;  // places along an edge
  const auto& [a, b, c] = triangle.uvs;
  double sum = 0;
  for (unsigned i = 0; i < kSide; ++i) {
    for (unsigned j = 0; j + i < kSide; ++j) {
      const float u = (static_cast<float>(i) + 1.0F / 3) / kSide,
                  v = (static_cast<float>(j) + 1.0F / 3) / kSide;
      sum += static_cast<double>(opacity_at(material, a + u * (b - a) + v * (c - a)));
    }
  }
  return sum / (kSide * (kSide + 1) / 2);
}

/// What was found of one part.
struct PartSurvey {
  double extent = 0;  ///< area of one side
  double area = 0;    ///< of one side, times the opacity
  double backs = 0;   ///< that of double-sided materials
  bool solid = false;
};

/// Reads the triangles of a part.
/// @param all   counts them
/// @param each  gets each triangle
template <typename Each>
PartSurvey survey_part(const MeshParts& parts, std::size_t part, SurfaceSurvey& all,
                       const Each& each) {
  PartSurvey found;
  ClosedTest closed;
  bool opaque = true;
  parts.visit(part, [&](std::span<const MeshTriangle> triangles) {
    all.triangles += triangles.size();
    for (const MeshTriangle& triangle : triangles) {
      const Material& material = parts.materials()[triangle.material];
      all.emits |= material.emission != glm::vec3(0);
      const SubTriangle shape = whole_triangle(triangle.positions);
      const double area = shape.area() * mean_opacity(triangle, material);
      found.extent += shape.area();
      found.area += area;
      if (material.double_sided) found.backs += area;
      closed.add(triangle, shape);
      opaque &= material.is_opaque();
      each(shape);
    }
  });
  found.solid = closed.is_solid() && opaque;
  return found;
}

/// The name of a shape: 0 for that of the mesh itself, else what tells it from others.
using ShapeKey = std::array<int, 6>;

/// Returns M^T M of a linear part, over the square of its size.
glm::dmat3 metric_of(const Placement& place) {
  const glm::dmat3 linear(place);
  const double size = size_of(place);
  return glm::transpose(linear) * linear / (size * size);
}

ShapeKey key_of(const glm::dmat3& metric) {
  bool plain = true;
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) plain &= std::abs(metric[c][r] - (c == r ? 1 : 0)) < 0.1;
  }
  if (plain) return {};
  ShapeKey key;
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3;
    const auto step = [](double x) { return static_cast<int>(std::lround(x)); };
    key[static_cast<std::size_t>(k)] = 1 + step(5 * std::log(metric[k][k]));
    key[static_cast<std::size_t>(k) + 3] =
        step(10 * metric[k][next] / std::sqrt(metric[k][k] * metric[next][next]));
  }
  return key;
}

/// Returns the upper triangle R with R^T R equal to a metric.
glm::dmat3 cholesky(const glm::dmat3& metric) {
  glm::dmat3 root(0);  // root[column][row]
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r <= c; ++r) {
      double sum = metric[c][r];
      for (int k = 0; k < r; ++k) sum -= root[r][k] * root[c][k];
      root[c][r] = r == c ? std::sqrt(std::max(sum, 1e-30)) : sum / root[r][r];
    }
  }
  return root;
}

/// Finds the shapes of a mesh in its places.
std::vector<PlacementGroup> groups_of(const PlacedMesh& placed, std::size_t index) {
  std::map<ShapeKey, PlacementGroup> groups;
  for (std::uint32_t i = 0; i < placed.places.size(); ++i) {
    const glm::dmat3 metric = metric_of(placed.places[i]);
    const ShapeKey key = key_of(metric);
    const auto [at, is_new] = groups.try_emplace(key);
    PlacementGroup& group = at->second;
    if (is_new) {
      group.mesh = index;
      group.is_plain = key == ShapeKey{};
      if (!group.is_plain) group.shape = cholesky(metric);
    }
    group.places.push_back(i);
  }
  std::vector<PlacementGroup> found;
  for (auto& [key, group] : groups) found.push_back(std::move(group));
  return found;
}

}  // namespace

double size_of(const Placement& place) {
  return std::cbrt(std::abs(glm::determinant(glm::dmat3(place))));
}

SurfaceSurvey survey(MeshParts& parts, std::size_t places, bool lamps) {
  SurfaceSurvey found;
  EvenPlaces by_area(places), by_count(places), placed_by_area(places);
  std::vector<PartSurvey> of_parts;
  for (std::size_t part = 0; part < parts.size(); ++part) {
    of_parts.push_back(survey_part(parts, part, found, [&](const SubTriangle& shape) {
      const auto place = [&](double golden) { return parts.origin() + place_on(shape, golden); };
      by_area.add(shape.area(), place);
      by_count.add(1, place);
    }));
  }
  // Survey each shape of the meshes that stand in several places
  std::vector<PartSurvey> of_groups;
  for (std::size_t i = 0; i < parts.placed().size(); ++i) {
    const PlacedMesh& placed = parts.placed()[i];
    for (PlacementGroup& group : groups_of(placed, i)) {
      MeshParts one;
      one.add(placed.mesh, group.is_plain ? std::optional<Placement>() : Placement(group.shape));
      constexpr std::size_t kPlaces = 256;
      EvenPlaces on_mesh(kPlaces);
      of_groups.push_back(survey_part(one, 0, found, [&](const SubTriangle& shape) {
        on_mesh.add(shape.area(),
                    [&](double golden) { return one.origin() + place_on(shape, golden); });
      }));
      const std::vector<glm::dvec3> on_shape = on_mesh.take();
      const glm::dmat3 back = glm::inverse(group.shape);
      for (const std::uint32_t at : group.places) {
        const Placement& place = placed.places[at];
        const double size = size_of(place);
        placed_by_area.add(of_groups.back().area * size * size, [&](double golden) {
          const auto any = static_cast<std::size_t>(golden * static_cast<double>(on_shape.size()));
          return place * glm::dvec4(back * on_shape[any], 1);
        });
      }
      found.groups.push_back(std::move(group));
    }
  }
  // Let what is closed have one side
  found.keeps_sides = lamps || found.emits;
  const auto counts = [&](const PartSurvey& part) {
    const double area = part.area + (part.solid && !found.keeps_sides ? 0 : part.backs);
    return std::max(area, kLeastSeen * part.extent);
  };
  for (std::size_t part = 0; part < of_parts.size(); ++part) {
    if (of_parts[part].solid && !found.keeps_sides) parts.close(part);
    found.area += counts(of_parts[part]);
  }
  for (std::size_t i = 0; i < of_groups.size(); ++i) {
    PlacementGroup& group = found.groups[i];
    group.area = counts(of_groups[i]);
    for (const std::uint32_t at : group.places) {
      const double size = size_of(parts.placed()[group.mesh].places[at]);
      found.area += group.area * size * size;
    }
  }
  found.by_area = by_area.take();
  found.by_count = by_count.take();
  found.placed_by_area = placed_by_area.take();
  return found;
}

}  // namespace ptc
