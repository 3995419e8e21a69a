#include "engine/io/laz/integer.h"

namespace ptc::laz {

IntegerDecoder::IntegerDecoder(unsigned bits, unsigned contexts)
    : magnitudes_(contexts, SymbolModel(bits + 1)) {
  places_.reserve(bits);
  for (unsigned k = 1; k <= bits; ++k) places_.emplace_back(1U << std::min(k, 8U));
}

void IntegerDecoder::reset() noexcept {
  k_ = 0;
  zero_or_one_.reset();
  for (SymbolModel& model : magnitudes_) model.reset();
  for (SymbolModel& model : places_) model.reset();
}

std::int32_t IntegerDecoder::decode(ArithmeticDecoder& in, std::int32_t predicted,
                                    unsigned context) {
  k_ = in.symbol(magnitudes_[context]);
  std::uint32_t difference = 0x80000000U;  // k = 32 is -2^31 alone
  if (k_ == 0) {
    difference = in.bit(zero_or_one_);
  } else if (k_ < 32) {
    std::uint32_t place = in.symbol(places_[k_ - 1]);
    if (k_ > 8) place = place << (k_ - 8) | in.bits(k_ - 8);
    const bool positive = place >> (k_ - 1) != 0;
    difference = positive ? place + 1 : place - ((1U << k_) - 1);
  }
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(predicted) + difference);
}

}  // namespace ptc::laz
