// Decoding of integers by their difference from a prediction.
//
// The difference is cut into its magnitude k and its place among the differences of this magnitude.
// Magnitude and place have models of their own, because magnitudes repeat themselves:
//
//   k = 0   0 or 1
//   k = 1   -1, 2
//   k = 2   -3 -2, 3 4
//   k = 3   -7 -6 -5 -4, 5 6 7 8      place 0 to 2^k - 1; of a place of more than 8 bits only the
//   ...                               upper 8 have a model, the others are bits
#pragma once

#include <vector>

#include "engine/io/laz/arithmetic.h"

namespace ptc::laz {

/// Decodes integers of one kind, such as differences of x.
class IntegerDecoder {
 public:
  /// Makes a decoder of integers of 16 or 32 bits.
  /// @param contexts  number of models for the magnitude
  IntegerDecoder(unsigned bits, unsigned contexts);
  /// Forgets all integers that were decoded.
  void reset() noexcept;
  /// Decodes an integer; of those of 16 bits only the lower 16 mean something.
  std::int32_t decode(ArithmeticDecoder& in, std::int32_t predicted, unsigned context = 0);
  /// Returns the magnitude k of the difference that was decoded last.
  [[nodiscard]] unsigned magnitude() const noexcept { return k_; }

 private:
  unsigned k_ = 0;
  BitModel zero_or_one_;
  std::vector<SymbolModel> magnitudes_;  // for each context
  std::vector<SymbolModel> places_;      // for k = 1, 2, ...
};

}  // namespace ptc::laz
