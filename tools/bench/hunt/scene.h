// Small scenes that are drawn by chance and can be written down.
//
//   draw_scene(seed) -> HuntScene <--> text, a line for each shape and receiver
//                           |
//                           +--> surfels_of()     discs, as a cloud has them
//                           `--> receivers_of()   places that are shaded
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/surfel.h"
#include "engine/shade/shading.h"
#include "tools/bench/stability/lab.h"

namespace ptc::bench {

/// What a shape is. Walls lie in the plane z = 0 around the origin and look along +z, before they
/// are turned and moved.
enum class ShapeKind : std::uint8_t {
  wall,    ///< a rectangle of size.x by size.y, of one side
  sheet,   ///< two rectangles back to back, as the sampler makes pairs
  pair,    ///< two rectangles that look along +z, the one of `back` a `gap` behind the other
  wedge,   ///< two rectangles with an edge along x in common, `gap` degrees between their fronts
  slit,    ///< a rectangle with an opening along x in its middle, `gap` wide
  box,     ///< a box of size.x by size.y by size.z, seen from outside
  room,    ///< a box from within, whose ceiling has an opening along x, `gap` wide
  ball,    ///< a sphere of radius size.x
  hollow,  ///< a sphere from within
  disc,    ///< a round plate of radius size.x; one surfel where that is below the spacing
  leaves,  ///< discs of any normal in a box, which have 1.5 times the area of its ground
  rod,     ///< a cylinder of radius `gap` and length size.x along x, open at its ends
};

/// A shape. Lengths are in units of the scene.
struct Shape {
  ShapeKind kind = ShapeKind::wall;
  glm::dvec3 at{0};      ///< its middle
  glm::dvec3 turn{0};    ///< degrees about x, then about y, then about z
  glm::dvec3 size{1};    ///< above 0
  double gap = 0;        ///< as the kind says, 0 or more
  double spacing = 0.1;  ///< between surfels, above 0
  glm::dvec3 light{0};   ///< radiance of its surfels
  glm::dvec3 back{0};    ///< radiance of the other side of a sheet, or of the other wall of a pair

  bool operator==(const Shape&) const = default;
};

/// What shines where nothing covers it.
enum class HuntSky : std::uint8_t {
  none,
  white,   ///< radiance 1 everywhere
  rising,  ///< from 0 along -z to 1 along +z
};

/// A place that is shaded; the normal may have any length above 0.
struct HuntReceiver {
  glm::dvec3 at{0}, normal{0, 0, 1};
  bool operator==(const HuntReceiver&) const = default;
};

/// A scene as plain data.
struct HuntScene {
  HuntSky sky = HuntSky::none;
  double scale = 1;  ///< the length of a unit
  std::vector<Shape> shapes;
  std::vector<HuntReceiver> receivers;

  bool operator==(const HuntScene&) const = default;
};

/// Draws a scene of one to six shapes, of 200 to 4,000 surfels and 48 receivers: three patches of
/// neighbours on surfaces, lone ones on surfaces, and some off surfaces. No radiance is above 1.
/// A seed always draws the same scene.
[[nodiscard]] HuntScene draw_scene(std::uint64_t seed);

/// Returns the surfels of a scene, in its shapes' order.
[[nodiscard]] std::vector<Surfel> surfels_of(const HuntScene& scene);
/// Returns the places of a scene that are shaded.
[[nodiscard]] std::vector<Receiver> receivers_of(const HuntScene& scene);
/// Returns the sky of a scene; empty where it has none.
[[nodiscard]] SkyLight sky_of(const HuntScene& scene);

/// Writes a scene as lines of words and numbers; what a shape has by default is left out:
///
///     sky white
///     wall at 0 0 1 size 2 2 1 spacing 0.1 light 1 1 1
///     receiver 0 0 0.5 normal 0 0 1
[[nodiscard]] std::string text_of(const HuntScene& scene);
/// Reads what text_of() writes. @throws DataError that names the line that is none of them
[[nodiscard]] HuntScene scene_of(const std::string& text);

/// Returns the kinds of shapes that a scene has, by name, each once: "ball, wall x2".
[[nodiscard]] std::string kinds_of(const HuntScene& scene);

}  // namespace ptc::bench
