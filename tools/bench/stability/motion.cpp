// Rows in which something moves: what is seen of it must not jump.
//
//   time    frame 0   | . . . . . . . |     a field has the receivers of a frame in each row,
//    |      frame 1   | . . . . . . . |     so that a jump is an edge across it
//    v      frame 2   | . . . . . . . |
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "tools/bench/shapes/surfels.h"
#include "tools/bench/stability/row.h"

namespace ptc::bench {
namespace {

constexpr unsigned kMovingReceivers = 32, kMotionRays = 1024;
constexpr double kMotionSpacing = 0.05;

/// Receivers along a line on the floor. @param shift  by which the line has moved, scene units
std::vector<Receiver> on_floor(double shift) {
  return receivers_on_grid(kMovingReceivers, 1, [&](double u, double) {
    return Receiver{{2.4 * u - 1.2 + shift, -0.2 + 0.5 * shift, 0.1 * kMotionSpacing}, {0, 0, 1}};
  });
}

/// A floor, a wall, and a ball at a place, which may shine.
std::vector<Surfel> scene_with_ball(const glm::dvec3& middle, const glm::vec3& light) {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, kMotionSpacing, glm::vec3(0.5F));
  add_rectangle(surfels, {-2, 1.5, 0}, {4, 0, 0}, {0, 0, 2}, kMotionSpacing, {0.8F, 0.1F, 0.1F});
  add_sphere(surfels, middle, 0.3, kMotionSpacing, light);
  return surfels;
}

/// Returns the largest step of any receiver from one frame to the next.
double largest_step(const std::vector<glm::vec3>& frames) {
  double largest = 0;
  for (std::size_t i = kMovingReceivers; i < frames.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      largest = std::max(largest, std::abs(static_cast<double>(frames[i][c]) -
                                           static_cast<double>(frames[i - kMovingReceivers][c])));
    }
  }
  return largest;
}

/// Finishes a row whose frames are complete.
Outcome finished_line(Field field) {
  field.width = kMovingReceivers;
  field.height = kMovingFrames;
  const double step = largest_step(field.ours), true_step = largest_step(field.truth);
  return {.figures = {{"light, largest step beyond 1.5 of the true one",
                       std::max(0.0, step - 1.5 * true_step), kAllowedStep},
                      {"light, RMS error", rms_difference(field.ours, field.truth), 0.015}},
          .field = std::move(field)};
}

/// Adds what a scene shows at a frame.
void add_frame(const SmallScene& scene, const std::vector<Receiver>& receivers, Field& field) {
  for (const Shading& shading : scene.shade(receivers)) field.ours.push_back(brightness(shading));
  for (const Shading& shading : scene.trace(receivers, kMotionRays))
    field.truth.push_back(brightness(shading));
}

Outcome moving_receivers(const Lab& lab) {
  const SmallScene scene(lab, scene_with_ball({0, 0, 0.4}, {0.9F, 0.5F, 0.1F}));
  Field field;
  for (unsigned i = 0; i < kMovingFrames; ++i) add_frame(scene, on_floor(0.005 * i), field);
  return finished_line(std::move(field));
}

/// The ball moves; the scene is built anew for each frame.
Outcome moving_ball(const Lab& lab, const glm::vec3& light) {
  Field field;
  for (unsigned i = 0; i < kMovingFrames; ++i) {
    const glm::dvec3 middle(0.012 * i - 0.6, 0.1, 0.4);
    add_frame(SmallScene(lab, scene_with_ball(middle, light)), on_floor(0), field);
  }
  return finished_line(std::move(field));
}

Outcome moving_object(const Lab& lab) {
  return moving_ball(lab, {0.3F, 0.2F, 0.1F});
}

Outcome moving_lamp(const Lab& lab) {
  return moving_ball(lab, glm::vec3(4));
}

constexpr std::array kMotionRows = std::to_array<Row>({
    {"15", "receivers that move", "light that jumps", moving_receivers},
    {"24", "object that moves, in a scene built for each frame", "shadows that jump",
     moving_object},
    {"24", "lamp that moves, in a scene built for each frame", "light that jumps", moving_lamp},
});

}  // namespace

std::span<const Row> rows_of_motion() {
  return kMotionRows;
}

}  // namespace ptc::bench
