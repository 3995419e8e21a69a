// Cutting and sorting the surface, and spreading points over a patch of it.
#include "engine/scene/sampling/surface_patches.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <span>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "engine/scene/sampling/low_discrepancy.h"
#include "format/morton.h"

namespace ptc {
namespace {

constexpr double kPieceSpacings = 32;        // a piece is at most so wide,
constexpr double kVaryingPieceSpacings = 8;  // so that it has one spacing nearly,
constexpr double kPieceWeight = 0.1;         // or wants at most so many surfels
constexpr double kPartSpacings = 1;          // the same of a part of it
constexpr double kPartWeight = 0.0156;
constexpr std::uint32_t kDeepest = 1u << 30;  // so that a path fits 32 bits

double widest_side(const Bounds& bounds) {
  const glm::dvec3 extent = bounds.high - bounds.low;
  return std::max({extent.x, extent.y, extent.z});
}

// Place on the Z-curve through a box of 2^bits cells along its widest side: 3 bits for each.
std::uint64_t place_on_curve(const glm::dvec3& offset, double widest, int bits) {
  const double most = std::ldexp(1.0, bits) - 1;
  const auto cell = [&](double at) {
    return static_cast<std::uint64_t>(widest > 0 ? std::clamp(at / widest * most, 0.0, most) : 0);
  };
  return encode_morton({cell(offset.x) << 21, cell(offset.y) << 21, cell(offset.z) << 21}).high;
}

// A part of a patch, below a spacing wide.
struct Part {
  std::array<glm::vec2, 3> uv;
  std::uint32_t triangle;
  double spacing;
  double weight;
};

// All parts of a patch, in an order that keeps neighbours together.
class Parts {
 public:
  explicit Parts(const Mesh& mesh) : mesh_(mesh) {}

  void add(std::uint32_t triangle, const SubTriangle& shape, double spacing) {
    const double weight = shape.area() / (spacing * spacing);
    if (!(weight > 0)) return;
    if (weight > kPartWeight && shape.longest_edge() > kPartSpacings * spacing) {
      add(triangle, shape.half(false), spacing);
      add(triangle, shape.half(true), spacing);
      return;
    }
    parts_.push_back({{glm::vec2(shape.uv[0]), glm::vec2(shape.uv[1]), glm::vec2(shape.uv[2])},
                      triangle,
                      spacing,
                      weight});
    total_ += weight;
    area_ += shape.area() * ((kind_of(parts_.back()) & 2u) != 0 ? 2 : 1);
    bounds_.add(shape.centre());
    keys_.emplace_back(0, static_cast<std::uint32_t>(keys_.size()));
  }

  [[nodiscard]] double weight() const { return total_; }
  [[nodiscard]] double area() const { return area_; }
  [[nodiscard]] std::uint32_t kind_of(const Part& part) const {
    const Material& material = mesh_.materials[mesh_.material_of[part.triangle]];
    const bool emits = material.emission != glm::vec3(0);
    return (material.double_sided ? 2u : 0u) | (emits ? 1u : 0u);
  }

  [[nodiscard]] SubTriangle shape_of(const Part& part) const {
    const auto& c = mesh_.triangles[part.triangle];
    SubTriangle shape;
    for (std::size_t i = 0; i < 3; ++i) {
      shape.uv[i] = glm::dvec2(part.uv[i]);
      shape.corner[i] = (1 - shape.uv[i].x - shape.uv[i].y) * glm::dvec3(mesh_.positions[c[0]]) +
                        shape.uv[i].x * glm::dvec3(mesh_.positions[c[1]]) +
                        shape.uv[i].y * glm::dvec3(mesh_.positions[c[2]]);
    }
    return shape;
  }

  // Sorts by kind, then the axis that the normal follows most, so that the two sides of an edge or
  // of a thin wall are apart, then along the curve: 2, 3 and 54 bits.
  void sort() {
    if (parts_.empty()) return;
    const double widest = widest_side(bounds_);
    for (auto& [key, index] : keys_) {
      const Part& part = parts_[index];
      const SubTriangle shape = shape_of(part);
      const std::uint64_t group = kind_of(part) << 3 | side_of(shape.normal());
      key = group << 54 | place_on_curve(shape.centre() - bounds_.low, widest, 18);
    }
    std::sort(keys_.begin(), keys_.end());
  }

  template <typename Visit>
  void visit_sorted(const Visit& visit) const {
    for (const auto& [key, index] : keys_) visit(parts_[index]);
  }

 private:
  static std::uint32_t side_of(const glm::dvec3& normal) {
    const glm::dvec3 size = glm::abs(normal);
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    return static_cast<std::uint32_t>(2 * axis + (normal[axis] < 0 ? 1 : 0));
  }

  const Mesh& mesh_;
  std::vector<Part> parts_;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keys_;
  double total_ = 0;
  double area_ = 0;
  Bounds bounds_;
};

// Walks the parts and sets points: point k owns the weight from k to k + 1 steps, and lies where
// its middle falls.
class Spread {
 public:
  Spread(const Parts& parts, std::uint64_t seed, std::span<SurfacePoint> out)
      : parts_(parts),
        step_(parts.weight() / static_cast<double>(out.size())),
        seed_(seed),
        out_(out) {}

  void walk(const Part& part) {
    const double begin = walked_;
    walked_ += part.weight;
    share_area(begin, walked_, part.spacing * part.spacing);
    part_ = &part;
    const std::size_t first = from(begin);
    const std::size_t last = from(walked_);
    if (first < last) place(parts_.shape_of(part), begin, walked_, first, last);
  }

  // Rounding may leave the last point just beyond the end.
  void finish() {
    if (part_ != nullptr && from(walked_) < out_.size()) {
      put(parts_.shape_of(*part_), out_.size() - 1);
    }
  }

 private:
  // First point whose middle is not before `weight`.
  [[nodiscard]] std::size_t from(double weight) const {
    const double index = std::max(0.0, std::ceil(weight / step_ - 0.5));
    return std::min(static_cast<std::size_t>(index), out_.size());
  }

  void share_area(double begin, double end, double square) {
    auto k = std::min(static_cast<std::size_t>(begin / step_), out_.size() - 1);
    for (;; ++k) {
      const double own_begin = static_cast<double>(k) * step_;
      const bool is_last = k + 1 == out_.size() || own_begin + step_ >= end;
      const double share = (is_last ? end : own_begin + step_) - std::max(begin, own_begin);
      out_[k].area += share * square;
      if (is_last) return;
    }
  }

  void place(const SubTriangle& shape, double begin, double end, std::size_t k, std::size_t k_end) {
    if (k == k_end) return;
    if (k_end - k == 1) return put(shape, k);
    const double middle = 0.5 * (begin + end);
    const std::size_t k_middle = std::clamp(from(middle), k, k_end);
    place(shape.half(false), begin, middle, k, k_middle);
    place(shape.half(true), middle, end, k_middle, k_end);
  }

  void put(const SubTriangle& shape, std::size_t k) {
    const std::uint64_t hash = splitmix64(seed_ + k);
    double a = static_cast<double>(to_unit(static_cast<std::uint32_t>(hash)));
    double b = static_cast<double>(to_unit(static_cast<std::uint32_t>(hash >> 32)));
    if (a + b > 1) {
      a = 1 - a;
      b = 1 - b;
    }
    const auto blend = [&](const auto& v) { return (1 - a - b) * v[0] + a * v[1] + b * v[2]; };
    SurfacePoint& point = out_[k];
    point.triangle = part_->triangle;
    point.uv = glm::vec2(blend(shape.uv));
    point.position = glm::vec3(blend(shape.corner));
    point.normal = glm::vec3(glm::normalize(shape.normal()));
    point.kind = parts_.kind_of(*part_);
  }

  const Parts& parts_;
  double step_;
  std::uint64_t seed_;
  std::span<SurfacePoint> out_;
  double walked_ = 0;
  const Part* part_ = nullptr;
};

}  // namespace

SurfacePatches::SurfacePatches(const Mesh& mesh, const SpacingField& field, double surfels)
    : mesh_(mesh), field_(field) {
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) cut(i, whole_triangle(mesh, i), 1);
  sort_along_curve();
  join(surfels);
}

SubTriangle SurfacePatches::shape_of(const Piece& piece) const {
  SubTriangle shape = whole_triangle(mesh_, piece.triangle);
  for (std::uint32_t bit = std::bit_floor(piece.path) >> 1; bit != 0; bit >>= 1) {
    shape = shape.half((piece.path & bit) != 0);
  }
  return shape;
}

double SurfacePatches::spacing_of(const SubTriangle& shape) const {
  // No corner is farther from the centre than two thirds of the longest edge.
  return field_.at(mesh_.origin + shape.centre(), 0.67 * shape.longest_edge());
}

void SurfacePatches::cut(std::uint32_t triangle, const SubTriangle& shape, std::uint32_t path) {
  const double area = shape.area();
  if (!(area > 0)) return;
  const double spacing = spacing_of(shape);
  const double widest = field_.varies() ? kVaryingPieceSpacings : kPieceSpacings;
  if (shape.longest_edge() <= widest * spacing || area <= kPieceWeight * spacing * spacing ||
      path >= kDeepest) {
    pieces_.push_back({triangle, path});
    return;
  }
  cut(triangle, shape.half(false), path << 1);
  cut(triangle, shape.half(true), path << 1 | 1u);
}

void SurfacePatches::sort_along_curve() {
  if (pieces_.empty()) return;
  Bounds bounds;
  for (const glm::vec3& p : mesh_.positions) bounds.add(glm::dvec3(p));
  const double widest = widest_side(bounds);
  std::vector<std::pair<std::uint64_t, Piece>> keyed;
  keyed.reserve(pieces_.size());
  for (const Piece& piece : pieces_) {
    keyed.emplace_back(place_on_curve(shape_of(piece).centre() - bounds.low, widest, 21), piece);
  }
  std::sort(keyed.begin(), keyed.end(), [](const auto& a, const auto& b) {
    if (a.first != b.first) return a.first < b.first;
    return std::pair(a.second.triangle, a.second.path) <
           std::pair(b.second.triangle, b.second.path);
  });
  std::transform(keyed.begin(), keyed.end(), pieces_.begin(),
                 [](const auto& k) { return k.second; });
}

void SurfacePatches::join(double surfels) {
  begins_ = {0};
  weights_ = {0};
  double sum = 0;
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    const SubTriangle shape = shape_of(pieces_[i]);
    const double spacing = spacing_of(shape);
    sum += shape.area() / (spacing * spacing);
    if (sum - weights_.back() < surfels && i + 1 < pieces_.size()) continue;
    begins_.push_back(i + 1);
    weights_.push_back(sum);
  }
  // No scrap at the end.
  const std::size_t last = size();
  if (last > 1 && weights_[last] - weights_[last - 1] < 0.5 * surfels) {
    begins_.erase(begins_.end() - 2);
    weights_.erase(weights_.end() - 2);
  }
}

std::uint64_t SurfacePatches::surfels_before(std::size_t patch) const {
  const double rounded = std::round(weights_[patch]);
  if (patch == 0) return 0;
  return static_cast<std::uint64_t>(std::max(1.0, rounded));
}

std::uint64_t SurfacePatches::surfels() const noexcept {
  return surfels_before(size());
}

SurfacePatch SurfacePatches::spread(std::size_t patch, unsigned points_per_surfel) const {
  Parts parts(mesh_);
  for (std::size_t i = begins_[patch]; i < begins_[patch + 1]; ++i) {
    const SubTriangle shape = shape_of(pieces_[i]);
    parts.add(pieces_[i].triangle, shape, spacing_of(shape));
  }
  SurfacePatch result;
  if (!(parts.weight() > 0)) return result;  // too little for a double
  result.first = surfels_before(patch);
  result.surfels = surfels_before(patch + 1) - result.first;
  result.area = parts.area();
  result.points.resize(result.surfels * points_per_surfel);
  parts.sort();
  Spread spread(parts, result.first * points_per_surfel, result.points);
  parts.visit_sorted([&](const Part& part) { spread.walk(part); });
  spread.finish();
  return result;
}

}  // namespace ptc
