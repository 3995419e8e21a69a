// What a node could hold of its surfels' areas and radiance, and what each way of it costs.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/surfel.h"
#include "format/node_page.h"

namespace ptc::bench {

/// A cluster as it is seen from a direction.
struct Seen {
  float front = 0;        ///< projected area of what faces it, scene units squared
  float back = 0;         ///< likewise of what faces away
  glm::vec3 radiance{0};  ///< mean over `front`
};

/// A way to describe a cluster by a few numbers.
struct Payload {
  const char* name;
  /// Of the stored form, a letter for each of: u ufloat16, n unorm16, h half; o octahedral8 and c
  /// rgbe take three numbers.
  std::string fields;
  /// @param below  the surfels of the node   @param out  count() numbers
  void (*fit)(const NodeSummary& node, std::span<const Surfel> below, float* out);
  /// @param toward  unit, from the cluster to who sees it
  Seen (*see)(const float* numbers, const glm::vec3& toward);

  [[nodiscard]] std::size_t count() const;         ///< of numbers
  [[nodiscard]] std::size_t stored_bytes() const;  ///< of all fields
  /// Rounds the numbers to what is stored.
  void round(float* numbers) const;
};

/// In the order of charts: a surfel, two lobes, the vector model, the cube of spec/nodes.md,
/// spherical harmonics up to degree 0, 1, 2 and 4 (a clamped cosine has none of degree 3).
[[nodiscard]] const std::vector<Payload>& payloads();

/// What payloads approximate: the sum over all surfels of the node, none in front of another.
[[nodiscard]] Seen see_exactly(std::span<const Surfel> below, const glm::vec3& toward);

/// Real spherical harmonics up to a degree, from -l to l for each, scaled so that the sum of
/// R_lm(a) R_lm(b) over m is the Legendre polynomial of a . b.
/// @param degree  at most 4   @param out  (degree + 1)^2 numbers
void spherical_harmonics(std::size_t degree, const glm::vec3& unit, float* out);

}  // namespace ptc::bench
