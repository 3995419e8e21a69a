// What a decoder says when bytes are not a valid container.
#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>

namespace ptc {

/// Bytes that break a rule of the format. what() reads "PATH: offset N: page P: TEXT (CLAUSE)",
/// path and page where they are known.
///
/// Decoders of a page know offsets inside the page only; the reader that knows where the page lies
/// rethrows with rebased() and in_page() so that the message names the offset in the file and the
/// page.
class FormatError : public std::runtime_error {
 public:
  /// @param offset  bytes from the start of what was decoded
  /// @param clause  anchor of the broken rule, e.g. "spec/container.md#directory"
  FormatError(std::uint64_t offset, std::string clause, std::string text);

  [[nodiscard]] std::uint64_t offset() const noexcept { return offset_; }
  [[nodiscard]] const std::string& clause() const noexcept { return clause_; }
  [[nodiscard]] const std::string& text() const noexcept { return text_; }

  /// The page that the bytes belong to, where a reader of pages found the error.
  [[nodiscard]] std::optional<std::uint32_t> page() const noexcept { return page_; }

  /// The same error, `base` bytes further on, its text preceded by `where` (a file's path).
  [[nodiscard]] FormatError rebased(std::uint64_t base, const std::string& where) const;
  /// The same error, in a page of this number.
  [[nodiscard]] FormatError in_page(std::uint32_t page) const;

 private:
  FormatError(std::string where, std::uint64_t offset, std::optional<std::uint32_t> page,
              std::string clause, std::string text);

  std::string where_;
  std::uint64_t offset_;
  std::optional<std::uint32_t> page_;
  std::string clause_;
  std::string text_;
};

}  // namespace ptc
