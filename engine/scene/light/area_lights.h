// Emissive triangles as lights: places on them that shadow rays aim at.
#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/low_discrepancy.h"
#include "engine/scene/light/emitter_tree.h"
#include "engine/scene/light/emitters.h"

namespace ptc {

/// A place on an emitter that a shadow ray aims at.
struct EmitterSample {
  glm::vec3 position{0};    ///< relative to the origin of the emitters
  glm::vec3 normal{0};      ///< unit, of the emitting side
  glm::vec3 irradiance{0};  ///< contribution of this sample when nothing is in between, W/m^2
};

/// Chooses shadow ray targets on emissive triangles.
///
/// Emitters are chosen in proportion to what each may give to the point: its brightness times its
/// solid angle times the cosine there. When there are at most 64 emitters, they are chosen from
/// all. Of more, each sample draws a few neighbours by a tree, and chooses from these.
class AreaLights {
 public:
  explicit AreaLights(std::vector<Emitter> emitters);

  /// Reports whether no triangle emits.
  [[nodiscard]] bool empty() const noexcept { return emitters_.empty(); }
  /// Draws samples whose irradiances, summed over those that the point sees, are an unbiased
  /// estimate of the light of all emitters.
  /// @param position  relative to the origin of the emitters
  /// @param normal    unit
  /// @param count     wanted samples
  /// @param first     number of the first sample among all of the seed, a multiple of `count`:
  ///                  points that share a seed have samples that are spread together
  /// @param out       is overwritten; it holds fewer than `count` samples when some cannot give
  ///                  light
  void sample(const glm::vec3& position, const glm::vec3& normal, unsigned count,
              std::uint64_t seed, std::uint32_t first, std::vector<EmitterSample>& out) const;

 private:
  /// A candidate for the choice at one point.
  struct Choice {
    std::uint32_t emitter = 0;
    double expected = 0;  ///< what the emitter may give to the point, in brightness
    double sum = 0;       ///< of the weights of the candidates up to and including this
  };
  /// Makes those of a range of emitters candidates that may give light to the point.
  /// @param weight  of what each may give
  void choose_from(std::uint32_t first, std::uint32_t end, double weight, const glm::vec3& position,
                   const glm::vec3& normal, std::vector<Choice>& out) const;
  /// Draws candidates by the tree.
  /// @param first  number of the first of the points on a line by which they are drawn
  /// @return       number in [0, 1) that the last draw leaves
  double choose_by_tree(const glm::vec3& position, const glm::vec3& normal,
                        const SquarePoints& points, std::uint32_t first, unsigned draws,
                        std::vector<Choice>& out) const;

  std::vector<Emitter> emitters_;
  EmitterTree tree_;  ///< of more than 64 emitters
};

}  // namespace ptc
