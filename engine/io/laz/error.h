// The error of the LAZ decoders.
#pragma once

#include <stdexcept>

namespace ptc::laz {

/// Reports compressed bytes that break a rule of LAZ. what() is the rule alone: the reader of the
/// file adds its path and the offset.
class LazError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace ptc::laz
