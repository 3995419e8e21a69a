// Draws scenes by chance.
#include <algorithm>
#include <array>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "engine/base/basis.h"
#include "tools/bench/hunt/rounding.h"
#include "tools/bench/hunt/scene.h"
#include "tools/bench/shapes/random.h"

namespace ptc::bench {
namespace {

constexpr int kPatches = 3, kNeighbours = 8, kLone = 16, kOff = 8;
constexpr double kLift = 0.15;  // what programs lift receivers by, in radii of the surfel

class Drawer {
 public:
  explicit Drawer(std::uint64_t seed) : random_(seed) {}

  HuntScene scene() {
    const double sky = random_.unit();
    scene_.sky = sky < 0.4 ? HuntSky::none : sky < 0.7 ? HuntSky::white : HuntSky::rising;
    if (random_.unit() < 0.1) scene_.scale = rounded(logarithmic(0.001, 1000), 1000);
    const int shapes = 1 + static_cast<int>(random_.unit() * 6);
    for (int i = 0; i < shapes; ++i) {
      scene_.shapes.push_back(shape());
      if (i > 0 && random_.unit() < 0.4) move_to_another(scene_.shapes.back());
    }
    if (random_.unit() < 0.25) dim_all_but_one();
    choose_spacings();
    add_receivers();
    return scene_;
  }

 private:
  /// Returns a number whose logarithm is even.
  double logarithmic(double low, double high) { return low * std::pow(high / low, random_.unit()); }

  /// Draws a radiance: black, white or grey, or a colour.
  glm::dvec3 light() {
    const double kind = random_.unit();
    if (kind < 0.2) return glm::dvec3(0);
    if (kind < 0.4) return glm::dvec3(1);
    if (kind < 0.6) return glm::dvec3(rounded(random_.unit(), 100));
    return rounded(random_.in_box(0, 1), 100);
  }

  Shape shape() {
    Shape shape{.kind = static_cast<ShapeKind>(static_cast<int>(random_.unit() * 12))};
    shape.at = rounded(random_.in_box(-1, 1), 100);
    if (random_.unit() < 0.6) {
      const double turn = random_.unit();
      shape.turn = turn < 0.5   ? glm::dvec3(0, 0, 0)
                   : turn < 0.7 ? glm::dvec3(90, 0, 0)
                                : glm::dvec3(0, 90, 0);
    } else {
      shape.turn = rounded(random_.in_box(0, 360), 1);
    }
    const double size = logarithmic(0.1, 4);
    for (int axis = 0; axis < 3; ++axis)
      shape.size[axis] = rounded(size * logarithmic(0.3, 2), 1000);
    shape.light = light();
    shape.back = light();
    shape.gap = gap(shape);
    return shape;
  }

  double gap(Shape& shape) {
    switch (shape.kind) {
      case ShapeKind::pair:
        return rounded(logarithmic(0.001, 0.5), 10'000);
      case ShapeKind::wedge:
        return rounded(random_.between(5, 170), 1);
      case ShapeKind::slit:
        return rounded(shape.size.y * logarithmic(0.01, 0.5), 10'000);
      case ShapeKind::rod:
        return rounded(shape.size.x * logarithmic(0.01, 0.3), 10'000);
      case ShapeKind::room:
        // Most rooms are around the other shapes
        if (random_.unit() < 0.7) shape.size = rounded(random_.in_box(2, 5), 100);
        return random_.unit() < 0.4 ? 0 : rounded(shape.size.y * logarithmic(0.01, 0.5), 10'000);
      case ShapeKind::ball:
      case ShapeKind::hollow:
        shape.size = glm::dvec3(shape.size.x / 2);
        return 0;
      default:
        return 0;
    }
  }

  /// Moves the last shape to the surface of one before it, or just before that; half of such shapes
  /// are turned alike.
  void move_to_another(Shape& shape) {
    Shape& other = scene_.shapes[static_cast<std::size_t>(
        random_.unit() * static_cast<double>(scene_.shapes.size() - 1))];
    const HuntScene alone{.shapes = {other}};
    const std::vector<Surfel> surfels = surfels_of(alone);
    const Surfel& near =
        surfels[static_cast<std::size_t>(random_.unit() * static_cast<double>(surfels.size()))];
    const double height = random_.unit() < 0.3 ? 0 : logarithmic(0.001, 0.5);
    shape.at = rounded(near.position + height * glm::dvec3(near.normal), 10'000);
    if (random_.unit() < 0.5) shape.turn = other.turn;
  }

  /// Leaves one shape as bright as it is, and makes the others dark: a lamp.
  void dim_all_but_one() {
    const auto lamp =
        static_cast<std::size_t>(random_.unit() * static_cast<double>(scene_.shapes.size()));
    for (std::size_t i = 0; i < scene_.shapes.size(); ++i) {
      Shape& shape = scene_.shapes[i];
      if (i == lamp) {
        shape.light = glm::dvec3(1);
      } else {
        shape.light = rounded(0.05 * shape.light, 1000);
        shape.back = rounded(0.05 * shape.back, 1000);
      }
    }
  }

  /// Chooses spacings of up to 16 to 1 beside one another, and scales them until the scene has as
  /// many surfels as are wanted.
  void choose_spacings() {
    const double wanted = logarithmic(250, 3500);
    for (Shape& shape : scene_.shapes) shape.spacing = logarithmic(0.05, 0.8);
    for (int step = 0; step < 8; ++step) {
      const auto count = static_cast<double>(surfels_of(scene_).size());
      const double factor = std::sqrt(count / wanted);
      if (step > 0 && count > 200 && count < 4000 && factor < 1.1 && factor > 0.9) break;
      for (Shape& shape : scene_.shapes)
        shape.spacing = std::max(0.001, rounded(shape.spacing * factor, 10'000));
    }
  }

  void add(const glm::dvec3& at, const glm::dvec3& normal) {
    scene_.receivers.push_back({rounded(at, 100'000), rounded(normal, 1000)});
  }

  /// Adds a receiver on the disc of a surfel.
  void add_on(const Surfel& surfel) {
    const Basis basis(surfel.normal);
    const double radius = static_cast<double>(surfel.radius);
    const double turn = 2 * 3.141592653589793 * random_.unit(),
                 ring = 0.7 * radius * std::sqrt(random_.unit());
    add(surfel.position + ring * std::cos(turn) * glm::dvec3(basis.x) +
            ring * std::sin(turn) * glm::dvec3(basis.y) +
            kLift * radius * glm::dvec3(surfel.normal),
        glm::dvec3(surfel.normal));
  }

  void add_receivers() {
    HuntScene unscaled = scene_;
    unscaled.scale = 1;
    const std::vector<Surfel> surfels = surfels_of(unscaled);
    const auto any = [&] {
      return static_cast<std::size_t>(random_.unit() * static_cast<double>(surfels.size()));
    };
    // Neighbours, which share receiver cells
    for (int patch = 0; patch < kPatches; ++patch) {
      const Surfel& middle = surfels[any()];
      std::vector<Surfel> near(surfels);
      const auto distance = [&](const Surfel& s) {
        return glm::distance(s.position, middle.position);
      };
      std::ranges::partial_sort(
          near, near.begin() + std::min<std::ptrdiff_t>(kNeighbours, std::ssize(near)), {},
          distance);
      for (int i = 0; i < kNeighbours; ++i) add_on(near[static_cast<std::size_t>(i) % near.size()]);
    }
    for (int i = 0; i < kLone; ++i) add_on(surfels[any()]);
    for (int i = 0; i < kOff; ++i) {
      const glm::dvec3 at = random_.in_box(-1.5, 1.5);
      add(at, glm::dvec3(random_.direction()));
    }
  }

  Random random_;
  HuntScene scene_;
};

}  // namespace

HuntScene draw_scene(std::uint64_t seed) {
  return Drawer(seed).scene();
}

}  // namespace ptc::bench
