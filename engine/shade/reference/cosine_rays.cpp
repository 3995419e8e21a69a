#include "engine/shade/reference/cosine_rays.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include "engine/base/low_discrepancy.h"
#include "engine/base/numbers.h"

namespace ptc {
namespace {

/// Cells of the square along a Hilbert curve, on which any points that follow one another lie close
/// together.
///
///     .--.  .--.
///     |  |  |  |       Each quarter holds the curve again, turned so that the ends meet:
///     '  '--'  '       cell >> 2 is the cell of half the resolution.
///     .--.  .--.
///     '  |  |  '
constexpr unsigned kCurveBits = 6;  ///< of each coordinate of the finest cells
constexpr unsigned kCurveSide = 1U << kCurveBits;

constexpr std::array<std::uint16_t, std::size_t{kCurveSide} * kCurveSide> curve_cells() {
  std::array<std::uint16_t, std::size_t{kCurveSide} * kCurveSide> cells{};
  for (unsigned row = 0; row < kCurveSide; ++row) {
    for (unsigned column = 0; column < kCurveSide; ++column) {
      unsigned x = column, y = row, cell = 0;
      for (unsigned side = kCurveSide / 2; side > 0; side /= 2) {
        const bool right = (x & side) != 0, upper = (y & side) != 0;
        cell = cell * 4 + (right ? (upper ? 2 : 3) : (upper ? 1 : 0));
        // Turn what is in the quarter back to how the whole curve runs
        x &= side - 1;
        y &= side - 1;
        if (upper) continue;
        if (right) {
          x = side - 1 - x;
          y = side - 1 - y;
        }
        const unsigned turned = x;
        x = y;
        y = turned;
      }
      cells[std::size_t{row} * kCurveSide + column] = static_cast<std::uint16_t>(cell);
    }
  }
  return cells;
}

/// Cells of about one point each.
class Curve {
 public:
  explicit Curve(std::size_t points) {
    while (bits_ < 2 * kCurveBits && points >> (bits_ + 2) != 0) bits_ += 2;
  }

  [[nodiscard]] std::size_t count() const noexcept { return std::size_t{1} << bits_; }
  [[nodiscard]] std::size_t of(const glm::vec2& point) const noexcept {
    static constexpr auto kCells = curve_cells();
    const auto column = static_cast<std::size_t>(point.x * kCurveSide),
               row = static_cast<std::size_t>(point.y * kCurveSide);
    return kCells[row * kCurveSide + column] >> (2 * kCurveBits - bits_);
  }

 private:
  unsigned bits_ = 0;
};

}  // namespace

glm::vec2 concentric(const glm::vec2& point) {
  const float u = 2 * point.x - 1, v = 2 * point.y - 1;
  const bool wide = std::abs(u) > std::abs(v);
  const float sine = wide ? u : v;
  const float turn = sine == 0 ? 0 : kPi / 4 * (wide ? v : u) / sine;
  const float along = sine * std::cos(turn), across = sine * std::sin(turn);
  return wide ? glm::vec2(along, across) : glm::vec2(across, along);
}

void curve_points(std::size_t count, std::uint64_t seed, std::vector<glm::vec2>& points) {
  // Count the points of each cell
  const SquarePoints sequence(seed);
  const Curve curve(count);
  thread_local std::vector<glm::vec2> square;
  thread_local std::vector<std::uint32_t> begins;
  square.resize(count);
  begins.assign(curve.count() + 1, 0);
  for (std::size_t i = 0; i < count; ++i) {
    square[i] = sequence.square(static_cast<std::uint32_t>(i));
    ++begins[curve.of(square[i]) + 1];
  }
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  // Put them in order
  points.resize(count);
  for (const glm::vec2& point : square) points[begins[curve.of(point)]++] = point;
}

void cosine_directions(const glm::vec3& normal, std::size_t count, std::uint64_t seed,
                       std::vector<glm::vec3>& directions) {
  thread_local std::vector<glm::vec2> points;
  curve_points(count, seed, points);
  const glm::vec3 tangent = glm::normalize(
      glm::cross(normal, std::abs(normal.x) > 0.6F ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0)));
  const glm::vec3 bitangent = glm::cross(normal, tangent);
  directions.clear();
  for (const glm::vec2& point : points) {
    const glm::vec2 disc = concentric(point);
    directions.push_back(tangent * disc.x + bitangent * disc.y +
                         normal * std::sqrt(std::max(0.0F, 1 - glm::dot(disc, disc))));
  }
}

Shading sum_rays(const Receiver& receiver, std::span<const glm::vec3> directions,
                 std::span<const DiscHit> hits,
                 const std::function<glm::vec3(const glm::vec3&)>& sky_at) {
  unsigned covered = 0;
  glm::dvec3 light(0), sky(0), open(0);
  for (std::size_t i = 0; i < directions.size(); ++i) {
    if (hits[i].met()) {
      ++covered;
      light += hits[i].radiance;
    } else {
      open += directions[i];
      if (sky_at) sky += sky_at(directions[i]);
    }
  }
  // Turn the sums into means over the hemisphere, whose cosine-weighted measure is pi.
  const auto count = static_cast<double>(directions.size());
  Shading shading;
  shading.occlusion = static_cast<float>(covered / count);
  shading.irradiance = glm::vec3(light * (std::numbers::pi / count));
  shading.sky = glm::vec3(sky * (std::numbers::pi / count));
  const double length = glm::length(open);
  shading.bent_normal = length > 0 ? glm::vec3(open / length) : receiver.normal;
  return shading;
}

}  // namespace ptc
