// The inner loops of tracing, compiled for every instruction set.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include <glm/vec3.hpp>

#include "engine/shade/scene_scale.h"
#include "engine/shade/shading.h"
#include "engine/trace/decoded_tree.h"
#include "engine/trace/trace_boxes.h"

namespace ptc {

/// The nearest disc that a ray has met.
struct RayHit {
  /// Bumped depth along the ray (spec/shading.md#surfels), in edges of the frame.
  float depth = std::numeric_limits<float>::infinity();
  bool back = false;        ///< whether the ray met its back, which is black
  std::uint64_t point = 0;  ///< number of the disc's point

  /// Reports whether the ray met a disc.
  [[nodiscard]] bool met() const noexcept { return depth < std::numeric_limits<float>::infinity(); }
};

/// Whether rays look for the nearest disc, or for any disc that covers their direction.
enum class RaysFor : bool { nearest, any };

/// Says whether rays from a place over the horizon of a normal can meet a disc of a leaf without a
/// rim.
/// @param from  where the rays begin, relative to the leaf
/// @param axis  unit; the rays' directions d have d . axis >= 0
[[nodiscard]] bool has_disc(const TraceLeaf& leaf, const Beginning& from, const glm::vec3& axis,
                            const TraceRules& rules);

/// Chooses from a list the boxes that rays of a few directions may meet, in the same order.
void narrow_boxes(const BoxList& from, std::span<const glm::vec3> directions, BoxList& into);

/// A ray from a surface towards a light.
struct ShadowRay {
  glm::vec3 origin{0};     ///< relative to the place around which rays begin, edges of the frame
  glm::vec3 direction{0};  ///< unit
  float length = std::numeric_limits<float>::infinity();  ///< up to the light, edges
};

/// Bounds rays that have about the same direction: at the depth s along the third axis, behind
/// where it began, a ray lies between low + slope_low s and high + slope_high s on the others.
///
///                          .-'|
///           .---------.-'     |        ^ axes[0]
///     rays  |     .-'       .-'        |
///     begin '-.-'-------.-'            +---> axes[2]
struct Shaft {
  glm::vec3 axes[3];                  ///< unit, at right angles
  float low[3], high[3];              ///< where rays begin, along each axis
  float slope_low[2], slope_high[2];  ///< change along the first two axes for each unit of depth
  float depth;                        ///< greatest depth of any ray, edges
};

/// Tests the children of a group against a shaft.
/// @param from  what the shaft is relative to, as the group sees it
/// @param near  gets kTraceLanes depths, before which no ray enters the boxes
/// @return      bit i: rays may meet something in child i
[[nodiscard]] unsigned meet_shaft(const TraceGroup& group, const Beginning& from,
                                  const Shaft& shaft, float* near);

/// Finds out which rays something hides from their lights.
/// @param place   around which the rays begin, and to which the list is relative, lattice units
/// @param list    boxes that hold everything the rays can meet, and words as for trace_rays()
/// @param chosen  indices of the rays
/// @param hidden  by index of the ray; gets 1 or 0
/// @throws as trace_rays()
void trace_shadows(DecodedTree& tree, const glm::dvec3& place, const BoxList& list,
                   std::span<const std::uint64_t> words, std::span<const ShadowRay> rays,
                   std::span<const std::uint32_t> chosen, std::span<std::uint8_t> hidden);

/// Follows one ray after the other down the tree.
/// @param place  where they begin, and to which the list is relative, lattice units
/// @param list   boxes that hold everything the rays can meet, from narrow_boxes()
/// @param words  what the list's numbers stand for: references; the lowest bit of a number says
///               whether its node is interior, the others are its index here
/// @param hits   as many as directions; replaced where a disc is nearer
/// @throws FormatError when a page is damaged, or the tree leads in circles
void trace_rays(DecodedTree& tree, const glm::dvec3& place, const BoxList& list,
                std::span<const std::uint64_t> words, std::span<const glm::vec3> directions,
                RaysFor wanted, std::span<RayHit> hits);

}  // namespace ptc
