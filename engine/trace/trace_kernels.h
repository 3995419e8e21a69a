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
#include "format/node_page.h"

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

/// Decodes the children of a group.
/// @param origin  lattice units
void decode_boxes(const GroupView& group, const glm::dvec3& origin, TraceGroup& into);

/// Where discs are decoded for.
struct DiscOrigin {
  glm::dvec3 position{0};             ///< lattice units
  glm::vec3 axis{0};                  ///< discs below the horizon of this normal are left out
  SceneScale::Factors lengths{1, 1};  ///< convert lengths from scene units to edges
  Sides sides = Sides::both;          ///< which sides stop rays
};

/// Appends surfels of a point page to a leaf, but for those that no ray from the origin can meet.
/// @param payload  of the page; up to 64 bytes past its end may be read
/// @param count    number of points on the page
/// @param first    index of the first surfel on the page
/// @param number   how many surfels; with those of `from` at most kTraceDiscs
/// @param from     number of the first surfel in its leaf
void decode_discs(const std::byte* payload, std::uint32_t count, std::uint32_t first,
                  unsigned number, unsigned from, const DiscOrigin& origin, TraceLeaf& into);

/// Chooses from a list the boxes that rays of a few directions may meet, in the same order.
void narrow_boxes(const BoxList& from, std::span<const glm::vec3> directions, BoxList& into);

/// Follows one ray after the other down the tree.
/// @param list   boxes that hold everything the rays can meet, from narrow_boxes()
/// @param words  what the list's numbers stand for: references; the lowest bit of a number says
///               whether its node is interior, the others are its index here
/// @param hits   as many as directions; replaced where a disc is nearer
/// @throws FormatError when a page is damaged, or the tree leads in circles
void trace_rays(DecodedTree& tree, const BoxList& list, std::span<const std::uint64_t> words,
                std::span<const glm::vec3> directions, RaysFor wanted, std::span<RayHit> hits);

}  // namespace ptc
