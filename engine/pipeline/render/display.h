// How the light of a picture is shown in 8 bits.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include <glm/vec3.hpp>

namespace ptc {

/// Maps light to what a screen shows, in [0, 1] (spec/shading.md#display).
struct Display {
  float gain = 1;   ///< by which light is multiplied
  float white = 1;  ///< what is shown as 1 after that; at 1 the map is linear

  /// Shows light at an exposure that was asked for, without a curve.
  /// @param stops  by which it is brightened
  [[nodiscard]] static Display at_exposure(float stops) noexcept;

  /// Maps pixels in place. Values above `white` become more than 1.
  /// @param light  W / (m^2 sr)
  void show(std::span<glm::vec3> light) const noexcept;
};

/// Measures the light of a picture, and chooses how it is shown so that at most one pixel in two
/// hundred is too bright.
/// Memory: 10 KiB.
class ExposureMeter {
 public:
  /// Adds pixels. Black ones do not count.
  void add(std::span<const glm::vec3> light) noexcept;
  /// Returns the display for all pixels so far; one that changes nothing when all are black.
  [[nodiscard]] Display display() const noexcept;

 private:
  static constexpr int kSteps = 16;  ///< bins of a stop
  static constexpr int kFirst = -40 * kSteps, kLast = 40 * kSteps;
  std::array<std::uint64_t, kLast - kFirst + 1>
      bins_{};  ///< by the logarithm of the brightest channel
  std::uint64_t pixels_ = 0;
  double logarithms_ = 0;  ///< sum over the pixels, to base 2
};

}  // namespace ptc
