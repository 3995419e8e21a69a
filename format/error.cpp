// The message of a FormatError: "PATH: offset N: page P: TEXT (CLAUSE)".
#include "format/error.h"

#include <utility>

namespace ptc {

FormatError::FormatError(std::uint64_t offset, std::string clause, std::string text)
    : FormatError("", offset, std::nullopt, std::move(clause), std::move(text)) {}

FormatError::FormatError(std::string where, std::uint64_t offset, std::optional<std::uint32_t> page,
                         std::string clause, std::string text)
    : std::runtime_error((where.empty() ? "" : where + ": ") + "offset " + std::to_string(offset) +
                         (page ? ": page " + std::to_string(*page) : "") + ": " + text + " (" +
                         clause + ")"),
      where_(std::move(where)),
      offset_(offset),
      page_(page),
      clause_(std::move(clause)),
      text_(std::move(text)) {}

FormatError FormatError::rebased(std::uint64_t base, const std::string& where) const {
  return {where, base + offset_, page_, clause_, text_};
}

FormatError FormatError::in_page(std::uint32_t page) const {
  return {where_, offset_, page, clause_, text_};
}

}  // namespace ptc
