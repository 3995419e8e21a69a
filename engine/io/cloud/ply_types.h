// Internal to the PLY reader: sizes of types and records.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "engine/io/cloud/ply.h"

namespace ptc {

/// Returns the bytes of a binary number of this type.
[[nodiscard]] constexpr std::size_t ply_type_bytes(PlyType type) noexcept {
  constexpr std::array<std::size_t, 8> kBytes = {1, 1, 2, 2, 4, 4, 4, 8};
  return kBytes[static_cast<std::size_t>(type)];
}

/// Returns the bytes of the smallest possible record of an element: all lists are empty, and in
/// text each value is one digit and one separator.
[[nodiscard]] std::uint64_t ply_least_bytes(const PlyElement& element, bool ascii) noexcept;

}  // namespace ptc
