#include "engine/pipeline/quality/error_sums.h"

#include <algorithm>
#include <cmath>

namespace ptc {

std::vector<Receiver> two_of_each(std::span<const Receiver> receivers) {
  std::vector<Receiver> twice;
  for (const Receiver& receiver : receivers) twice.insert(twice.end(), 2, receiver);
  return twice;
}

void ErrorSums::Quantity::add(double ours, double a, double b, double weight) {
  square += weight * (ours - a) * (ours - b);
  difference += weight * (ours - (a + b) / 2);
  noise += weight * (a - b) * (a - b) / 4;
  mean += weight * (a + b) / 2;
}

void ErrorSums::Quantity::add(const Quantity& other) {
  square += other.square;
  difference += other.difference;
  noise += other.noise;
  mean += other.mean;
}

void ErrorSums::add(const Shading& ours, const Shading& a, const Shading& b, double weight) {
  const auto value = [](float v) { return static_cast<double>(v); };
  receivers_ += weight;
  occlusion_.add(value(ours.occlusion), value(a.occlusion), value(b.occlusion), weight);
  for (int c = 0; c < 3; ++c) {
    irradiance_.add(value(ours.irradiance[c]), value(a.irradiance[c]), value(b.irradiance[c]),
                    weight / 3);
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

}  // namespace ptc
