// Errors of shaded receivers against rays, free of the noise of the rays.
#pragma once

#include <span>
#include <vector>

#include "engine/pipeline/quality/check_error.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Returns every receiver twice, side by side. The two are traced with different seeds, which makes
/// their results independent.
[[nodiscard]] std::vector<Receiver> two_of_each(std::span<const Receiver> receivers);

/// Sums of errors over receivers, each of which was shaded by the gather and traced twice.
///
/// Let `ours` be the result of the gather and a, b two results by rays that are independent and
/// unbiased. The expected value of (ours - a) (ours - b) is then the squared error of the gather
/// alone: the noise of a and of b cancels, because neither is squared. The expected value of
/// (a - b)^2 / 4 is the squared error of the mean (a + b) / 2.
class ErrorSums {
 public:
  /// Adds a receiver.
  /// @param a, b    its results by rays of different seeds
  /// @param weight  how many receivers it stands for
  void add(const Shading& ours, const Shading& a, const Shading& b, double weight = 1);
  /// Adds the receivers of other sums.
  void add(const ErrorSums& other);
  /// Returns the errors over all receivers; zeros when there are none.
  [[nodiscard]] CheckError error() const;

 private:
  /// Weighted sums for one quantity: squared errors, errors, squared noise and values by rays.
  struct Quantity {
    double square = 0, difference = 0, noise = 0, mean = 0;

    void add(double ours, double a, double b, double weight);
    void add(const Quantity& other);
  };

  double receivers_ = 0;
  Quantity occlusion_, irradiance_;
  double sky_ = 0;  ///< light from the sky by the rays, mean over RGB, summed
};

}  // namespace ptc
