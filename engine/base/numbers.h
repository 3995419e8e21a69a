// Numbers that all layers share: pi, and the SplitMix64 generator, which also serves as a hash.
#pragma once

#include <cstdint>
#include <numbers>

namespace ptc {

inline constexpr float kPi = std::numbers::pi_v<float>;
inline constexpr double kPiDouble = std::numbers::pi;

/// The step by which SplitMix64 advances its state.
inline constexpr std::uint64_t kSplitMixStep = 0x9e3779b97f4a7c15;

/// Returns the output of SplitMix64 that follows `state`. Neighbouring states give unrelated
/// numbers, so it serves as a hash, too. A stream of numbers adds kSplitMixStep to its state each
/// time.
/// Source: Steele, Lea and Flood 2014, Fast splittable pseudorandom number generators.
[[nodiscard]] constexpr std::uint64_t splitmix64(std::uint64_t state) noexcept {
  std::uint64_t z = state + kSplitMixStep;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
  return z ^ (z >> 31);
}

}  // namespace ptc
