// Emissive triangles as lights: places on them that shadow rays aim at.
#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/low_discrepancy.h"
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
/// solid angle times the cosine there. When there are at most 64 emitters, all of them are
/// candidates. Of more, 64 candidates are drawn by power for each point (resampled importance
/// sampling: Talbot, Cline and Egbert 2005).
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
    double sum = 0;       ///< sum of the weights of the candidates up to and including this
  };
  /// Makes every emitter that may give light to the point a candidate.
  void choose_all(const glm::vec3& position, const glm::vec3& normal,
                  std::vector<Choice>& out) const;
  /// Draws the candidates by power, and keeps those that may give light to the point.
  void choose_by_power(const glm::vec3& position, const glm::vec3& normal, std::uint64_t seed,
                       std::vector<Choice>& out) const;
  /// Returns the emitter that a number in [0, 1) picks in proportion to power.
  [[nodiscard]] std::uint32_t draw(double unit) const;

  std::vector<Emitter> emitters_;
  /// A column of Walker's alias table: it keeps its own emitter up to `keep`, and gives the rest to
  /// another.
  ///
  ///     1 +-----+-----+-----+
  ///       |  2  |  2  |     |     Three emitters of powers 0.4, 0.6 and 2 times the mean: each
  ///       |.....|.....|  2  |     column has the height 1, and columns 0 and 1 are filled up with
  ///       |  0  |  1  |     |     what emitter 2 has in excess.
  ///     0 +-----+-----+-----+
  struct Column {
    float keep = 1;           ///< share of the column's own emitter, in (0, 1]
    std::uint32_t other = 0;  ///< the emitter that has the rest
  };
  std::vector<Column> table_;  ///< a column for each emitter
  std::vector<float> share_;   ///< share of the total power, for each emitter
};

}  // namespace ptc
