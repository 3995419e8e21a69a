// A second FLIP to compare with: in double, straight from the paper, without separable filters.
#pragma once

#include <vector>

#include "engine/io/image/image.h"

namespace ptc {

/// Returns the error of every pixel by two-dimensional sums over all neighbours.
/// @param test  values in [0, 1]
[[nodiscard]] std::vector<double> flip_oracle(const Image& test, const Image& reference,
                                              double pixels_per_degree);

}  // namespace ptc
