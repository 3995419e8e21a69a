// Sample points that fill the unit square evenly, scrambled by a seed.
//
// The Sobol sequence in two dimensions is a (0, 2) sequence: of any 2^k points from a multiple of
// 2^k on, exactly one falls into each box of every partition into 2^k boxes. Four points (k = 2):
//
//     +---+---+---+---+
//     |   |   | x |   |
//     +---+---+---+---+
//     | x |   |   |   |     one point in each column (boxes of 1/4 x 1),
//     +---+---+---+---+     in each row (1 x 1/4)
//     |   |   |   | x |     and in each quadrant (1/2 x 1/2)
//     +---+---+---+---+
//     |   | x |   |   |
//     +---+---+---+---+
//
// Owen's scramble flips the digits of each coordinate at random, each digit by those above it,
// which keeps that property and makes estimates unbiased. As a hash of a number with its bits
// reversed, it takes a few multiplications (Laine and Karras 2011): the product by an even number
// carries only from lower to higher bits.
#pragma once

#include <cstdint>

#include <glm/vec2.hpp>

#include "engine/base/numbers.h"

namespace ptc {

/// Returns the top 24 bits as a number in [0, 1).
[[nodiscard]] constexpr float to_unit(std::uint32_t bits) noexcept {
  return static_cast<float>(bits >> 8) * 0x1p-24f;
}

/// Returns the bits of a number in the opposite order: bit 0 becomes bit 31.
[[nodiscard]] constexpr std::uint32_t reverse_bits(std::uint32_t x) noexcept {
  x = (x >> 16) | (x << 16);
  x = ((x & 0x00FF00FFu) << 8) | ((x >> 8) & 0x00FF00FFu);
  x = ((x & 0x0F0F0F0Fu) << 4) | ((x >> 4) & 0x0F0F0F0Fu);
  x = ((x & 0x33333333u) << 2) | ((x >> 2) & 0x33333333u);
  return ((x & 0x55555555u) << 1) | ((x >> 1) & 0x55555555u);
}

/// Returns Owen's nested uniform scramble of a number whose bits are reversed. Each bit is flipped
/// or not depending on the seed and on the bits below it.
/// Source: Laine and Karras 2011, Stratified sampling for stochastic transparency, section 3.1.
[[nodiscard]] constexpr std::uint32_t scramble_reversed(std::uint32_t x,
                                                        std::uint32_t seed) noexcept {
  x += seed;
  x ^= x * 0x6C50B47Cu;
  x ^= x * 0xB82F1E52u;
  x ^= x * 0xC7AFE638u;
  x ^= x * 0x8D22F6E6u;
  return x;
}

/// Owen-scrambled points of the Sobol sequence. Of any 2^k points from a multiple of 2^k on,
/// exactly one falls into each of the 2^k boxes of size 2^-a x 2^-(k-a), for every a from 0 to k.
/// Source: Sobol 1967; Owen 1995; Burley 2020, Practical hash-based Owen scrambling.
class SquarePoints {
 public:
  /// Chooses one of 2^64 scrambles.
  explicit constexpr SquarePoints(std::uint64_t seed) noexcept : seed_(splitmix64(seed)) {}

  /// Returns the point of an index, in [0, 1) x [0, 1).
  [[nodiscard]] constexpr glm::vec2 square(std::uint32_t index) const noexcept {
    return {to_unit(reverse_bits(scramble_reversed(index, low(seed_)))),
            to_unit(reverse_bits(
                scramble_reversed(reverse_bits(second_dimension(index)), high(seed_))))};
  }

  /// Returns a further coordinate of an index, in [0, 1), evenly spread by itself and independent
  /// of square(). It has 53 bits, enough to choose from very many things.
  [[nodiscard]] constexpr double line(std::uint32_t index) const noexcept {
    const std::uint64_t seed = splitmix64(seed_);
    // Shuffle the index so that blocks of 2^k stay together.
    const std::uint32_t shuffled = reverse_bits(scramble_reversed(reverse_bits(index), low(seed)));
    const std::uint64_t upper = reverse_bits(scramble_reversed(shuffled, high(seed)));
    const std::uint64_t bits = upper << 32 | high(splitmix64(seed + index));
    return static_cast<double>(bits >> 11) * 0x1p-53;
  }

 private:
  static constexpr std::uint32_t low(std::uint64_t x) noexcept {
    return static_cast<std::uint32_t>(x);
  }
  static constexpr std::uint32_t high(std::uint64_t x) noexcept {
    return static_cast<std::uint32_t>(x >> 32);
  }
  // Returns a coordinate of the second dimension. Its direction numbers are the rows of Pascal's
  // triangle modulo 2:
  //
  //     1            Each row is the one above it XOR the same shifted by one.
  //     1 1
  //     1 0 1
  //     1 1 1 1
  static constexpr std::uint32_t second_dimension(std::uint32_t index) noexcept {
    std::uint32_t result = 0;
    for (std::uint32_t row = 0x80000000u; index != 0; index >>= 1, row ^= row >> 1) {
      if ((index & 1u) != 0) result ^= row;
    }
    return result;
  }

  std::uint64_t seed_;
};

}  // namespace ptc
