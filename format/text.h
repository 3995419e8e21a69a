// Rules for the few strings that a file carries (spec/README.md#types).
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

namespace ptc {

/// True for well-formed UTF-8 (RFC 3629) without NUL.
[[nodiscard]] bool is_utf8(std::string_view text) noexcept;

/// True for 1 to 31 bytes of [a-z0-9_.].
[[nodiscard]] bool is_name(std::string_view text) noexcept;

/// The bytes seen as characters.
[[nodiscard]] inline std::string_view as_text(std::span<const std::byte> bytes) noexcept {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace ptc
