// The errors of shaded receivers against rays, as reports give them.
#pragma once

#include <algorithm>

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

}  // namespace ptc
