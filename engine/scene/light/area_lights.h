// The emissive triangles of a mesh as lights.
#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/io/mesh/mesh.h"
#include "engine/scene/sampling/low_discrepancy.h"

namespace ptc {

/// A triangle that emits on its front side. Coordinates are relative to Mesh::origin.
struct Emitter {
  glm::vec3 corner[3];
  glm::vec3 radiance{0};
};

/// A place on an emitter to which a shadow ray goes.
struct EmitterSample {
  glm::vec3 position{0};    ///< relative to Mesh::origin
  glm::vec3 normal{0};      ///< unit, of the emitting side
  glm::vec3 irradiance{0};  ///< that the point gets by this sample when nothing is between
};

/// Chooses emitters by what each may give to a point: its brightness, its solid angle and the
/// cosine there. Up to 64 emitters all stand for choice; of more, 64 are drawn by power for each
/// point (resampled importance sampling: Talbot, Cline and Egbert 2005).
class AreaLights {
 public:
  explicit AreaLights(const Mesh& mesh);

  [[nodiscard]] bool empty() const noexcept { return emitters_.empty(); }
  /// `count` samples whose irradiances, where seen, sum up to an unbiased estimate.
  /// @param position  relative to Mesh::origin
  /// @param out       is overwritten; fewer than `count` when some cannot give light
  void sample(const glm::vec3& position, const glm::vec3& normal, unsigned count,
              std::uint64_t seed, std::vector<EmitterSample>& out) const;

 private:
  struct Choice {
    std::uint32_t emitter = 0;
    double expected = 0;  // what it may give, in brightness
    double sum = 0;       // of the weights up to and including this
  };
  void choose_all(const glm::vec3& position, const glm::vec3& normal,
                  std::vector<Choice>& out) const;
  void choose_by_power(const glm::vec3& position, const glm::vec3& normal, std::uint64_t seed,
                       std::vector<Choice>& out) const;
  [[nodiscard]] std::uint32_t draw(double unit) const;

  std::vector<Emitter> emitters_;
  // Walker's alias table: a column keeps its own emitter up to `keep`, and gives the rest to
  // another.
  struct Column {
    float keep = 1;
    std::uint32_t other = 0;
  };
  std::vector<Column> table_;
  std::vector<float> share_;  // of the total power
};

}  // namespace ptc
