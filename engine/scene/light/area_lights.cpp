// Chooses emissive triangles, and places on them, for the shadow rays of one point.
//
// Three steps, each of which brings the density closer to the light that really arrives:
//
//     all emitters --(1)--> candidates --(2)--> one emitter --(3)--> a place on it
//
// (1) Of more than 64 emitters, each sample draws neighbours by a tree (EmitterTree), several times
//     where there are few samples.
// (2) A candidate is chosen in proportion to w = e / (n p), where e estimates the light that it may
//     give to this point, p is the probability of its draw, and n the number of draws. The sum of
//     all w estimates the sum of e over all emitters, so that (sum of w) / e corrects for the
//     choice: resampled importance sampling (Talbot, Cline and Egbert 2005). With all emitters as
//     candidates, w = e.
// (3) The place is uniform in the solid angle that the triangle subtends at the point (Arvo 1995),
//     where an emitter that is close or large would otherwise flicker:
//
//           b
//          / \        Unit directions a, b, c from the point x to the corners span a triangle on
//         /   \       the unit sphere around x, whose area is the solid angle:
//        a-----c          tan(area / 2) = |a . (b x c)| / (1 + a.b + b.c + c.a)
//         \   /       (Van Oosterom and Strackee 1983)
//          \ /
//           x
#include "engine/scene/light/area_lights.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/numbers.h"

namespace ptc {
namespace {

constexpr std::size_t kFew = 64;      // emitters that are all candidates
constexpr unsigned kLeastDraws = 16;  // from the tree, over all samples of a point

// An emitter as seen from a point.
struct View {
  std::array<glm::dvec3, 3> corner;     // relative to the point
  std::array<glm::dvec3, 3> direction;  // unit, towards the corners
  glm::dvec3 normal;                    // unit, of the emitting side
  double area = 0;                      // scene units squared
  double solid_angle = 0;               // steradians
};

// Returns the solid angle of a triangle, steradians, from unit directions to its corners.
// Source: Van Oosterom and Strackee 1983, The solid angle of a plane triangle.
double solid_angle(const std::array<glm::dvec3, 3>& d) {
  const double volume = std::abs(glm::dot(d[0], glm::cross(d[1], d[2])));
  const double base = 1 + glm::dot(d[0], d[1]) + glm::dot(d[1], d[2]) + glm::dot(d[2], d[0]);
  return 2 * std::atan2(volume, base);
}

// Fills the view of an emitter from a point.
// @return  false when no light goes from the emitter's front to the point: the point lies behind
//          it, or in its plane
bool look_at(const Emitter& emitter, const glm::vec3& position, View& view) {
  const glm::dvec3 eye(position);
  for (std::size_t i = 0; i < 3; ++i) view.corner[i] = glm::dvec3(emitter.corner[i]) - eye;
  const glm::dvec3 twice =
      glm::cross(view.corner[1] - view.corner[0], view.corner[2] - view.corner[0]);
  const double length = glm::length(twice);
  if (!(length > 0) || !(glm::dot(twice, view.corner[0]) < 0)) return false;
  view.normal = twice / length;
  view.area = 0.5 * length;
  for (std::size_t i = 0; i < 3; ++i) {
    const double distance = glm::length(view.corner[i]);
    if (!(distance > 0)) return false;
    view.direction[i] = view.corner[i] / distance;
  }
  view.solid_angle = solid_angle(view.direction);
  return view.solid_angle > 0;
}

// Estimates the light that an emitter may give to a point: brightness times solid angle times the
// greatest cosine among its corners and its middle, at least 0.05. It is positive exactly where the
// emitter may give light, which makes the choice by it unbiased.
double expected_light(const Emitter& emitter, const glm::vec3& position, const glm::vec3& normal) {
  View view;
  if (!look_at(emitter, position, view)) return 0;
  const glm::dvec3 n(normal);
  double best = 0;  // a triangle reaches above the horizon where one of its corners does
  for (const glm::dvec3& d : view.direction) best = std::max(best, glm::dot(n, d));
  if (best <= 0) return 0;
  const glm::dvec3 middle = view.corner[0] + view.corner[1] + view.corner[2];
  best = std::max({best, 0.05, glm::dot(n, middle) / std::max(glm::length(middle), 1e-300)});
  return brightness(emitter.radiance) * view.solid_angle * best;
}

// Returns the unit vector along the part of v that is square to a unit axis.
glm::dvec3 square_to(const glm::dvec3& v, const glm::dvec3& axis) {
  return glm::normalize(v - glm::dot(v, axis) * axis);
}

// Turns a uniform point of the unit square into a direction that is uniform in the spherical
// triangle of three unit directions a, b, c.
//
// The first coordinate chooses a point c' on the arc from a to c, so that the triangle a b c' has
// that share of the area; the second one chooses a direction on the arc from b to c', uniform in
// its cosine to b.
// Source: Arvo 1995, Stratified sampling of spherical triangles.
glm::dvec3 sample_solid_angle(const std::array<glm::dvec3, 3>& d, const glm::vec2& square) {
  // Find the angles of the triangle, and from them its area, the spherical excess.
  const glm::dvec3 ab = glm::normalize(glm::cross(d[0], d[1]));
  const glm::dvec3 bc = glm::normalize(glm::cross(d[1], d[2]));
  const glm::dvec3 ca = glm::normalize(glm::cross(d[2], d[0]));
  const auto angle = [](const glm::dvec3& a, const glm::dvec3& b) {
    return std::acos(std::clamp(-glm::dot(a, b), -1.0, 1.0));
  };
  const double alpha = angle(ab, ca);
  const double excess = alpha + angle(bc, ab) + angle(ca, bc) - kPiDouble;
  // Find the point c' whose triangle has the wanted part of the area; q is the cosine from a to it.
  const double part = static_cast<double>(square.x) * excess;
  const double s = std::sin(part - alpha);
  const double t = std::cos(part - alpha);
  const double u = t - std::cos(alpha);
  const double v = s + std::sin(alpha) * glm::dot(d[0], d[1]);
  const double q = std::clamp(
      ((v * t - u * s) * std::cos(alpha) - v) / ((v * s + u * t) * std::sin(alpha)), -1.0, 1.0);
  const glm::dvec3 c = q * d[0] + std::sqrt(1 - q * q) * square_to(d[2], d[0]);
  // Go along the arc from b to c'.
  const double z = 1 - static_cast<double>(square.y) * (1 - glm::dot(c, d[1]));
  return z * d[1] + std::sqrt(std::max(0.0, 1 - z * z)) * square_to(c, d[1]);
}

// Turns a uniform point of the unit square into a place that is uniform in the area of a triangle.
glm::dvec3 sample_area(const std::array<glm::dvec3, 3>& corner, const glm::vec2& square) {
  const double root = std::sqrt(static_cast<double>(square.x));
  const double v = root * static_cast<double>(square.y);
  return (1 - root) * corner[0] + (root - v) * corner[1] + v * corner[2];
}

// A place on an emitter.
struct Place {
  glm::dvec3 offset{0};  // from the point that receives the light
  double weight = 0;     // cosine at the receiver times the solid angle that the place stands for
};

Place sample_place(const View& view, const glm::dvec3& normal, const glm::vec2& square) {
  // Sample by solid angle, except of small triangles, where that differs little from sampling by
  // area, and the spherical excess loses its digits.
  constexpr double kSmall = 1e-3;  // steradians
  if (view.solid_angle > kSmall) {
    const glm::dvec3 d = sample_solid_angle(view.direction, square);
    const double slope = glm::dot(d, view.normal);
    const double distance = glm::dot(view.corner[0], view.normal) / slope;
    if (slope < 0 && std::isfinite(distance)) {
      return {d * distance, std::max(0.0, glm::dot(normal, d)) * view.solid_angle};
    }
  }
  // Sample by area: the place stands for area times cosine over distance squared.
  const glm::dvec3 offset = sample_area(view.corner, square);
  const double distance = glm::length(offset);
  if (!(distance > 0)) return {};
  const glm::dvec3 d = offset / distance;
  return {offset, std::max(0.0, glm::dot(normal, d)) * std::max(0.0, -glm::dot(view.normal, d)) *
                      view.area / (distance * distance)};
}

}  // namespace

AreaLights::AreaLights(std::vector<Emitter> emitters) : emitters_(std::move(emitters)) {
  std::erase_if(emitters_, [](const Emitter& emitter) {
    const double power = power_of(emitter);
    return !(power > 0) || !std::isfinite(power);
  });
  if (emitters_.size() > kFew) tree_ = EmitterTree(emitters_);
}

void AreaLights::choose_from(std::uint32_t first, std::uint32_t end, double weight,
                             const glm::vec3& position, const glm::vec3& normal,
                             std::vector<Choice>& out) const {
  double sum = out.empty() ? 0 : out.back().sum;
  for (std::uint32_t i = first; i < end; ++i) {
    const double expected = expected_light(emitters_[i], position, normal);
    if (!(expected > 0)) continue;
    sum += weight * expected;
    out.push_back({i, expected, sum});
  }
}

double AreaLights::choose_by_tree(const glm::vec3& position, const glm::vec3& normal,
                                  const SquarePoints& points, std::uint32_t first, unsigned draws,
                                  std::vector<Choice>& out) const {
  double rest = 0;
  for (std::uint32_t i = 0; i < draws; ++i) {
    const EmitterTree::Drawn drawn = tree_.draw(position, normal, points.line(first + i));
    choose_from(drawn.first, drawn.end, 1 / (draws * drawn.chance), position, normal, out);
    rest = drawn.rest;
  }
  return rest;
}

void AreaLights::sample(const glm::vec3& position, const glm::vec3& normal, unsigned count,
                        std::uint64_t seed, std::uint32_t first,
                        std::vector<EmitterSample>& out) const {
  out.clear();
  thread_local std::vector<Choice> choices;
  choices.clear();
  const bool few = emitters_.size() <= kFew;
  if (few) {
    choose_from(0, static_cast<std::uint32_t>(emitters_.size()), 1, position, normal, choices);
    if (choices.empty()) return;
  }
  // What several draws leave depends on all of them, because their numbers are spread together
  const SquarePoints points(seed), choosing(seed ^ 1);
  const unsigned draws = std::max(1U, kLeastDraws / std::max(1U, count));
  for (std::uint32_t i = 0; i < count; ++i) {
    // Choose an emitter by its weight
    double unit = few ? points.line(first + i) : 0;
    if (!few) {
      choices.clear();
      unit = choose_by_tree(position, normal, points, (first + i) * draws, draws, choices);
      if (choices.empty()) continue;
      if (draws > 1) unit = choosing.line(first + i);
    }
    const double total = choices.back().sum;
    const auto chosen = std::min(
        std::upper_bound(choices.begin(), choices.end(), unit * total,
                         [](double value, const Choice& choice) { return value < choice.sum; }),
        choices.end() - 1);
    // Choose a place on it
    const Emitter& emitter = emitters_[chosen->emitter];
    View view;
    if (!look_at(emitter, position, view)) continue;
    const Place place = sample_place(view, glm::dvec3(normal), points.square(first + i));
    if (!(place.weight > 0)) continue;
    const double scale = place.weight / chosen->expected * total / count;
    out.push_back({position + glm::vec3(place.offset), glm::vec3(view.normal),
                   emitter.radiance * static_cast<float>(scale)});
  }
}

}  // namespace ptc
