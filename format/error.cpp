// The text of a FormatError (format/error.h).
#include "format/error.h"

#include <utility>

namespace ptc {

FormatError::FormatError(std::uint64_t offset, std::string clause, std::string text)
    : FormatError("", offset, std::move(clause), std::move(text)) {}

FormatError::FormatError(const std::string& where, std::uint64_t offset, std::string clause,
                         std::string text)
    : std::runtime_error((where.empty() ? "" : where + ": ") + "offset " + std::to_string(offset) +
                         ": " + text + " (" + clause + ")"),
      offset_(offset),
      clause_(std::move(clause)),
      text_(std::move(text)) {}

FormatError FormatError::rebased(std::uint64_t base, const std::string& where) const {
  return {where, base + offset_, clause_, text_};
}

}  // namespace ptc
