// Makes scenes smaller that keep their fault (after Zeller and Hildebrandt 2002, Simplifying and
// isolating failure-inducing input).
#include <cmath>
#include <vector>

#include "tools/bench/hunt/judge.h"
#include "tools/bench/hunt/rounding.h"

namespace ptc::bench {
namespace {

constexpr double kKept = 0.8;  // share of the error that a smaller scene must have

/// Returns simpler shapes to try in place of a shape, the simplest first.
std::vector<Shape> simpler(const Shape& shape) {
  std::vector<Shape> tries;
  const auto offer = [&](const auto& change) {
    Shape other = shape;
    change(other);
    if (other != shape) tries.push_back(other);
  };
  offer([](Shape& s) { s.turn = glm::dvec3(0); });
  offer([](Shape& s) { s.turn = 90.0 * rounded(s.turn / 90.0, 1); });
  offer([](Shape& s) { s.turn = 15.0 * rounded(s.turn / 15.0, 1); });
  for (glm::dvec3 Shape::*light : {&Shape::light, &Shape::back}) {
    offer([&](Shape& s) { s.*light = glm::dvec3(0); });
    if (shape.*light != glm::dvec3(0)) offer([&](Shape& s) { s.*light = glm::dvec3(1); });
  }
  offer([](Shape& s) { s.at = glm::dvec3(0); });
  offer([](Shape& s) { s.at = rounded(s.at, 2); });
  offer([](Shape& s) { s.at = rounded(s.at, 10); });
  offer([](Shape& s) { s.size = glm::dvec3(s.size.x); });
  for (const double steps : {1.0, 10.0}) {
    offer([&](Shape& s) {
      const glm::dvec3 size = rounded(s.size, steps);
      if (size.x > 0 && size.y > 0 && size.z > 0) s.size = size;
    });
  }
  for (const double steps : {0.1, 20.0, 200.0}) {
    offer([&](Shape& s) {
      if (rounded(s.gap, steps) > 0) s.gap = rounded(s.gap, steps);
    });
  }
  offer([](Shape& s) {
    if (s.spacing < 0.5 * s.size.x) s.spacing = rounded(1.5 * s.spacing, 100);
  });
  offer([](Shape& s) {
    if (s.spacing >= 0.01) s.spacing = rounded(s.spacing, 100);
  });
  return tries;
}

class Shrinker {
 public:
  Shrinker(HuntScene scene, const std::function<double(const HuntScene&)>& measure, unsigned budget)
      : scene_(std::move(scene)), measure_(measure), budget_(budget) {
    least_ = kKept * measure_(scene_);
  }

  HuntScene run() {
    for (bool changed = true; changed && budget_ > 0;) {
      const HuntScene before = scene_;
      take_away(&HuntScene::receivers, 1);
      take_away(&HuntScene::shapes, 1);
      simplify();
      changed = !(scene_ == before);
    }
    return scene_;
  }

 private:
  /// Takes a scene in place of the present one if it has the fault, too.
  bool accept(const HuntScene& scene) {
    if (budget_ == 0) return false;
    --budget_;
    if (!(measure_(scene) >= least_)) return false;
    scene_ = scene;
    return true;
  }

  /// Takes away runs of items, long ones first, and leaves `least` or more.
  template <class Item>
  void take_away(std::vector<Item> HuntScene::*items, std::size_t least) {
    for (std::size_t run = (scene_.*items).size() / 2; run > 0; run /= 2) {
      for (std::size_t from = 0; from + run <= (scene_.*items).size();) {
        HuntScene smaller = scene_;
        auto& list = smaller.*items;
        const auto first = list.begin() + static_cast<std::ptrdiff_t>(from);
        list.erase(first, first + static_cast<std::ptrdiff_t>(run));
        if (list.size() < least || !accept(smaller)) from += run;
      }
    }
  }

  void simplify() {
    HuntScene plain = scene_;
    plain.scale = 1;
    if (!(plain == scene_)) accept(plain);
    for (const HuntSky sky : {HuntSky::none, HuntSky::white}) {
      HuntScene other = scene_;
      other.sky = sky;
      if (sky < scene_.sky && accept(other)) break;
    }
    for (std::size_t i = 0; i < scene_.shapes.size(); ++i) {
      for (const Shape& shape : simpler(scene_.shapes[i])) {
        HuntScene other = scene_;
        other.shapes[i] = shape;
        if (accept(other)) break;
      }
    }
    for (std::size_t i = 0; i < scene_.receivers.size(); ++i) {
      for (const double steps : {10.0, 100.0, 1000.0}) {
        HuntScene other = scene_;
        other.receivers[i] = {rounded(scene_.receivers[i].at, steps),
                              rounded(scene_.receivers[i].normal, steps)};
        if (other.receivers[i].normal == glm::dvec3(0) || other == scene_) continue;
        if (accept(other)) break;
      }
    }
  }

  HuntScene scene_;
  const std::function<double(const HuntScene&)>& measure_;
  unsigned budget_;
  double least_ = 0;
};

}  // namespace

HuntScene shrink(HuntScene scene, const std::function<double(const HuntScene&)>& measure,
                 unsigned budget) {
  return Shrinker(std::move(scene), measure, budget).run();
}

}  // namespace ptc::bench
