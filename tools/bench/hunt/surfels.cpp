// From the shapes of a scene to its surfels.
#include "tools/bench/shapes/surfels.h"

#include <algorithm>
#include <cmath>

#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/trigonometric.hpp>

#include "engine/base/numbers.h"
#include "tools/bench/hunt/scene.h"
#include "tools/bench/shapes/random.h"

namespace ptc::bench {
namespace {

/// Adds surfels of one shape, around the origin and not turned.
class ShapeSurfels {
 public:
  explicit ShapeSurfels(const Shape& shape) : shape_(shape), light_(shape.light) { add(); }
  [[nodiscard]] const std::vector<Surfel>& all() const noexcept { return surfels_; }

 private:
  void add() {
    const glm::dvec3& size = shape_.size;
    switch (shape_.kind) {
      case ShapeKind::wall:
        return wall({0, 0, 0}, size.x, size.y);
      case ShapeKind::sheet:
        return sheet();
      case ShapeKind::pair:
        wall({0, 0, 0}, size.x, size.y);
        light_ = glm::vec3(shape_.back);
        return wall({0, 0, -shape_.gap}, size.x, size.y);
      case ShapeKind::wedge:
        return wedge();
      case ShapeKind::slit:
        return slotted({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, size.x, size.y);
      case ShapeKind::box:
        return box(false);
      case ShapeKind::room:
        return box(true);
      case ShapeKind::ball:
      case ShapeKind::hollow:
        return ball();
      case ShapeKind::disc:
        return plate();
      case ShapeKind::leaves:
        return leaves();
      case ShapeKind::rod:
        return rod();
    }
  }

  void rectangle(const glm::dvec3& corner, const glm::dvec3& u, const glm::dvec3& v) {
    add_rectangle(surfels_, corner, u, v, shape_.spacing, light_);
  }

  void wall(const glm::dvec3& middle, double width, double depth) {
    rectangle(middle - glm::dvec3(width / 2, depth / 2, 0), {width, 0, 0}, {0, depth, 0});
  }

  void sheet() {
    wall({0, 0, 0}, shape_.size.x, shape_.size.y);
    std::vector<Surfel> backs = surfels_;
    for (Surfel& front : surfels_) front.position.z += 0.02 * static_cast<double>(front.radius);
    for (Surfel& back : backs) {
      back.position.z -= 0.02 * static_cast<double>(back.radius);
      back.normal = -back.normal;
      back.radius *= 0.98F;
      back.radiance = glm::vec3(shape_.back);
    }
    surfels_.insert(surfels_.end(), backs.begin(), backs.end());
  }

  void wedge() {
    const double angle = glm::radians(shape_.gap), width = shape_.size.x, depth = shape_.size.y;
    const glm::dvec3 along(width, 0, 0), slope(0, depth * std::cos(angle), depth * std::sin(angle));
    rectangle({-width / 2, 0, 0}, along, {0, depth, 0});
    rectangle({-width / 2, 0, 0}, slope, along);
  }

  /// Adds a rectangle along u and v with an opening along u in its middle.
  void slotted(const glm::dvec3& middle, const glm::dvec3& u, const glm::dvec3& v, double width,
               double depth) {
    const double side = (depth - shape_.gap) / 2;
    if (!(side > 0)) return;
    const glm::dvec3 along = width * u, corner = middle - along / 2.0 - depth / 2 * v;
    if (shape_.gap == 0) return rectangle(corner, along, depth * v);
    rectangle(corner, along, side * v);
    rectangle(corner + (side + shape_.gap) * v, along, side * v);
  }

  void box(bool inward) {
    const glm::dvec3 half = shape_.size / 2.0;
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 u(0), v(0), n(0);
      u[(axis + 1) % 3] = shape_.size[(axis + 1) % 3];
      v[(axis + 2) % 3] = shape_.size[(axis + 2) % 3];
      n[axis] = shape_.size[axis];
      rectangle(-half, inward ? u : v, inward ? v : u);
      if (axis == 2 && inward) {
        slotted({0, 0, half.z}, {1, 0, 0}, {0, -1, 0}, shape_.size.x, shape_.size.y);
      } else {
        rectangle(-half + n, inward ? v : u, inward ? u : v);
      }
    }
  }

  void ball() {
    add_sphere(surfels_, {0, 0, 0}, shape_.size.x, shape_.spacing, light_);
    if (shape_.kind == ShapeKind::ball) return;
    for (Surfel& surfel : surfels_) surfel.normal = -surfel.normal;
  }

  void push(const glm::dvec3& position, const glm::dvec3& normal, double radius) {
    surfels_.push_back({.position = position,
                        .normal = glm::vec3(normal),
                        .radius = static_cast<float>(radius),
                        .radiance = light_,
                        .albedo = glm::vec3(0.5F)});
  }

  void plate() {
    const double radius = shape_.size.x, spacing = shape_.spacing;
    if (radius < spacing) return push({0, 0, 0}, {0, 0, 1}, radius);
    const int count =
        std::max(4, static_cast<int>(kPiDouble * radius * radius / (spacing * spacing)));
    for (int i = 0; i < count; ++i) {  // Vogel's spiral
      const double ring = radius * std::sqrt((i + 0.5) / count), turn = i * 2.399963229728653;
      push({ring * std::cos(turn), ring * std::sin(turn), 0}, {0, 0, 1},
           radius * std::sqrt(kPiDouble / (2 * count)));
    }
  }

  void leaves() {
    Random random(1);
    const double ground = shape_.size.x * shape_.size.y, leaf = shape_.spacing;
    const int count = std::max(1, static_cast<int>(1.5 * ground / (leaf * leaf)));
    for (int i = 0; i < count; ++i) {
      const glm::dvec3 at = random.in_box(-0.5, 0.5) * shape_.size;
      push(at, glm::dvec3(random.direction()), leaf * std::sqrt(0.5));
    }
  }

  void rod() {
    const double radius = shape_.gap, length = shape_.size.x, spacing = shape_.spacing;
    const int around = std::max(3, static_cast<int>(2 * kPiDouble * radius / spacing));
    const int along = std::max(1, static_cast<int>(std::ceil(length / spacing)));
    const double width = 2 * kPiDouble * radius / around, step = length / along;
    for (int i = 0; i < along * around; ++i) {
      const double turn = 2 * kPiDouble * (i % around + 0.5 * (i / around % 2)) / around;
      const glm::dvec3 n(0, std::cos(turn), std::sin(turn));
      push(glm::dvec3((i / around + 0.5) * step - length / 2, 0, 0) + radius * n, n,
           0.5 * std::hypot(width, step));
    }
  }

  const Shape& shape_;
  glm::vec3 light_;
  std::vector<Surfel> surfels_;
};

glm::dmat3 rotation_of(const glm::dvec3& degrees) {
  glm::dmat4 turn(1);
  for (const int axis : {2, 1, 0}) {
    glm::dvec3 about(0);
    about[axis] = 1;
    turn = glm::rotate(turn, glm::radians(degrees[axis]), about);
  }
  return glm::dmat3(turn);
}

}  // namespace

std::vector<Surfel> surfels_of(const HuntScene& scene) {
  std::vector<Surfel> all;
  for (const Shape& shape : scene.shapes) {
    const glm::dmat3 turn = rotation_of(shape.turn);
    const ShapeSurfels shaped(shape);
    for (Surfel surfel : shaped.all()) {
      surfel.position = scene.scale * (shape.at + turn * surfel.position);
      surfel.normal = glm::vec3(glm::normalize(turn * glm::dvec3(surfel.normal)));
      surfel.radius *= static_cast<float>(scene.scale);
      all.push_back(surfel);
    }
  }
  return all;
}

std::vector<Receiver> receivers_of(const HuntScene& scene) {
  std::vector<Receiver> receivers;
  for (const HuntReceiver& receiver : scene.receivers)
    receivers.push_back({scene.scale * receiver.at, glm::vec3(glm::normalize(receiver.normal))});
  return receivers;
}

SkyLight sky_of(const HuntScene& scene) {
  switch (scene.sky) {
    case HuntSky::none:
      break;
    case HuntSky::white:
      return white_sky;
    case HuntSky::rising:
      return [](const glm::vec3& direction) { return glm::vec3(0.5F + 0.5F * direction.z); };
  }
  return {};
}

}  // namespace ptc::bench
