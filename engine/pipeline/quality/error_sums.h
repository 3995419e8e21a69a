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
  void add(const Shading& ours, const Shading& a, const Shading& b, double weight = 1) {
    add(ours, a, ours, b, weight);
  }
  /// Adds a receiver whose own results come from rays, too, along the directions of `a` and of `b`:
  /// the noise that they share with those is no part of the differences.
  void add(const Shading& ours_a, const Shading& a, const Shading& ours_b, const Shading& b,
           double weight = 1);
  /// Adds the receivers of other sums.
  void add(const ErrorSums& other);
  /// Returns the errors over all receivers; zeros when there are none.
  [[nodiscard]] CheckError error() const;

 private:
  /// Weighted sums for one quantity: squared errors, errors, squared noise and values by rays.
  struct Quantity {
    double square = 0, difference = 0, noise = 0, mean = 0;

    void add(double ours_a, double a, double ours_b, double b, double weight);
    void add(const Quantity& other);
  };

  double receivers_ = 0;
  Quantity occlusion_, irradiance_;
  double sky_ = 0;  ///< light from the sky by the rays, mean over RGB, summed
};

/// An error of a sample of receivers, and its bounds as CheckError::relative() at a confidence of
/// 90 %: one in 20 resamples of the sample has a lower error than `low`, and one in 20 a higher one
/// than `high`.
struct BoundedError {
  CheckError error;
  double low = 0, high = 0;
};

/// Returns the error of all parts of a sample, with bounds by resamples of the parts with
/// replacement (Efron 1979); zeros when there are no parts.
[[nodiscard]] BoundedError bounded_error(std::span<const ErrorSums> parts);

}  // namespace ptc
