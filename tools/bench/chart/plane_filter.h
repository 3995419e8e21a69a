// Separable filters over one channel of a picture. Beyond the edges, the outermost pixels are
// repeated.
#pragma once

#include <cstddef>
#include <vector>

namespace ptc {

/// One channel of a picture: a value for each pixel, row by row from the top.
struct Plane {
  std::size_t width = 0;
  std::size_t height = 0;
  std::vector<float> values;
};

/// The weights of 2 r + 1 neighbours in a row, the pixel itself in the middle.
struct Kernel {
  std::vector<float> weights;
  float sum = 0;  ///< sum of the weights: 1 keeps flat areas, 0 removes them
};

/// The Gaussian exp(-x^2 / 2 sigma^2), scaled so that its weights sum to 1.
/// @param sigma  pixels, above 0
/// @param radius  pixels
[[nodiscard]] Kernel gaussian(double sigma, std::size_t radius);

/// The sum of exp(-x^2 / 2 sigma^2) from -radius to radius, by which gaussian() divides.
[[nodiscard]] double gaussian_sum(double sigma, std::size_t radius);

/// The first derivative of the Gaussian up to a factor, -x exp(-x^2 / 2 sigma^2), scaled so that
/// the response to a step of height 1 is 1.
[[nodiscard]] Kernel first_derivative(double sigma, std::size_t radius);

/// The second derivative of the Gaussian up to a factor, (x^2 / sigma^2 - 1) exp(-x^2 / 2 sigma^2),
/// scaled so that the weights below 0 sum to -1 and the others to 1.
[[nodiscard]] Kernel second_derivative(double sigma, std::size_t radius);

/// Filters along rows. A flat area gives exactly kernel.sum times its value, without rounding.
[[nodiscard]] Plane filter_rows(const Plane& plane, const Kernel& kernel);
/// Filters along columns. A flat area gives exactly kernel.sum times its value, without rounding.
[[nodiscard]] Plane filter_columns(const Plane& plane, const Kernel& kernel);

}  // namespace ptc
