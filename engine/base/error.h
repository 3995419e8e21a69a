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

}  // namespace ptc
