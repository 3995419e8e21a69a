#include "tools/bench/chart/colour.h"

#include <cmath>

#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

namespace ptc {
namespace {

// The XYZ of a chromaticity (x, y) at luminance Y = 1.
glm::dvec3 xyz_of_chromaticity(double x, double y) {
  return {x / y, 1, (1 - x - y) / y};
}

// The matrices between linear RGB and XYZ relative to white.
struct Srgb {
  glm::dvec3 white = xyz_of_chromaticity(0.3127, 0.3290);
  glm::mat3 relative_xyz_of_rgb;  ///< XYZ over that of white
  glm::mat3 rgb_of_relative_xyz;
};

// The primaries are scaled so that equal parts of them make the white. Source: IEC 61966-2-1:1999.
Srgb make_srgb() {
  Srgb result;
  const glm::dmat3 primaries(xyz_of_chromaticity(0.64, 0.33), xyz_of_chromaticity(0.30, 0.60),
                             xyz_of_chromaticity(0.15, 0.06));
  const glm::dvec3 share = glm::inverse(primaries) * result.white;
  glm::dmat3 relative;
  for (int c = 0; c < 3; ++c) relative[c] = primaries[c] * share[c] / result.white;
  result.relative_xyz_of_rgb = glm::mat3(relative);
  result.rgb_of_relative_xyz = glm::mat3(glm::inverse(relative));
  return result;
}

const Srgb& srgb() {
  static const Srgb space = make_srgb();
  return space;
}

// Cube root with a straight piece near 0. Source: CIE 15:2004, 8.2.1.1.
float lightness_curve(float t) {
  constexpr float kDelta = 6.0F / 29;
  return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3 * kDelta * kDelta) + 4.0F / 29;
}

}  // namespace

glm::vec3 ycxcz_of_rgb(const glm::vec3& rgb) noexcept {
  const glm::vec3 t = srgb().relative_xyz_of_rgb * rgb;
  return {116 * t.y - 16, 500 * (t.x - t.y), 200 * (t.y - t.z)};
}

glm::vec3 rgb_of_ycxcz(const glm::vec3& ycxcz) noexcept {
  const float y = (ycxcz.x + 16) / 116;
  return srgb().rgb_of_relative_xyz * glm::vec3(y + ycxcz.y / 500, y, y - ycxcz.z / 200);
}

glm::vec3 hunt_lab_of_rgb(const glm::vec3& rgb) noexcept {
  const glm::vec3 t = srgb().relative_xyz_of_rgb * rgb;
  const float y = lightness_curve(t.y);
  const float lightness = 116 * y - 16;
  const float scale = lightness / 100;
  return {lightness, scale * 500 * (lightness_curve(t.x) - y),
          scale * 200 * (y - lightness_curve(t.z))};
}

float hyab(const glm::vec3& a, const glm::vec3& b) noexcept {
  const glm::vec3 d = a - b;
  return std::abs(d.x) + std::sqrt(d.y * d.y + d.z * d.z);
}

}  // namespace ptc
