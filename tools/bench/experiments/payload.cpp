// Each payload is a pair of functions: fit() makes numbers of a node's surfels, see() evaluates
// them towards a viewer. What they approximate is, over a node's surfels of area A_i, normal n_i
// and radiance L_i, seen from the unit direction w:
//
//   front(w)    = sum A_i max(0, n_i . w)          projected area of the surfels that face w
//   back(w)     = sum A_i max(0, -n_i . w)         projected area of the others
//   radiance(w) = sum A_i max(0, n_i . w) L_i / front(w)
#include "tools/bench/experiments/payload.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <glm/geometric.hpp>

#include "format/scalar.h"

namespace ptc::bench {
namespace {

float area_of(const Surfel& s) {
  return 2 * s.radius * s.radius;
}

glm::vec3 vector_at(const float* p) {
  return {p[0], p[1], p[2]};
}

void put(float* p, const glm::vec3& v) {
  for (int k = 0; k < 3; ++k) p[k] = v[k];
}

// Payload "surfel". Numbers: area, unit normal, radiance.

constexpr std::size_t kSurfelCount = 7;

/// Makes one surfel of some: sums of area, means of normal and radiance weighted by area.
void fit_one(std::span<const Surfel> some, float* out) {
  float area = 0;
  glm::vec3 normal(0), light(0);
  for (const Surfel& s : some) {
    area += area_of(s);
    normal += area_of(s) * s.normal;
    light += area_of(s) * s.radiance;
  }
  const float length = glm::length(normal);
  out[0] = area;
  put(out + 1, length > 0 ? normal / length : glm::vec3(0, 0, 1));
  put(out + 4, area > 0 ? light / area : glm::vec3(0));
}

void fit_surfel(const NodeSummary&, std::span<const Surfel> below, float* out) {
  fit_one(below, out);
}

Seen see_surfel(const float* p, const glm::vec3& toward) {
  const float along = p[0] * glm::dot(vector_at(p + 1), toward);
  return {
      .front = std::max(0.0F, along), .back = std::max(0.0F, -along), .radiance = vector_at(p + 4)};
}

// Payload "two lobes". Numbers: two surfels, each of which stands for the surfels whose normals are
// nearest to its own (Lloyd 1982).

void fit_lobes(const NodeSummary&, std::span<const Surfel> below, float* out) {
  // Begin at the normal farthest from the mean, and the one farthest from that
  std::array<glm::vec3, 2> axis{};
  glm::vec3 mean(0);
  for (const Surfel& s : below) mean += area_of(s) * s.normal;
  const auto farthest = [&](const glm::vec3& from) {
    return std::ranges::min_element(below, {},
                                    [&](const Surfel& s) { return glm::dot(s.normal, from); })
        ->normal;
  };
  axis[0] = farthest(mean);
  axis[1] = farthest(axis[0]);
  // Assign surfels to the nearer axis, and take the means as new axes
  std::array<std::vector<Surfel>, 2> parts;
  for (int round = 0; round < 4; ++round) {
    for (auto& part : parts) part.clear();
    for (const Surfel& s : below) {
      parts[glm::dot(s.normal, axis[0]) < glm::dot(s.normal, axis[1]) ? 1 : 0].push_back(s);
    }
    for (std::size_t i = 0; i < 2; ++i) {
      fit_one(parts[i], out + i * kSurfelCount);
      axis[i] = vector_at(out + i * kSurfelCount + 1);
    }
  }
}

Seen see_lobes(const float* p, const glm::vec3& toward) {
  const Seen a = see_surfel(p, toward), b = see_surfel(p + kSurfelCount, toward);
  const float front = a.front + b.front;
  return {
      .front = front,
      .back = a.back + b.back,
      .radiance = front > 0 ? (a.front * a.radiance + b.front * b.radiance) / front : glm::vec3(0)};
}

// Payload "vector". A sum of normals says how much faces one way; the rest is taken to face every
// way equally. Numbers: area; sum of area times normal; then for red, green and blue the sum of
// area times radiance, and the sum of area times radiance times normal. All but the first are
// divided by the area.

constexpr std::size_t kVectorCount = 16;

void fit_vector(const NodeSummary&, std::span<const Surfel> below, float* out) {
  std::fill_n(out, kVectorCount, 0.0F);
  float area = 0;
  for (const Surfel& s : below) {
    area += area_of(s);
    put(out + 1, vector_at(out + 1) + area_of(s) * s.normal);
    for (int c = 0; c < 3; ++c) {
      float* const light = out + 4 + 4 * c;
      light[0] += area_of(s) * s.radiance[c];
      put(light + 1, vector_at(light + 1) + area_of(s) * s.radiance[c] * s.normal);
    }
  }
  out[0] = area;
  for (std::size_t i = 1; i < kVectorCount && area > 0; ++i) out[i] /= area;
}

/// The share that faces a direction: the cosine of the vector where it is above 0, and a quarter of
/// the rest.
float facing(float sum, const glm::vec3& vector, const glm::vec3& toward) {
  return std::max(0.0F, glm::dot(vector, toward)) + std::max(0.0F, sum - glm::length(vector)) / 4;
}

Seen see_vector(const float* p, const glm::vec3& toward) {
  const float front = facing(1, vector_at(p + 1), toward);
  Seen seen{.front = p[0] * front, .back = p[0] * facing(1, vector_at(p + 1), -toward)};
  for (int c = 0; c < 3 && front > 0; ++c) {
    seen.radiance[c] = facing(p[4 + 4 * c], vector_at(p + 5 + 4 * c), toward) / front;
  }
  return seen;
}

// Payload "cube", the ambient cube of spec/nodes.md. Numbers: area, shares of it that face each of
// six axes, radiance towards each axis. Areas are sums over the faces, colours are ratios of two
// such sums (spec/shading.md#splats).

void fit_cube(const NodeSummary& node, std::span<const Surfel>, float* out) {
  out[0] = static_cast<float>(node.area);
  for (std::size_t k = 0; k < 6; ++k) {
    out[1 + k] = node.area > 0 ? static_cast<float>(node.facing[k] / node.area) : 0;
    for (std::size_t c = 0; c < 3; ++c) {
      out[7 + 3 * k + c] =
          node.facing[k] > 0 ? static_cast<float>(node.flux[k][c] / node.facing[k]) : 0;
    }
  }
}

Seen see_cube(const float* p, const glm::vec3& toward) {
  Seen seen;
  float sum = 0, behind = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const int face = 2 * axis + (toward[axis] < 0 ? 1 : 0);
    const float weight = std::abs(toward[axis]) * p[1 + face];
    seen.radiance += weight * vector_at(p + 7 + 3 * face);
    sum += weight;
    behind += std::abs(toward[axis]) * p[1 + (face ^ 1)];
  }
  seen.front = p[0] * sum;
  seen.back = p[0] * behind;
  seen.radiance = sum > 0 ? seen.radiance / sum : glm::vec3(0);
  return seen;
}

// Payloads "SH n": spherical harmonics, up to degree n, of the projected area and of the projected
// area times radiance. Numbers: area; then coefficients divided by it: of the area from degree 1
// on, then of red, green and blue from degree 0 on.

/// The clamped cosine by degrees: max(0, cos) = 1/4 P_0 + 1/2 P_1 + 5/16 P_2 - 3/32 P_4 + ... These
/// are the coefficients of Ramamoorthi and Hanrahan 2001 divided by pi.
constexpr std::array kClampedCosine{0.25F, 0.5F, 0.3125F, 0.0F, -0.09375F};

constexpr std::size_t square(std::size_t n) {
  return n * n;
}

template <std::size_t kDegree>
void fit_harmonics(const NodeSummary&, std::span<const Surfel> below, float* out) {
  constexpr std::size_t n = square(kDegree + 1);
  std::array<float, n> basis;
  std::fill_n(out, 4 * n, 0.0F);
  for (const Surfel& s : below) {
    spherical_harmonics(kDegree, s.normal, basis.data());
    const glm::vec3 light = area_of(s) * s.radiance;
    const std::array<float, 4> weights{area_of(s), light.r, light.g, light.b};
    for (std::size_t channel = 0; channel < 4; ++channel) {
      for (std::size_t i = 0; i < n; ++i) out[n * channel + i] += weights[channel] * basis[i];
    }
  }
  const float area = out[0];
  for (std::size_t channel = 0; channel < 4 && area > 0; ++channel) {
    for (std::size_t l = 0; l <= kDegree; ++l) {
      for (std::size_t i = square(l); i < square(l + 1); ++i)
        out[n * channel + i] *= kClampedCosine[l] / area;
    }
  }
  out[0] = area;  // the coefficient of degree 0 of the area is known, so its place holds the area
}

template <std::size_t kDegree>
Seen see_harmonics(const float* p, const glm::vec3& toward) {
  constexpr std::size_t n = square(kDegree + 1);
  std::array<float, n> basis;
  spherical_harmonics(kDegree, toward, basis.data());
  // Sum even degrees, which are equal seen from behind, and odd degrees, which change their sign
  float even = kClampedCosine[0], odd = 0;
  for (std::size_t l = 1; l <= kDegree; ++l) {
    float& sum = l % 2 == 0 ? even : odd;
    for (std::size_t i = square(l); i < square(l + 1); ++i) sum += p[i] * basis[i];
  }
  Seen seen{.front = p[0] * std::max(0.0F, even + odd), .back = p[0] * std::max(0.0F, even - odd)};
  // Divide the light by the area, unless that is only the ripple of the truncated series
  constexpr float kMin = 1e-3F;
  if (even + odd <= kMin) return seen;
  for (int c = 0; c < 3; ++c) {
    const float* const light = p + n * static_cast<std::size_t>(c + 1);
    float sum = 0;
    for (std::size_t i = 0; i < n; ++i) sum += light[i] * basis[i];
    seen.radiance[c] = std::max(0.0F, sum) / (even + odd);
  }
  return seen;
}

/// Payload::fields of an area and this many halves.
std::string halves(std::size_t count) {
  std::string fields(count + 1, 'h');
  fields.front() = 'u';
  return fields;
}

template <std::size_t kDegree>
Payload harmonics(const char* name) {
  return {name, halves(4 * square(kDegree + 1) - 1), fit_harmonics<kDegree>,
          see_harmonics<kDegree>};
}

std::size_t numbers_of(char field) {
  return field == 'o' || field == 'c' ? 3 : 1;
}

}  // namespace

std::size_t Payload::count() const {
  std::size_t sum = 0;
  for (const char field : fields) sum += numbers_of(field);
  return sum;
}

std::size_t Payload::stored_bytes() const {
  return 2 * fields.size() + 2 * static_cast<std::size_t>(std::ranges::count(fields, 'c'));
}

void Payload::round(float* p) const {
  for (const char field : fields) {
    std::array<float, 3> three{};
    std::copy_n(p, numbers_of(field), three.begin());
    switch (field) {
      case 'u':
        *p = decode_ufloat16(encode_ufloat16(*p));
        break;
      case 'h':
        *p = decode_half(encode_half(*p));
        break;
      case 'n':
        *p = std::round(std::clamp(*p, 0.0F, 1.0F) * 65535) / 65535;
        break;
      case 'o':
        std::ranges::copy(decode_octahedral8(encode_octahedral8(three)), p);
        break;
      default:
        std::ranges::copy(decode_rgbe(encode_rgbe(three)), p);
        break;
    }
    p += numbers_of(field);
  }
}

const std::vector<Payload>& payloads() {
  static const std::vector<Payload> all{
      {"surfel", "uoc", fit_surfel, see_surfel},
      {"two lobes", "uocuoc", fit_lobes, see_lobes},
      {"vector", halves(kVectorCount - 1), fit_vector, see_vector},
      {"cube", "unnnnnncccccc", fit_cube, see_cube},
      harmonics<0>("SH 0"),
      harmonics<1>("SH 1"),
      harmonics<2>("SH 2"),
      harmonics<4>("SH 4")};
  return all;
}

Seen see_exactly(std::span<const Surfel> below, const glm::vec3& toward) {
  Seen seen;
  for (const Surfel& s : below) {
    const float along = area_of(s) * glm::dot(s.normal, toward);
    if (along > 0) seen.radiance += along * s.radiance;
    (along > 0 ? seen.front : seen.back) += std::abs(along);
  }
  if (seen.front > 0) seen.radiance /= seen.front;
  return seen;
}

void spherical_harmonics(std::size_t degree, const glm::vec3& unit, float* out) {
  constexpr std::size_t kMax = 4;
  using Square = std::array<std::array<float, kMax + 1>, kMax + 1>;
  // Scale P_lm by sqrt(2 (l - m)! / (l + m)!), or by 1 where m is 0
  static const Square scale = [] {
    Square s{};
    for (std::size_t l = 0; l <= kMax; ++l) {
      for (std::size_t m = 0; m <= l; ++m) {
        const double ratio = std::tgamma(l - m + 1) / std::tgamma(l + m + 1);
        s[l][m] = static_cast<float>(std::sqrt(m > 0 ? 2 * ratio : ratio));
      }
    }
    return s;
  }();
  // Step m: cosine and sine are the parts of (x + i y)^m, diagonal is P_mm over the sine^m of z
  float cosine = 1, sine = 0, diagonal = 1;
  for (std::size_t m = 0; m <= degree; ++m) {
    float before = 0, legendre = diagonal;  // P_(l-1)m and P_lm, by recurrence in l
    for (std::size_t l = m; l <= degree; ++l) {
      out[l * l + l + m] = scale[l][m] * legendre * cosine;
      if (m > 0) out[l * l + l - m] = scale[l][m] * legendre * sine;
      const float next =
          (static_cast<float>(2 * l + 1) * unit.z * legendre - static_cast<float>(l + m) * before) /
          static_cast<float>(l - m + 1);
      before = std::exchange(legendre, next);
    }
    diagonal *= static_cast<float>(2 * m + 1);
    const float turned = cosine * unit.x - sine * unit.y;
    sine = cosine * unit.y + sine * unit.x;
    cosine = turned;
  }
}

}  // namespace ptc::bench
