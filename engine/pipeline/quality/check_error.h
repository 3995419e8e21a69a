// The errors of shaded receivers against rays, as reports give them.
#pragma once

#include <algorithm>
#include <cmath>

namespace ptc {

/// The errors of a set of receivers: the results of the gather minus those of the rays. The noise
/// of the rays is reported separately and is not part of the errors.
struct CheckError {
  double occlusion_rms = 0;     ///< root mean square, absolute: occlusion goes from 0 to 1
  double occlusion_bias = 0;    ///< mean, absolute
  double occlusion_mean = 0;    ///< mean occlusion by the rays
  double occlusion_noise = 0;   ///< root mean square error of the rays, absolute
  double irradiance_rms = 0;    ///< root mean square over receivers and RGB, over irradiance_mean
  double irradiance_bias = 0;   ///< mean, over irradiance_mean
  double irradiance_mean = 0;   ///< mean irradiance by the rays over receivers and RGB, W / m^2
  double irradiance_noise = 0;  ///< root mean square error of the rays, over irradiance_mean
  double sky_mean = 0;          ///< mean light from the sky by the rays, as irradiance_mean

  /// The error that a user asks for: the largest of the errors of occlusion and irradiance, each
  /// over its mean, and of the light that the sky sends through what is open, over the mean light.
  /// Occlusion alone counts where no light arrives.
  [[nodiscard]] double relative() const noexcept { return largest(occlusion_rms, irradiance_rms); }
  /// The noise of the rays, measured as relative() measures the error.
  [[nodiscard]] double relative_noise() const noexcept {
    return largest(occlusion_noise, irradiance_noise);
  }

 private:
  /// Returns the largest of the errors that relative() names. The sky's light is taken to be off by
  /// as large a share as what is open: rays at a picture with a sun are too noisy to measure it.
  [[nodiscard]] double largest(double occlusion, double irradiance) const noexcept {
    const double light = sky_mean + irradiance_mean, open = 1 - occlusion_mean;
    const double of_sky = light > 0 && open > 0 ? occlusion / open * sky_mean / light : 0.0;
    return std::max({occlusion_mean > 0 ? occlusion / occlusion_mean : 0.0, irradiance, of_sky});
  }
};

/// Returns the errors of two sets of receivers together.
/// @param a_count, b_count  receivers of each set, not both 0
[[nodiscard]] inline CheckError pooled(const CheckError& a, double a_count, const CheckError& b,
                                       double b_count) noexcept {
  const double share = b_count / (a_count + b_count);
  const auto mean = [share](double x, double y) { return x + share * (y - x); };
  const auto rms = [&](double x, double y) { return std::sqrt(mean(x * x, y * y)); };
  CheckError sum;
  sum.occlusion_rms = rms(a.occlusion_rms, b.occlusion_rms);
  sum.occlusion_bias = mean(a.occlusion_bias, b.occlusion_bias);
  sum.occlusion_mean = mean(a.occlusion_mean, b.occlusion_mean);
  sum.occlusion_noise = rms(a.occlusion_noise, b.occlusion_noise);
  // Errors of irradiance are shares of the mean
  sum.irradiance_mean = mean(a.irradiance_mean, b.irradiance_mean);
  sum.sky_mean = mean(a.sky_mean, b.sky_mean);
  const double whole = sum.irradiance_mean > 0 ? sum.irradiance_mean : 1;
  const auto of = [whole](double error, const CheckError& part) {
    return error * part.irradiance_mean / whole;
  };
  sum.irradiance_rms = rms(of(a.irradiance_rms, a), of(b.irradiance_rms, b));
  sum.irradiance_bias = mean(of(a.irradiance_bias, a), of(b.irradiance_bias, b));
  sum.irradiance_noise = rms(of(a.irradiance_noise, a), of(b.irradiance_noise, b));
  return sum;
}

}  // namespace ptc
