// How different two pictures look to somebody who switches between them.
#pragma once

#include <vector>

#include "engine/io/image/image.h"

namespace ptc {

/// A monitor of 3840 pixels and 0.7 m across, seen from 0.7 m.
inline constexpr float kPixelsPerDegree = 67;

/// LDR-FLIP: visible difference of every pixel, 0 for none to 1 for blue against green.
///
/// Both pictures are clamped to [0, 1] first, what is no number to 0, and continue beyond their
/// edges as their outermost pixels do. The order of the two does not matter.
/// @param pixels_per_degree  of visual angle, 1 to 1000: more from farther away
/// @return       row by row from the top, 0 exactly where all pixels around are equal
/// @throws std::invalid_argument when sizes differ, do not fit the pixels or are 0, or
///         pixels_per_degree is out of range
/// Memory: about 80 bytes a pixel.
/// Source: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom and Fairchild 2020, "FLIP: A
///         Difference Evaluator for Alternating Images".
[[nodiscard]] std::vector<float> flip(const Image& test, const Image& reference,
                                      float pixels_per_degree = kPixelsPerDegree);

/// Mean of flip() over the picture.
[[nodiscard]] double mean_flip(const Image& test, const Image& reference,
                               float pixels_per_degree = kPixelsPerDegree);

}  // namespace ptc
