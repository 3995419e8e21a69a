// How different two pictures look to a person who switches between them.
#pragma once

#include <vector>

#include "engine/io/image/image.h"

namespace ptc {

/// Pixels per degree of visual angle on a monitor 3840 pixels and 0.7 m wide, seen from 0.7 m.
inline constexpr float kPixelsPerDegree = 67;

/// Computes LDR-FLIP: the visible difference of every pixel, from 0 for none to 1 for blue against
/// green.
///
/// Both pictures are clamped to [0, 1] first, NaN to 0, and their outermost pixels are repeated
/// beyond the edges. The result does not depend on which of the two is the reference.
/// @param pixels_per_degree  of visual angle, 1 to 1000: the more, the farther away the viewer is
/// @return       differences row by row from the top, exactly 0 where all pixels around are equal
/// @throws std::invalid_argument when sizes differ, do not fit the pixels or are 0, or
///         pixels_per_degree is out of range
/// Memory: about 80 bytes a pixel.
/// Source: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom and Fairchild 2020, "FLIP: A
///         Difference Evaluator for Alternating Images".
[[nodiscard]] std::vector<float> flip(const Image& test, const Image& reference,
                                      float pixels_per_degree = kPixelsPerDegree);

/// Computes HDR-FLIP: the greatest flip() of each pixel over the exposures at which a person may
/// look, from one that shows the brightest pixel of the reference to one that shows its median
/// pixel. Both pictures are tone-mapped at each of them.
///
/// The exposures are about a stop apart. Twice the light in both pictures gives the same result.
/// @return       differences as flip() does; 0 everywhere where the reference is black
/// @throws std::invalid_argument as flip() does
/// Source: Andersson, Nilsson, Shirley and Akenine-Moller 2021, "Visualizing Errors in Rendered
/// High
///         Dynamic Range Images"; the tone mapper is the fit of Narkowicz 2016 to ACES.
[[nodiscard]] std::vector<float> hdr_flip(const Image& test, const Image& reference,
                                          float pixels_per_degree = kPixelsPerDegree);

/// The mean of the values of flip() or hdr_flip().
[[nodiscard]] double mean_of(const std::vector<float>& errors);

/// The mean of flip() over the picture.
[[nodiscard]] double mean_flip(const Image& test, const Image& reference,
                               float pixels_per_degree = kPixelsPerDegree);

}  // namespace ptc
