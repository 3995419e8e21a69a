// A tree over many emitters, by which those are drawn that may light a place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/scene/light/emitters.h"

namespace ptc {

/// Draws emitters in proportion to about the light that they may give to a place: their power, over
/// the square of the distance, times the cosines there and at them.
///
///            (  all  )        From the root on, one of two halves is drawn by what its
///           /         \       emitters may give, down to a few neighbours. One random number
///        (   )       (   )    is stretched from level to level, so that numbers which are
///        /   \       /   \    spread evenly draw emitters that are spread, too.
///      ...   ...   ...   ...
///
/// Source: Conty Estevez and Kulla 2018, Importance sampling of many lights with adaptive tree
/// splitting: without the splitting, and with a part of their bound.
/// Memory: 28 bytes for each emitter.   Threads: const members may be called concurrently.
class EmitterTree {
 public:
  /// Emitters of a leaf, at most.
  static constexpr std::size_t kLeaf = 8;

  EmitterTree() = default;
  /// @param emitters  is put in the order of the tree
  explicit EmitterTree(std::vector<Emitter>& emitters);

  /// Neighbours that were drawn.
  struct Drawn {
    std::uint32_t first = 0, end = 0;  ///< indices of emitters; none when nothing can give light
    double chance = 1;                 ///< probability with which they are drawn
    double rest = 0;                   ///< what is left of the random number, in [0, 1)
  };
  /// Draws neighbours that may give light to a place. Every emitter that may is among those of some
  /// number.
  /// @param position, normal  of the place
  /// @param unit              random number in [0, 1)
  [[nodiscard]] Drawn draw(const glm::vec3& position, const glm::vec3& normal, double unit) const;

 private:
  /// Neighbours: their sphere, the cone of the directions in which they look, and their power.
  struct Node {
    glm::vec3 centre{0};               ///< by power
    float radius = 0;                  ///< of a sphere about the centre around all of them
    float spread = 0;                  ///< root mean square distance from the centre, by power
    glm::vec3 axis{0};                 ///< unit
    float cone = 1;                    ///< cosine of half the cone's angle
    double power = 0;                  ///< area times brightness
    std::uint32_t first = 0, end = 0;  ///< its emitters
    std::uint32_t second = 0;          ///< its second half, the first follows it; 0: a leaf
  };

  /// Adds the node of a range of emitters, whose order it changes, and all below it.
  void add(std::span<Emitter> emitters, std::uint32_t first, std::uint32_t end);
  /// Returns about the light that emitters of a node may give to a place; above 0 where one may.
  [[nodiscard]] static double expected(const Node& node, const glm::vec3& position,
                                       const glm::vec3& normal);

  std::vector<Node> nodes_;  ///< root first
};

}  // namespace ptc
