// Errors that belong to no single layer.
#pragma once

#include <stdexcept>
#include <string>

namespace ptc {

/// Input data that is not what its format or this program requires; what() names the file, the
/// place in it (offset or line) and the rule. Programs exit with 1.
class DataError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A limit that the user set is too small for the job; what() names the least that works. Programs
/// exit with 5.
class LimitError : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

}  // namespace ptc
