#include "tools/bench/chart/plane_filter.h"

#include <algorithm>
#include <cmath>

namespace ptc {
namespace {

// The values exp(-x^2 / 2 sigma^2) for x from -radius to radius.
std::vector<double> bell(double sigma, std::size_t radius) {
  std::vector<double> values;
  for (std::size_t i = 0; i <= 2 * radius; ++i) {
    const double x = static_cast<double>(i) - static_cast<double>(radius);
    values.push_back(std::exp(-x * x / (2 * sigma * sigma)));
  }
  return values;
}

double sum_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum;
}

Kernel divided(const std::vector<double>& values, double by) {
  Kernel kernel{.sum = 1};
  for (const double value : values) kernel.weights.push_back(static_cast<float>(value / by));
  return kernel;
}

// Scales weights so that those above 0 sum to 1 and those below 0 to -1.
Kernel balanced(const std::vector<double>& values) {
  double above = 0;
  double below = 0;
  for (const double value : values) (value > 0 ? above : below) += value;
  Kernel kernel;
  for (const double value : values) {
    const double share = value > 0 ? value / above : (value < 0 ? -value / below : 0);
    kernel.weights.push_back(static_cast<float>(share));
  }
  return kernel;
}

// Filters compute kernel.sum * centre + sum of weight * (neighbour - centre). This equals the usual
// sum, but leaves no rounding error where all neighbours are equal; a later root would magnify it.
void begin(const float* centre, float sum, float* out, std::size_t count) {
  for (std::size_t x = 0; x < count; ++x) out[x] = sum * centre[x];
}

void add(const float* neighbour, const float* centre, float weight, float* out, std::size_t count) {
  for (std::size_t x = 0; x < count; ++x) out[x] += weight * (neighbour[x] - centre[x]);
}

}  // namespace

Kernel gaussian(double sigma, std::size_t radius) {
  return divided(bell(sigma, radius), gaussian_sum(sigma, radius));
}

double gaussian_sum(double sigma, std::size_t radius) {
  return sum_of(bell(sigma, radius));
}

Kernel first_derivative(double sigma, std::size_t radius) {
  std::vector<double> values = bell(sigma, radius);
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] *= static_cast<double>(radius) - static_cast<double>(i);
  }
  return balanced(values);
}

Kernel second_derivative(double sigma, std::size_t radius) {
  std::vector<double> values = bell(sigma, radius);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double x = static_cast<double>(i) - static_cast<double>(radius);
    values[i] *= x * x / (sigma * sigma) - 1;
  }
  return balanced(values);
}

Plane filter_rows(const Plane& plane, const Kernel& kernel) {
  const std::size_t radius = kernel.weights.size() / 2;
  Plane result{plane.width, plane.height, std::vector<float>(plane.values.size())};
  std::vector<float> row(plane.width + 2 * radius);
  for (std::size_t y = 0; y < plane.height; ++y) {
    const float* from = &plane.values[y * plane.width];
    std::fill_n(row.begin(), radius, from[0]);
    std::copy_n(from, plane.width, row.begin() + static_cast<std::ptrdiff_t>(radius));
    std::fill_n(row.end() - static_cast<std::ptrdiff_t>(radius), radius, from[plane.width - 1]);
    float* out = &result.values[y * plane.width];
    begin(from, kernel.sum, out, plane.width);
    for (std::size_t i = 0; i < kernel.weights.size(); ++i) {
      add(&row[i], from, kernel.weights[i], out, plane.width);
    }
  }
  return result;
}

Plane filter_columns(const Plane& plane, const Kernel& kernel) {
  const std::size_t radius = kernel.weights.size() / 2;
  Plane result{plane.width, plane.height, std::vector<float>(plane.values.size())};
  for (std::size_t y = 0; y < plane.height; ++y) {
    const float* centre = &plane.values[y * plane.width];
    float* out = &result.values[y * plane.width];
    begin(centre, kernel.sum, out, plane.width);
    for (std::size_t i = 0; i < kernel.weights.size(); ++i) {
      const std::size_t below = std::max(y + i, radius) - radius;
      const std::size_t row = std::min(below, plane.height - 1);
      add(&plane.values[row * plane.width], centre, kernel.weights[i], out, plane.width);
    }
  }
  return result;
}

}  // namespace ptc
