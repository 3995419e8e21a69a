// Shared by the tests of format/: random numbers that are the same on every machine, and the clause
// that an error names.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "engine/base/numbers.h"
#include "format/error.h"

namespace ptc::test {

/// Random numbers by SplitMix64: the same sequence on every machine.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t bits() {
    const std::uint64_t value = splitmix64(state_);
    state_ += kSplitMixStep;
    return value;
  }
  std::uint64_t below(std::uint64_t limit) { return bits() % limit; }
  /// Returns a number in [0, 1).
  double unit() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  double between(double low, double high) { return low + (high - low) * unit(); }

 private:
  std::uint64_t state_;
};

/// Returns the clause of the FormatError that `action` throws; "none" when it throws nothing.
template <class Action>
std::string clause_of(const Action& action) {
  try {
    action();
  } catch (const FormatError& error) {
    return error.clause();
  }
  return "none";
}

template <class T, class Bytes>
void put(Bytes& bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

template <class T, class Bytes>
T get(const Bytes& bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

}  // namespace ptc::test
