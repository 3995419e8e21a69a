#include "engine/pipeline/quality/error_sums.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace ptc {
namespace {

// Number of resamples, and the sorted ones whose errors are the bounds: the errors of 19 in 20
// resamples are below the upper one, and of 19 in 20 above the lower one
constexpr unsigned kResamples = 200;
constexpr unsigned kHigh = 190, kLow = kResamples - 1 - kHigh;

}  // namespace

std::vector<Receiver> two_of_each(std::span<const Receiver> receivers) {
  std::vector<Receiver> twice;
  for (const Receiver& receiver : receivers) twice.insert(twice.end(), 2, receiver);
  return twice;
}

void ErrorSums::Quantity::add(double ours_a, double a, double ours_b, double b, double weight) {
  const double off_a = ours_a - a, off_b = ours_b - b;
  square += weight * off_a * off_b;
  difference += weight * (off_a + off_b) / 2;
  noise += weight * (off_a - off_b) * (off_a - off_b) / 4;
  mean += weight * (a + b) / 2;
}

void ErrorSums::Quantity::add(const Quantity& other) {
  square += other.square;
  difference += other.difference;
  noise += other.noise;
  mean += other.mean;
}

void ErrorSums::add(const Shading& ours_a, const Shading& a, const Shading& ours_b,
                    const Shading& b, double weight) {
  const auto value = [](float v) { return static_cast<double>(v); };
  receivers_ += weight;
  occlusion_.add(value(ours_a.occlusion), value(a.occlusion), value(ours_b.occlusion),
                 value(b.occlusion), weight);
  for (int c = 0; c < 3; ++c) {
    irradiance_.add(value(ours_a.irradiance[c]), value(a.irradiance[c]),
                    value(ours_b.irradiance[c]), value(b.irradiance[c]), weight / 3);
    sky_ += weight * (value(a.sky[c]) + value(b.sky[c])) / 6;
  }
}

void ErrorSums::add(const ErrorSums& other) {
  receivers_ += other.receivers_;
  occlusion_.add(other.occlusion_);
  irradiance_.add(other.irradiance_);
  sky_ += other.sky_;
}

CheckError ErrorSums::error() const {
  if (receivers_ == 0) return {};
  const auto rms = [&](double squares) { return std::sqrt(std::max(0.0, squares) / receivers_); };
  CheckError e{.occlusion_rms = rms(occlusion_.square),
               .occlusion_bias = occlusion_.difference / receivers_,
               .occlusion_mean = occlusion_.mean / receivers_,
               .occlusion_noise = rms(occlusion_.noise),
               .irradiance_mean = irradiance_.mean / receivers_,
               .sky_mean = sky_ / receivers_};
  if (e.irradiance_mean > 0) {
    e.irradiance_rms = rms(irradiance_.square) / e.irradiance_mean;
    e.irradiance_bias = irradiance_.difference / receivers_ / e.irradiance_mean;
    e.irradiance_noise = rms(irradiance_.noise) / e.irradiance_mean;
  }
  return e;
}

BoundedError bounded_error(std::span<const ErrorSums> parts) {
  if (parts.empty()) return {};
  ErrorSums all;
  for (const ErrorSums& part : parts) all.add(part);
  std::mt19937_64 bits;  // with its default seed, so that the bounds are the same each time
  std::vector<double> samples(kResamples);
  for (double& sample : samples) {
    ErrorSums sums;
    for (std::size_t i = 0; i < parts.size(); ++i) sums.add(parts[bits() % parts.size()]);
    sample = sums.error().relative();
  }
  std::ranges::sort(samples);
  return {all.error(), samples[kLow], samples[kHigh]};
}

}  // namespace ptc
