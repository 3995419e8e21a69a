// A scene is in the picture when it lies on the inner side of four planes through the eye:
//
//          a \       / b        along an axis across the view, with s = tan of half the angle:
//             \ o o /             x - s z <= e_x - s e_z      plane a
//              \ o /             -x - s z <= -e_x - s e_z     plane b
//               \ /
//                e            so the farthest points to each side give the nearest eye
#include "engine/pipeline/render/overview.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>
#include <vector>

#include <glm/geometric.hpp>

#include "engine/pipeline/convert/level_source.h"
#include "format/error.h"

namespace ptc {
namespace {

constexpr std::size_t kClusters = 1000;  // that are framed, at least, where there are as many
constexpr double kLeftOut = 1.0 / 2000;  // of the area, to each side
constexpr double kHeight = 0.35;         // of the camera, for 1 to the front
constexpr double kMargin = 0.95;         // of half the picture, which the scene fills

/// A part of the scene that is to be seen: a disc, or a ball.
struct Part {
  glm::dvec3 middle{0};
  glm::dvec3 normal{0};  ///< unit; 0 for a ball
  double radius = 0;
  double area = 0;  ///< scene units squared, about; 0: is never left out
};

/// Returns how high above the scene the camera stands, for 1 to the front: twice as high over flat
/// land, whose parts would hide each other, as before a thing that is half as high as wide.
double height_of(const Bounds& bounds, const glm::dvec3& up) {
  double high = 0, wide = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double side = bounds.high[axis] - bounds.low[axis];
    (up[axis] == 0 ? wide : high) = std::max(up[axis] == 0 ? wide : high, side);
  }
  return wide > 0 ? kHeight * (2 - std::min(1.0, 2 * high / wide)) : kHeight;
}

/// Returns the corners of the bounds.
std::vector<Part> corners_of(const Bounds& bounds) {
  std::vector<Part> parts(8);
  for (std::size_t corner = 0; corner < parts.size(); ++corner) {
    for (int axis = 0; axis < 3; ++axis)
      parts[corner].middle[axis] = ((corner >> axis & 1) != 0 ? bounds.high : bounds.low)[axis];
  }
  return parts;
}

/// Returns the clusters of a level whose middle lies in a box, or all where there is no box.
std::vector<Part> clusters_of(const ContainerReader& scene, unsigned level,
                              const std::optional<Bounds>& box) {
  std::vector<Part> parts;
  const auto clusters = open_level(scene, level, box);
  std::vector<Surfel> block(kClusters);
  while (const std::size_t count = clusters->next(block)) {
    for (const Surfel& cluster : std::span(block).first(count)) {
      if (!box) {
        parts.push_back({cluster.position, glm::dvec3(cluster.normal), cluster.radius,
                         cluster.radius * cluster.radius});
      } else if (box->contains(cluster.position)) {
        // No point of a subject strayed, and a tip of it lies beyond the discs next to it
        parts.push_back({.middle = cluster.position, .radius = cluster.radius});
      }
    }
  }
  return parts;
}

/// Returns the clusters of the first level that has enough of them; none where a page is damaged.
std::vector<Part> clusters_of(const ContainerReader& scene, const std::optional<Bounds>& box) {
  std::vector<Part> parts;
  try {
    for (unsigned level = 1; level <= scene.superblock().levels && parts.size() < kClusters;
         ++level)
      parts = clusters_of(scene, level, box);
  } catch (const FormatError&) {
    return {};
  }
  return parts;
}

/// Returns how far parts reach along a direction that may be of any length, but for the small area
/// that reaches farthest.
double reach(const std::vector<Part>& parts, const glm::dvec3& direction) {
  struct Reach {
    double at, area;
  };
  std::vector<Reach> reaches;
  double left = 0;
  for (const Part& part : parts) {
    const double aside = part.normal == glm::dvec3(0)
                             ? glm::length(direction)
                             : glm::length(glm::cross(part.normal, direction));
    reaches.push_back({glm::dot(part.middle, direction) + part.radius * aside, part.area});
    left += part.area * kLeftOut;
  }
  std::ranges::make_heap(reaches, {}, &Reach::at);
  const double farthest = reaches.front().at;
  for (; !reaches.empty(); reaches.pop_back()) {
    if ((left -= reaches.front().area) < 0) return reaches.front().at;
    std::ranges::pop_heap(reaches, {}, &Reach::at);
  }
  return farthest;  // none has an area
}

/// The edge of two planes that just hold the parts between them.
struct Wedge {
  /// @param across   unit; the axis of the picture that the planes bound
  /// @param forward  unit
  /// @param slope    tangent of the angle between a plane and `forward`
  Wedge(const std::vector<Part>& parts, const glm::dvec3& across, const glm::dvec3& forward,
        double slope) {
    const double one = reach(parts, across - slope * forward);
    const double other = reach(parts, -across - slope * forward);
    depth = -(one + other) / (2 * slope);
    aside = (one - other) / 2;
  }

  double depth;  ///< along `forward`
  double aside;  ///< along `across`
};

/// Returns where along an axis of the picture an eye at a given depth has the parts in the middle:
/// at the edge of the steepest wedge that begins there.
double middle_of(const std::vector<Part>& parts, const glm::dvec3& across,
                 const glm::dvec3& forward, double slope, double depth) {
  constexpr int kHalvings = 20;
  double low = 0;
  for (int i = 0; i < kHalvings; ++i) {
    const double half = (low + slope) / 2;
    (Wedge(parts, across, forward, half).depth < depth ? low : slope) = half;
  }
  return Wedge(parts, across, forward, slope).aside;
}

}  // namespace

Camera overview(const ContainerReader& scene, const glm::dvec3& up,
                const std::optional<Bounds>& subject,
                const std::optional<std::array<unsigned, 2>>& size) {
  const auto [low, high] = std::tie(scene.superblock().bounds_low, scene.superblock().bounds_high);
  const Bounds bounds =
      subject.value_or(Bounds{{low[0], low[1], low[2]}, {high[0], high[1], high[2]}});
  Camera camera;
  if (size) {
    camera.width = (*size)[0];
    camera.height = (*size)[1];
  }
  std::vector<Part> parts = clusters_of(scene, subject);
  if (parts.empty()) parts = corners_of(bounds);
  // Measure from the middle of the bounds, where numbers are small
  const glm::dvec3 middle = bounds.low / 2.0 + bounds.high / 2.0;
  for (Part& part : parts) part.middle -= middle;

  // Look from above on the side of +z when +y is up, of -y when +z is, of +y when +x is
  const glm::dvec3 from(0.45, height_of(bounds, up), 1);
  const glm::dvec3 away = glm::normalize(up.z > 0   ? glm::dvec3(from.x, -from.z, from.y)
                                         : up.x > 0 ? glm::dvec3(from.y, from.z, from.x)
                                                    : from);
  camera.up = glm::vec3(up);
  camera.look_at = middle;
  camera.position = middle + away;

  // Stand as near as both pairs of planes allow, and look at the middle of what they leave
  const CameraAxes axes = axes_of(camera);
  const double tall = std::tan(0.5 * static_cast<double>(camera.vertical_fov)) * kMargin;
  const double wide = tall * camera.width / camera.height;
  const double nearest = std::min(Wedge(parts, axes.right, axes.forward, wide).depth,
                                  Wedge(parts, axes.up, axes.forward, tall).depth);
  const double target = (reach(parts, axes.forward) - reach(parts, -axes.forward)) / 2;
  double distance = target - nearest;
  if (distance <= 0) distance = 1;  // a single point
  const double depth = target - distance;
  camera.look_at = middle + axes.right * middle_of(parts, axes.right, axes.forward, wide, depth) +
                   axes.up * middle_of(parts, axes.up, axes.forward, tall, depth) +
                   axes.forward * target;
  camera.position = camera.look_at - axes.forward * distance;
  return camera;
}

}  // namespace ptc
