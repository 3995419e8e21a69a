// The bitPackCodec of E57: numbers of any width, one behind the other, lowest bits first.
//
//   width 5    bits 7 ... 0 of each byte
//   byte 0     b2 b1 b0 a4 a3 a2 a1 a0        a, b, c are the first three numbers
//   byte 1     d0 c4 c3 c2 c1 c0 b4 b3
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace ptc {

/// Unpacks out.size() numbers of `width` bits each.
/// @param first_bit  bit of `bytes` where the first number begins
/// @param width      0 to 64; all numbers of width 0 are 0
/// @pre the numbers lie inside `bytes`: first_bit + width * out.size() <= 8 * bytes.size()
void unpack_bits(std::span<const std::byte> bytes, std::size_t first_bit, unsigned width,
                 std::span<std::uint64_t> out) noexcept;

}  // namespace ptc
