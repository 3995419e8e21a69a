// Payloads: ways in which a node could describe the areas and the radiance of its surfels, to be
// compared by error, bytes and time.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/surfel.h"
#include "format/node_page.h"

namespace ptc::bench {

/// What is seen of a cluster from one direction.
struct Seen {
  float front = 0;        ///< projected area of the surfels that face it, scene units squared
  float back = 0;         ///< projected area of the surfels that face away, scene units squared
  glm::vec3 radiance{0};  ///< mean over the area `front`
};

/// A way to describe a cluster by a few numbers.
struct Payload {
  const char* name;
  /// A letter for each field of the stored form: u ufloat16, n unorm16, h half for one number, and
  /// o octahedral8, c rgbe for three numbers.
  std::string fields;
  /// Describes a node. @param below  its surfels   @param out  takes count() numbers
  void (*fit)(const NodeSummary& node, std::span<const Surfel> below, float* out);
  /// Returns what is seen of the node.
  /// @param toward  unit vector from the cluster to the viewer
  Seen (*see)(const float* numbers, const glm::vec3& toward);

  [[nodiscard]] std::size_t count() const;         ///< numbers in all fields
  [[nodiscard]] std::size_t stored_bytes() const;  ///< bytes of all fields
  /// Rounds the numbers to the values that their stored form holds.
  void round(float* numbers) const;
};

/// All payloads in the order of charts: a surfel, two lobes, the vector model, the cube of
/// spec/nodes.md, and spherical harmonics up to degree 0, 1, 2 and 4 (a clamped cosine has no part
/// of degree 3).
[[nodiscard]] const std::vector<Payload>& payloads();

/// Sums over all surfels of the node as if none were in front of another. Payloads approximate
/// this.
[[nodiscard]] Seen see_exactly(std::span<const Surfel> below, const glm::vec3& toward);

/// Evaluates real spherical harmonics up to a degree, for each degree l in the order m = -l to l,
/// scaled so that the sum of
/// R_lm(a) R_lm(b) over m is the Legendre polynomial of a . b.
/// @param degree  at most 4   @param out  (degree + 1)^2 numbers
void spherical_harmonics(std::size_t degree, const glm::vec3& unit, float* out);

}  // namespace ptc::bench
