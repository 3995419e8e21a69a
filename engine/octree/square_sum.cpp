#include "engine/octree/square_sum.h"

#include <algorithm>
#include <cmath>

namespace ptc {

double SquareSum::value() const noexcept {
  constexpr int kLeast = -149;  // exponent of the last bit of the smallest float
  double sum = 0;
  for (std::size_t i = 0; i < kExponents; ++i) {
    const double squares =
        std::ldexp(static_cast<double>(sums_[i][1]), 64) + static_cast<double>(sums_[i][0]);
    const int exponent = kLeast + std::max(static_cast<int>(i), 1) - 1;
    sum += std::ldexp(squares, 2 * exponent);
  }
  return sum;
}

void SquareSum::save(StateWriter& state) const {
  for (const Wide& sum : sums_) {
    state.put(sum[0]);
    state.put(sum[1]);
  }
}

void SquareSum::load(StateReader& state) {
  for (Wide& sum : sums_) {
    for (std::uint64_t& half : sum) half = state.get<std::uint64_t>();
  }
}

}  // namespace ptc
