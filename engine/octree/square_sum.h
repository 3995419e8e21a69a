// An exact sum of squares, the same for the terms in any order and in any parts.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "engine/io/file/state_file.h"

namespace ptc {

/// The sum of the squares of floats, without rounding: one file and the parts of a scene record the
/// same area to the last bit, wherever the points are cut.
///
/// A float is m 2^e with m below 2^24. For each of the 256 exponents that its bits can say there is
/// a sum of m^2, a whole number of 128 bits.
class SquareSum {
 public:
  /// Adds the square of a number. @param value  finite and not negative
  void add(float value) noexcept {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    const std::size_t exponent = bits >> kFraction & 0xff;
    const std::uint64_t hidden = exponent > 0 ? std::uint64_t{1} << kFraction : 0;
    const std::uint64_t m = hidden | (bits & ((1U << kFraction) - 1));
    add(sums_[exponent], {m * m, 0});
  }
  /// Adds another sum.
  void add(const SquareSum& other) noexcept {
    for (std::size_t i = 0; i < kExponents; ++i) add(sums_[i], other.sums_[i]);
  }
  /// Returns the sum, rounded. It depends on the terms alone; the relative error is below 2^-44.
  [[nodiscard]] double value() const noexcept;

  /// Saves the sum.
  void save(StateWriter& state) const;
  /// Loads a sum that save() saved.
  void load(StateReader& state);

 private:
  static constexpr unsigned kFraction = 23;       // stored bits of a float behind its point
  static constexpr std::size_t kExponents = 256;  // the last is that of infinity
  using Wide = std::array<std::uint64_t, 2>;      // low half first

  static void add(Wide& sum, const Wide& term) noexcept {
    sum[0] += term[0];
    sum[1] += term[1] + (sum[0] < term[0] ? 1 : 0);
  }

  std::array<Wide, kExponents> sums_{};
};

}  // namespace ptc
