// Separable filters over one channel of a picture, which continues beyond its edges as it ends.
#pragma once

#include <cstddef>
#include <vector>

namespace ptc {

/// One value a pixel, row by row from the top.
struct Plane {
  std::size_t width = 0;
  std::size_t height = 0;
  std::vector<float> values;
};

/// Weights of 2 r + 1 neighbours in a row, the pixel itself in the middle.
struct Kernel {
  std::vector<float> weights;
  float sum = 0;  ///< of the weights: 1 keeps flat areas, 0 removes them
};

/// exp(-x^2 / 2 sigma^2), scaled so that it sums to 1.
/// @param sigma  pixels, above 0
/// @param radius  pixels
[[nodiscard]] Kernel gaussian(double sigma, std::size_t radius);

/// Sum of exp(-x^2 / 2 sigma^2) over -radius to radius: what gaussian() divides by.
[[nodiscard]] double gaussian_sum(double sigma, std::size_t radius);

/// Its first derivative up to sign, -x exp(...), scaled so that a step of height 1 answers 1.
[[nodiscard]] Kernel first_derivative(double sigma, std::size_t radius);

/// Its second derivative, (x^2 / sigma^2 - 1) exp(...); weights below 0 sum to -1, the others to 1.
[[nodiscard]] Kernel second_derivative(double sigma, std::size_t radius);

/// The sums along rows, or along columns. Flat areas answer kernel.sum times their value exactly,
/// without rounding.
[[nodiscard]] Plane filter_rows(const Plane& plane, const Kernel& kernel);
[[nodiscard]] Plane filter_columns(const Plane& plane, const Kernel& kernel);

}  // namespace ptc
