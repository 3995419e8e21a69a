// FLIP a second time, to compare with: in double, straight from the paper, nothing separated.
#pragma once

#include <vector>

#include "engine/io/image/image.h"

namespace ptc {

/// Two-dimensional sums over every neighbour. @param test  values in [0, 1]
[[nodiscard]] std::vector<double> flip_oracle(const Image& test, const Image& reference,
                                              double pixels_per_degree);

}  // namespace ptc
