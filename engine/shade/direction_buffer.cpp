#include "engine/shade/direction_buffer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <glm/geometric.hpp>

namespace ptc {
namespace {

constexpr float kEmpty = std::numeric_limits<float>::infinity();
constexpr float kPi = 3.14159265F;

/// Solid angle of the part of a cube face below and left of (u, v), up to a constant.
double corner_solid_angle(double u, double v) { return std::atan2(u * v, std::sqrt(u * u + v * v + 1)); }

/// Axes of a face: w points through it, u and v follow cyclically.
///   face 0 +x  1 -x  2 +y  3 -y  4 +z  5 -z
struct Axes {
  int w, u, v;
  float sign;
};
constexpr Axes axes_of(int face) {
  return {face / 2, (face / 2 + 1) % 3, (face / 2 + 2) % 3, face % 2 == 0 ? 1.0F : -1.0F};
}

/// The face that a direction goes through.
int face_of(const glm::vec3& d) {
  const glm::vec3 size = glm::abs(d);
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  return 2 * axis + (d[axis] < 0 ? 1 : 0);
}

/// A rotation far from every symmetry of the axes.
glm::mat3 tilted_frame() {
  const glm::vec3 z = glm::normalize(glm::vec3(0.36F, 0.48F, 0.8F));
  const glm::vec3 x = glm::normalize(glm::cross(glm::vec3(0.2F, 1.0F, 0.1F), z));
  return glm::transpose(glm::mat3(x, glm::cross(z, x), z));
}

}  // namespace

DirectionGrid::DirectionGrid(unsigned resolution, const std::function<glm::vec3(const glm::vec3&)>& sky)
    : resolution_(resolution), rotation_(tilted_frame()) {
  const double step = 2.0 / resolution;
  for (unsigned i = 0; i < resolution; ++i) centre_.push_back(static_cast<float>((i + 0.5) * step - 1));
  for (unsigned y = 0; y < resolution; ++y) {
    for (unsigned x = 0; x < resolution; ++x) {
      const double u = x * step - 1, v = y * step - 1;
      const double solid_angle = corner_solid_angle(u, v) - corner_solid_angle(u + step, v) -
                                 corner_solid_angle(u, v + step) + corner_solid_angle(u + step, v + step);
      const float length = std::sqrt(1 + centre_[x] * centre_[x] + centre_[y] * centre_[y]);
      length_.push_back(length);
      weight_.push_back(static_cast<float>(solid_angle) / length);
    }
  }
  if (!sky) return;
  const glm::mat3 to_world = glm::transpose(rotation_);
  const std::size_t plane = std::size_t{resolution} * resolution;
  sky_.resize(6 * 3 * plane);
  for (int face = 0; face < 6; ++face) {
    const Axes a = axes_of(face);
    for (std::size_t pixel = 0; pixel < plane; ++pixel) {
      // Four samples a pixel: maps are sharper than pixels.
      glm::vec3 sum(0);
      for (int sub = 0; sub < 4; ++sub) {
        const float shift = static_cast<float>(step) * 0.25F;
        glm::vec3 direction;
        direction[a.w] = a.sign;
        direction[a.u] = centre_[pixel % resolution] + (sub % 2 == 0 ? -shift : shift);
        direction[a.v] = centre_[pixel / resolution] + (sub / 2 == 0 ? -shift : shift);
        sum += sky(glm::normalize(to_world * direction));
      }
      for (int c = 0; c < 3; ++c) sky_[static_cast<std::size_t>(3 * face + c) * plane + pixel] = sum[c] * 0.25F;
    }
  }
}

DirectionBuffer::DirectionBuffer(const DirectionGrid& grid)
    : grid_(&grid), depth_(grid.pixels(), kEmpty), rgbe_(grid.pixels(), 0) {}

void DirectionBuffer::clear() noexcept {
  std::ranges::fill(depth_, kEmpty);
  std::ranges::fill(rgbe_, 0);
}

void DirectionBuffer::copy(const DirectionBuffer& other) noexcept {
  std::memcpy(depth_.data(), other.depth_.data(), depth_.size() * sizeof(float));
  std::memcpy(rgbe_.data(), other.rgbe_.data(), rgbe_.size() * sizeof(std::uint32_t));
}

FacePixels DirectionBuffer::face(int face) noexcept {
  const std::size_t first = static_cast<std::size_t>(face) * grid_->resolution_ * grid_->resolution_;
  return {depth_.data() + first,    rgbe_.data() + first,     grid_->centre_.data(),
          grid_->length_.data(), grid_->weight_.data(), static_cast<int>(grid_->resolution_)};
}

void DirectionBuffer::draw_footprint(const glm::vec3& to, float area, std::uint32_t rgbe) noexcept {
  const glm::vec3 d = grid_->rotation_ * to;
  const int face = face_of(d);
  const Axes a = axes_of(face);
  const float resolution = static_cast<float>(grid_->resolution_);
  const float half = resolution * 0.5F;
  const float inverse = 1 / std::abs(d[a.w]);
  const float depth = std::sqrt(glm::dot(d, d));
  // A patch of solid angle O covers O l^3 on the face plane, l = depth / |w|; side 2 s pixels.
  const float s = std::sqrt(area * depth * inverse) * inverse * resolution * 0.25F;
  const float x = std::clamp(d[a.u] * inverse * half + half, std::min(s, half), std::max(resolution - s, half));
  const float y = std::clamp(d[a.v] * inverse * half + half, std::min(s, half), std::max(resolution - s, half));
  const auto first = [&](float t) { return static_cast<int>(std::max(0.0F, t - s + 0.5F)); };
  const auto last = [&](float t) { return static_cast<int>(std::min(resolution, t + s + 0.5F)); };
  const int x0 = first(x), x1 = last(x), y0 = first(y), y1 = last(y);
  const FacePixels pixels = this->face(face);
  for (int j = y0; j < y1; ++j) {
    for (int i = j * pixels.resolution + x0; i < j * pixels.resolution + x1; ++i) {
      const bool nearer = depth < pixels.depth[i] || (depth == pixels.depth[i] && rgbe < pixels.rgbe[i]);
      if (!nearer) continue;
      pixels.depth[i] = depth;
      pixels.rgbe[i] = rgbe;
    }
  }
}

namespace {

/// Pixels [first, last) along one axis of a face that a disc can touch.
/// @param low, high  extent of the disc along the axis
/// @param near, far  extent along the face's axis, near above zero
void pixel_span(float low, float high, float near, float far, int resolution, int& first, int& last) {
  const float least = low < 0 ? low / near : low / far;
  const float most = high < 0 ? high / far : high / near;
  const float r = static_cast<float>(resolution);
  first = static_cast<int>(std::clamp((least + 1) * 0.5F * r - 0.5F, 0.0F, r));
  last = static_cast<int>(std::clamp((most + 1) * 0.5F * r + 1.5F, 0.0F, r));
}

/// The disc in the axes of a face; empty pixel range when it does not reach the face.
/// @param inside  set when it reaches no other face
FaceDisc disc_on_face(int face, const glm::vec3& to, const glm::vec3& normal, float radius, int resolution,
                      bool& inside) {
  const Axes a = axes_of(face);
  FaceDisc disc{.cw = to[a.w] * a.sign,
                .cu = to[a.u],
                .cv = to[a.v],
                .nw = normal[a.w] * a.sign,
                .nu = normal[a.u],
                .nv = normal[a.v],
                .radius = radius,
                .x1 = resolution,
                .y1 = resolution};
  const auto extent = [&](float n) { return radius * std::sqrt(std::max(0.0F, 1 - n * n)); };
  const float eu = extent(disc.nu), ev = extent(disc.nv), ew = extent(disc.nw);
  const float near = disc.cw - ew, far = disc.cw + ew;
  const bool misses = far <= 0 || disc.cu - eu > far || -(disc.cu + eu) > far || disc.cv - ev > far ||
                      -(disc.cv + ev) > far;
  inside = near > 0 && disc.cu + eu < near && disc.cu - eu > -near && disc.cv + ev < near && disc.cv - ev > -near;
  if (misses) {
    disc.x1 = disc.y1 = 0;
  } else if (near > 1e-3F * far) {
    pixel_span(disc.cu - eu, disc.cu + eu, near, far, resolution, disc.x0, disc.x1);
    pixel_span(disc.cv - ev, disc.cv + ev, near, far, resolution, disc.y0, disc.y1);
  }
  return disc;
}

}  // namespace

void DirectionBuffer::draw_disc(const glm::vec3& to, const glm::vec3& normal, float radius,
                                std::uint32_t rgbe, Sides sides) noexcept {
  const float height = glm::dot(to, normal);  // above zero: the back faces the receiver
  if (height >= 0) {
    if (sides == Sides::front || glm::dot(to, to) < 4 * radius * radius) return;
    rgbe = 0;
  }
  const glm::vec3 centre = grid_->rotation_ * to;
  const glm::vec3 n = grid_->rotation_ * normal;
  // The face that holds the centre first: most discs reach no other.
  const int middle = face_of(centre);
  bool inside = false;
  for (int i = 0; i < 6 && !inside; ++i) {
    const int face = (middle + i) % 6;
    FaceDisc disc = disc_on_face(face, centre, n, radius, static_cast<int>(grid_->resolution_), inside);
    disc.rgbe = rgbe;
    if (disc.x0 < disc.x1 && disc.y0 < disc.y1) draw_face_disc(this->face(face), disc);
  }
}

Shading DirectionBuffer::resolve(const glm::vec3& normal) noexcept {
  const glm::vec3 n = grid_->rotation_ * normal;
  const std::size_t plane = std::size_t{grid_->resolution_} * grid_->resolution_;
  FaceSums sums;
  glm::vec3 open(0);
  for (int face = 0; face < 6; ++face) {
    const Axes a = axes_of(face);
    const float nw = n[a.w] * a.sign, nu = n[a.u], nv = n[a.v];
    if (nw + std::abs(nu) + std::abs(nv) <= 0) continue;
    sums.open = {};
    const float* sky = grid_->sky_.empty() ? nullptr : grid_->sky_.data() + static_cast<std::size_t>(3 * face) * plane;
    sum_face(this->face(face), sky, nw, nu, nv, sums);
    open[a.w] += a.sign * sums.open[0];
    open[a.u] += sums.open[1];
    open[a.v] += sums.open[2];
  }
  Shading shading;
  shading.occlusion = sums.covered / sums.total;
  shading.irradiance = glm::vec3(sums.light[0], sums.light[1], sums.light[2]) * (kPi / sums.total);
  shading.sky = glm::vec3(sums.sky[0], sums.sky[1], sums.sky[2]) * (kPi / sums.total);
  const float length = std::sqrt(glm::dot(open, open));
  shading.bent_normal = length > 0 ? glm::transpose(grid_->rotation_) * (open / length) : normal;
  return shading;
}

}  // namespace ptc
