// Errors that belong to no single layer. The engine also throws FormatError (format/error.h) for
// bytes that are not a valid container, std::system_error for calls that the system refuses, and
// std::invalid_argument for a broken precondition, which is a bug of the caller.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace ptc {

/// Reports input data that is not what its format or this program requires. what() names the file,
/// the place in it (offset or line) and the rule. Programs exit with code 1.
class DataError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Reports a request that cannot be met, such as settings that contradict each other. what() is a
/// sentence in which names of fields stand in backquotes, so that a program can replace them with
/// the names that its users know. Programs exit with code 2.
class RequestError : public std::runtime_error {
 public:
  /// Makes an error about one field of a request.
  /// @param field  the member of the request that must change, with the members that lead to it:
  ///               "estimate", "sampling.count", "run.memory_bytes"
  RequestError(std::string field, const std::string& text)
      : std::runtime_error(text), field_(std::move(field)) {}

  /// Returns the member of the request that must change.
  [[nodiscard]] const std::string& field() const noexcept { return field_; }

 private:
  std::string field_;
};

/// Checks one field of a request.
/// @param field  as for RequestError
/// @param text   the error's sentence, as for RequestError
/// @throws RequestError when `holds` is false
inline void require_request(bool holds, const char* field, const char* text) {
  if (!holds) throw RequestError(field, text);
}

/// Reports a memory cap that is too small for the job. what() names the smallest cap that works.
/// Programs exit with code 5.
class LimitError : public RequestError {
 public:
  /// Makes an error about the cap.
  /// @param field  the member of the request that holds the cap
  explicit LimitError(const std::string& text, std::string field = "run.memory_bytes")
      : RequestError(std::move(field), text) {}
};

}  // namespace ptc
