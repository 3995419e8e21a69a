// The geometry of the direction cube, and buffers over it.
//
// A pixel of a face sees a rectangle of the plane w = 1. The solid angle of the part of the plane
// between the axes and a corner (u, v) is atan(u v / sqrt(u^2 + v^2 + 1)), so the exact solid angle
// of a pixel is a sum over its four corners with alternating signs:
//
//     v + step  -+-------+
//                |  px   |     S(u + step, v + step) - S(u, v + step)
//     v         ++-------+       - S(u + step, v)    + S(u, v)
//                u    u + step
//
// The weights of all pixels of the cube then add up to 4 pi but for rounding. A weight is stored
// divided by the length of (1, u, v), so that the product with n . (1, u, v), which is linear along
// a row, is solid angle times cosine.
#include "engine/shade/gather/direction_buffer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "engine/base/numbers.h"

namespace ptc {
namespace {

/// Returns the solid angle between the axes of a face's plane and the point (u, v), sr; negative
/// where one of the coordinates is.
double corner_solid_angle(double u, double v) {
  return std::atan2(u * v, std::sqrt(u * u + v * v + 1));
}

/// Returns a rotation far from every symmetry of the axes. Each further variant turns about a fixed
/// axis by the golden angle, whose multiples come near no quarter turn soon.
glm::mat3 tilted_frame(unsigned variant) {
  const glm::vec3 z = glm::normalize(glm::vec3(0.36F, 0.48F, 0.8F));
  const glm::vec3 x = glm::normalize(glm::cross(glm::vec3(0.2F, 1.0F, 0.1F), z));
  const glm::mat3 tilt = glm::transpose(glm::mat3(x, glm::cross(z, x), z));
  const float angle = 2.3999632F * static_cast<float>(variant);
  return tilt * glm::mat3_cast(glm::angleAxis(angle, glm::normalize(glm::vec3(0.5F, -0.7F, 0.4F))));
}

/// Returns the rows of each face that have a pixel above the horizon: axis . (1, u, v) + cone_sin
/// |(1, u, v)| > 0 for some u in [-1, 1]. The bound takes the longest (1, u, v) for all pixels.
FaceRows rows_over(const CubeGeometry& cube, const Horizon& horizon) {
  const glm::vec3 n = cube.rotation * horizon.axis;
  const float slack = horizon.cone_sin * 1.7320509F;  // the longest (1, u, v)
  FaceRows rows{};
  for (int face = 0; face < 6; ++face) {
    const CubeFace a(face);
    const float best = n[a.w] * a.sign + std::abs(n[a.u]) + slack;
    int first = 0, end = cube.resolution;
    while (first < end && best + n[a.v] * cube.centre[first] <= 0) ++first;
    while (first < end && best + n[a.v] * cube.centre[end - 1] <= 0) --end;
    rows.first[face] = first;
    rows.end[face] = end;
  }
  return rows;
}

}  // namespace

DirectionGrid::DirectionGrid(unsigned resolution,
                             const std::function<glm::vec3(const glm::vec3&)>& sky,
                             unsigned variant)
    : variant_(variant) {
  if (resolution == 0 || resolution > kMaxResolution || resolution % 16 != 0) {
    throw std::invalid_argument("DirectionGrid: the resolution must be 16, 32, 48 or 64");
  }
  // Compute the pixel centres; the lanes past the last one are NaN, which is inside no disc.
  const double step = 2.0 / resolution;
  for (unsigned i = 0; i < resolution; ++i)
    centre_.push_back(static_cast<float>((i + 0.5) * step - 1));
  centre_.resize(resolution + DiscQueue::kReadLanes, std::numeric_limits<float>::quiet_NaN());
  // Compute the weights of the pixels.
  for (unsigned y = 0; y < resolution; ++y) {
    for (unsigned x = 0; x < resolution; ++x) {
      const double u = x * step - 1, v = y * step - 1;
      const double solid_angle = corner_solid_angle(u, v) - corner_solid_angle(u + step, v) -
                                 corner_solid_angle(u, v + step) +
                                 corner_solid_angle(u + step, v + step);
      const float length = std::sqrt(1 + centre_[x] * centre_[x] + centre_[y] * centre_[y]);
      inverse_length_.push_back(1 / length);
      weight_.push_back(static_cast<float>(solid_angle) / length);
    }
  }
  // Compute the weights of the borders between neighbouring pixels.
  edge_u_.resize(weight_.size());
  edge_v_.resize(weight_.size());
  for (std::size_t at = 0; at < weight_.size(); ++at) {
    if ((at + 1) % resolution != 0) edge_u_[at] = 0.5F * (weight_[at] + weight_[at + 1]);
    if (at + resolution < weight_.size())
      edge_v_[at] = 0.5F * (weight_[at] + weight_[at + resolution]);
  }
  geometry_ = {.centre = centre_.data(),
               .inverse_length = inverse_length_.data(),
               .weight = weight_.data(),
               .edge_u = edge_u_.data(),
               .edge_v = edge_v_.data(),
               .resolution = static_cast<int>(resolution),
               .rotation = tilted_frame(variant)};
  // Sample the sky four times in each pixel, because maps are sharper than pixels.
  if (!sky) return;
  const glm::mat3 to_world = glm::transpose(geometry_.rotation);
  const std::size_t plane = std::size_t{resolution} * resolution;
  sky_.resize(6 * 3 * plane);
  for (int face = 0; face < 6; ++face) {
    const CubeFace a(face);
    for (std::size_t pixel = 0; pixel < plane; ++pixel) {
      glm::vec3 sum(0);
      for (int sub = 0; sub < 4; ++sub) {
        const float shift = static_cast<float>(step) * 0.25F;
        const glm::vec3 direction =
            a.direction(centre_[pixel % resolution] + (sub % 2 == 0 ? -shift : shift),
                        centre_[pixel / resolution] + (sub / 2 == 0 ? -shift : shift));
        sum += sky(glm::normalize(to_world * direction));
      }
      for (int c = 0; c < 3; ++c)
        sky_[static_cast<std::size_t>(3 * face + c) * plane + pixel] = sum[c] * 0.25F;
    }
  }
}

glm::vec3 DirectionGrid::sky(std::size_t pixel) const {
  const std::size_t plane = weight_.size();
  const float* at = sky_.data() + pixel / plane * 3 * plane + pixel % plane;
  return {at[0], at[plane], at[2 * plane]};
}

DirectionBuffer::DirectionBuffer(unsigned resolution, bool coloured)
    : nearness_(std::size_t{6} * resolution * resolution + std::size_t{4} * resolution, 0),
      rgbe_(coloured ? nearness_.size() : 0, 0) {}

void DirectionBuffer::clear() noexcept {
  std::ranges::fill(nearness_, 0.0F);
  std::ranges::fill(rgbe_, 0);
}

void DirectionBuffer::copy(const DirectionBuffer& other) noexcept {
  std::ranges::copy(other.nearness_, nearness_.begin());
  std::ranges::copy(other.rgbe_, rgbe_.begin());
}

void DirectionBuffer::draw(const DirectionGrid& grid, const DiscQueue& discs, Sides sides,
                           unsigned viewpoint, const Horizon& horizon) noexcept {
  draw_discs(grid.geometry_, {nearness_.data(), rgbe_.data()}, rows_over(grid.geometry_, horizon),
             discs, sides, viewpoint);
}

Shading DirectionBuffer::resolve(const DirectionGrid& grid, const glm::vec3& normal,
                                 std::span<const glm::vec3> offsets,
                                 const PixelWeights* weights) const noexcept {
  // Turn the normal and the offsets into the axes of the cube, and sum over its pixels.
  const glm::mat3& rotation = grid.geometry_.rotation;
  ViewOffsets turned{};
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    const glm::vec3 offset = rotation * offsets[i];
    for (int k = 0; k < 3; ++k) turned.axis[k][i] = offset[k];
  }
  PixelSums sums;
  sum_pixels(grid.geometry_, {nearness_.data(), rgbe_.data()},
             grid.sky_.empty() ? nullptr : grid.sky_.data(), rotation * normal,
             offsets.empty() ? nullptr : &turned, weights, sums);
  // Divide by the sum of all weights instead of pi, so that an empty cube gives exactly 0.
  Shading shading;
  // Borders of pixels that move can leave a little less than nothing
  shading.occlusion = std::clamp(sums.covered / sums.total, 0.0F, 1.0F);
  shading.irradiance = glm::max(glm::vec3(0), sums.light * (kPi / sums.total));
  shading.sky = glm::max(glm::vec3(0), sums.sky * (kPi / sums.total));
  const float length = glm::length(sums.open);
  shading.bent_normal = length > 0 ? glm::transpose(rotation) * (sums.open / length) : normal;
  return shading;
}

}  // namespace ptc
