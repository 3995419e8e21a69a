// Errors that belong to no single layer. What else the engine throws: FormatError (format/error.h)
// for bytes that are no valid container, std::system_error for what the system refuses,
// std::invalid_argument for a broken precondition, which is a bug of the caller.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace ptc {

/// Input data that is not what its format or this program requires; what() names the file, the
/// place in it (offset or line) and the rule. Programs exit with 1.
class DataError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The caller asked for something that cannot be, e.g. for settings that contradict each other.
/// what() is a sentence in which names of fields stand in backquotes, so that a program can put its
/// own words for them in their place. Programs exit with 2.
class RequestError : public std::runtime_error {
 public:
  /// @param field  the member of the request that is to be changed, with the members that lead to
  ///               it: "estimate", "sampling.count", "run.memory_bytes"
  RequestError(std::string field, const std::string& text)
      : std::runtime_error(text), field_(std::move(field)) {}

  [[nodiscard]] const std::string& field() const noexcept { return field_; }

 private:
  std::string field_;
};

/// The memory cap is too small for the job; what() names the least that works. Programs exit
/// with 5.
class LimitError : public RequestError {
 public:
  explicit LimitError(const std::string& text) : RequestError("run.memory_bytes", text) {}
};

}  // namespace ptc
