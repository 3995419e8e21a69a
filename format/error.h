// The error that decoders throw when bytes are not a valid container.
#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>

namespace ptc {

/// Reports bytes that break a rule of the format. what() reads "PATH: offset N: page P: TEXT
/// (CLAUSE)"; path and page are left out where they are not known.
///
/// A decoder of a page knows offsets inside the page only. The reader that knows where the page
/// lies rethrows the error through rebased() and in_page(), so that the message names the offset in
/// the file and the page.
class FormatError : public std::runtime_error {
 public:
  /// Makes an error that knows neither file nor page.
  /// @param offset  bytes from the start of what was decoded
  /// @param clause  anchor of the broken rule, e.g. "spec/container.md#directory"
  /// @param text    what is wrong, without offset and rule
  FormatError(std::uint64_t offset, std::string clause, std::string text);

  /// Returns the offset of the broken field: bytes from the start of what was decoded, or of the
  /// file after rebased().
  [[nodiscard]] std::uint64_t offset() const noexcept { return offset_; }
  /// Returns the anchor of the broken rule.
  [[nodiscard]] const std::string& clause() const noexcept { return clause_; }
  /// Returns what is wrong, without path, offset, page and rule.
  [[nodiscard]] const std::string& text() const noexcept { return text_; }

  /// Returns the path of the file; empty when it is not known.
  [[nodiscard]] const std::string& file() const noexcept { return where_; }
  /// Returns the number of the page to which the bytes belong, if a reader of pages added it.
  [[nodiscard]] std::optional<std::uint32_t> page() const noexcept { return page_; }

  /// Returns this error with `base` added to its offset and `where`, the path of the file, in front
  /// of its message.
  [[nodiscard]] FormatError rebased(std::uint64_t base, const std::string& where) const;
  /// Returns this error with the number of the page in its message.
  [[nodiscard]] FormatError in_page(std::uint32_t page) const;

 private:
  FormatError(std::string where, std::uint64_t offset, std::optional<std::uint32_t> page,
              std::string clause, std::string text);

  std::string where_;  ///< path of the file; empty when it is not known
  std::uint64_t offset_;
  std::optional<std::uint32_t> page_;
  std::string clause_;
  std::string text_;
};

}  // namespace ptc
