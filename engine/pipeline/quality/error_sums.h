// Errors of shaded receivers against rays, without what the rays themselves are off.
#pragma once

#include <span>
#include <vector>

#include "engine/pipeline/quality/check_error.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Every receiver twice, side by side: rays of different seeds are independent.
[[nodiscard]] std::vector<Receiver> two_of_each(std::span<const Receiver> receivers);

/// Leaves out light from surfaces: what a gather without bleeding is compared with.
void leave_out_bleeding(std::span<Shading> traced);

/// Sums over receivers, each shaded by us and twice by rays.
///
/// With a and b independent and right in the mean, (ours - a) (ours - b) is in the mean the square
/// of our error alone, and (a - b)^2 / 4 that of (a + b) / 2.
class ErrorSums {
 public:
  /// @param a, b  by rays, of different seeds
  void add(const Shading& ours, const Shading& a, const Shading& b);
  void add(const ErrorSums& other);
  /// Zeros of no receivers.
  [[nodiscard]] CheckError error() const;

 private:
  struct Quantity {
    double square = 0, difference = 0, noise = 0, mean = 0;

    void add(double ours, double a, double b, double weight);
    void add(const Quantity& other);
  };

  double receivers_ = 0;
  Quantity occlusion_, irradiance_;
};

}  // namespace ptc
