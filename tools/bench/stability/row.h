// The table of stability: scenes in which the method, or others like it, fail, with figures and
// bounds.
//
//   Row::measure() -> Outcome: figures with their bounds, and a field of values beside the truth
#pragma once

#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "tools/bench/stability/lab.h"

namespace ptc::bench {

/// A number that a row measures, and the most that it may be.
struct Bounded {
  std::string what;   ///< what is measured, a few words
  double value = 0;   ///< 0 is right; a value that is no number is beyond every bound
  double bound = 0;   ///< the most that counts as right
  bool share = true;  ///< whether the number is a share, which tables show in percent

  /// Says whether the value keeps to its bound.
  [[nodiscard]] bool holds() const noexcept { return value <= bound; }
};

/// Values at a grid of receivers beside the true ones, row by row from the top: a small picture.
struct Field {
  unsigned width = 0, height = 0;
  std::vector<glm::vec3> ours, truth;  ///< 0 is shown black, and 1 white

  /// Adds rows of values of shadings to `ours`. @pre `width` divides their number
  void add(std::span<const Shading> shadings, glm::vec3 (*value)(const Shading&));
  /// Returns the greatest difference of both in any channel.
  [[nodiscard]] double largest_error() const { return largest_difference(ours, truth); }
  /// Returns the root mean square of their differences in all channels.
  [[nodiscard]] double rms_error() const { return rms_difference(ours, truth); }
};

/// What a row found.
struct Outcome {
  std::vector<Bounded> figures;
  Field field;
};

/// A scene with a known answer.
struct Row {
  const char* number;   ///< of the failure, as spec/shading.md#stability counts them
  const char* scene;    ///< the scene, a few words
  const char* failure;  ///< what is seen where a method fails, a few words
  Outcome (*measure)(const Lab& lab);
};

/// Rows in which surfaces meet, touch or overlap.
[[nodiscard]] std::span<const Row> rows_of_contacts();
/// Rows of single discs, direction pixels and cells.
[[nodiscard]] std::span<const Row> rows_of_pixels();
/// Rows of walls that have to keep light out, or show each side its own.
[[nodiscard]] std::span<const Row> rows_of_walls();
/// Rows in which something moves.
[[nodiscard]] std::span<const Row> rows_of_motion();
/// Rows of pictures whose camera or objects move.
[[nodiscard]] std::span<const Row> rows_of_pictures();
/// Rows of seams in pictures.
[[nodiscard]] std::span<const Row> rows_of_seams();
/// Rows of inputs that are odd, huge or turned.
[[nodiscard]] std::span<const Row> rows_of_inputs();

/// Returns the rows of all kinds, in the order of their numbers.
[[nodiscard]] std::vector<Row> all_rows();

}  // namespace ptc::bench
