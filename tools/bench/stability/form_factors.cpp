#include "tools/bench/stability/form_factors.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <glm/geometric.hpp>

namespace ptc::bench {

double form_factor(const Receiver& receiver, std::span<const glm::dvec3> corners) {
  // Corners as seen from the receiver, cut at its horizon
  const glm::dvec3 normal(receiver.normal);
  std::vector<glm::dvec3> seen;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const glm::dvec3 a = corners[i] - receiver.position;
    const glm::dvec3 b = corners[(i + 1) % corners.size()] - receiver.position;
    const double up_a = glm::dot(a, normal), up_b = glm::dot(b, normal);
    if (up_a >= 0) seen.push_back(a);
    if ((up_a < 0) != (up_b < 0)) seen.push_back(a + (b - a) * (up_a / (up_a - up_b)));
  }
  // Each edge adds its angle times the cosine of the plane through it and the receiver
  double sum = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const glm::dvec3 a = seen[i], b = seen[(i + 1) % seen.size()];
    const glm::dvec3 across = glm::cross(a, b);
    const double length = glm::length(across);
    if (length > 0) sum -= std::atan2(length, glm::dot(a, b)) * glm::dot(across, normal) / length;
  }
  return std::max(0.0, sum / (2 * std::numbers::pi));
}

double disc_form_factor(double height, double aside, double radius) {
  if (aside == 0) return radius * radius / (height * height + radius * radius);
  const double h = height / aside, r = radius / aside, z = 1 + h * h + r * r;
  return 0.5 * (1 - (1 + h * h - r * r) / std::sqrt(z * z - 4 * r * r));
}

}  // namespace ptc::bench
