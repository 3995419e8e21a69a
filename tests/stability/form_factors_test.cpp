// The formulas beside one another, and beside sums over small pieces.
#include "tools/bench/stability/form_factors.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

using namespace ptc;
using namespace ptc::bench;

namespace {

/// A disc as a polygon of many corners whose front looks down.
std::vector<glm::dvec3> round(double height, double aside, double radius) {
  std::vector<glm::dvec3> corners;
  constexpr int kCorners = 20'000;
  for (int i = 0; i < kCorners; ++i) {
    const double turn = -2 * std::numbers::pi * i / kCorners;
    corners.emplace_back(aside + radius * std::cos(turn), radius * std::sin(turn), height);
  }
  return corners;
}

}  // namespace

TEST_CASE("form factors: a disc is a polygon of many corners", "[stability]") {
  const Receiver receiver{{0, 0, 0}, {0, 0, 1}};
  for (const double height : {0.01, 0.3, 2.0}) {
    for (const double aside : {0.0, 0.4, 1.1, 3.0}) {
      CAPTURE(height, aside);
      CHECK(disc_form_factor(height, aside, 0.9) ==
            Approx(form_factor(receiver, round(height, aside, 0.9))).margin(1e-6));
    }
  }
}

TEST_CASE("form factors: what a polygon covers is the sum over small pieces of it", "[stability]") {
  // A square that reaches below the horizon of a receiver that leans
  const Receiver receiver{{0.1, -0.2, 0}, glm::normalize(glm::vec3(0.5F, 0.3F, 0.6F))};
  const glm::dvec3 corner(-1, -1.5, 1), u(0, 2, 0.5), v(2.5, 0, -0.8);
  const glm::dvec3 front = glm::cross(u, v);
  const std::vector<glm::dvec3> square{corner, corner + u, corner + u + v, corner + v};
  double sum = 0;
  constexpr int kPieces = 1500;
  for (int i = 0; i < kPieces; ++i) {
    for (int j = 0; j < kPieces; ++j) {
      const glm::dvec3 to =
          corner + u * ((i + 0.5) / kPieces) + v * ((j + 0.5) / kPieces) - receiver.position;
      const double up = glm::dot(to, glm::dvec3(receiver.normal));
      const double square_distance = glm::dot(to, to);
      if (up > 0) sum += up * -glm::dot(to, front) / (square_distance * square_distance);
    }
  }
  sum /= std::numbers::pi * kPieces * kPieces;
  CHECK(sum > 0.1);
  CHECK(form_factor(receiver, square) == Approx(sum).epsilon(1e-3));
  // Its back covers nothing
  const std::vector<glm::dvec3> back(square.rbegin(), square.rend());
  CHECK(form_factor(receiver, back) == 0);
}
