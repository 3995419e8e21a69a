// The rules for the few strings that a file carries (spec/README.md#types), and their form for a
// terminal.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace ptc {

/// Says whether a text is well-formed UTF-8 (RFC 3629) without NUL.
[[nodiscard]] bool is_utf8(std::string_view text) noexcept;

/// Says whether a text can name a channel or key a text: 1 to 31 bytes of [a-z0-9_.].
[[nodiscard]] bool is_name(std::string_view text) noexcept;

/// Returns a text that may hold bytes of a file in a form that is fit for a terminal. Control
/// characters other than '\n' become \xNN; so do all bytes beyond ASCII when the text is not UTF-8.
[[nodiscard]] std::string printable(std::string_view text);

/// Returns a view of the bytes as characters, valid as long as the bytes.
[[nodiscard]] inline std::string_view as_text(std::span<const std::byte> bytes) noexcept {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace ptc
