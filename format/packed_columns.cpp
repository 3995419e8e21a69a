// Unpacking of columns, and their order (spec/points.md#packed-columns).
//
//   head   | shift u8 | planes u8 | base u64 |      then `planes` planes of n bytes
//
//   value of point i = value of point i - 1 + (step of code i << shift), from base on
//
// The packed bytes are untrusted: read_head() checks that the planes it announces are there. The
// sums may overflow and wrap, which is part of the format.
#include "format/packed_columns.h"

#include <algorithm>
#include <array>
#include <bit>
#include <stdexcept>

#include "format/bytes.h"
#include "format/container.h"
#include "format/error.h"
#include "format/packed_layout.h"

namespace ptc {
namespace {

constexpr char kPacked[] = "spec/points.md#packed-columns";
constexpr std::array<PackedColumn, 16> kPointColumns{{
    {0, kCoordinateBits},
    {4, kCoordinateBits},
    {8, kCoordinateBits},  // x, y, z
    {16, 32},              // radius
    {20, 16},
    {22, 16},  // normal
    {26, 16},
    {24, 16, 6},
    {28, 16, 6},  // radiance: g, r - g, b - g
    {31, 8},
    {30, 8, 9},
    {32, 8, 9},  // albedo: g, r - g, b - g
    {33, 8},     // flags
    {36, 16},
    {34, 16, 13},
    {38, 16, 13},  // emission: g, r - g, b - g
}};
constexpr std::size_t kColumnsWithoutEmission = 13;

// A packed column whose head was checked.
struct Head {
  unsigned shift = 0;                // zero bits that all values end in
  unsigned planes = 0;               // bytes of a code that are stored
  std::uint64_t base = 0;            // value before the first step
  const std::byte* codes = nullptr;  // the planes
};

// Reads and checks the head of the column that starts at `at`, and that its planes are there.
Head read_head(std::span<const std::byte> packed, std::size_t at, unsigned bits, std::size_t n) {
  if (packed.size() - at < kHeadBytes)
    throw FormatError(at, kPacked, "packed columns end in a column's head");
  const std::byte* const p = packed.data() + at;
  const Head head{load<std::uint8_t>(p, 0), load<std::uint8_t>(p, 1), load<std::uint64_t>(p, 2),
                  p + kHeadBytes};
  if (head.shift >= bits)
    throw FormatError(at, kPacked, "shift is not below the bits of the column");
  if (head.planes > (bits + 7) / 8)
    throw FormatError(at + 1, kPacked, "more planes than the column has bytes");
  if (head.base > mask(bits))
    throw FormatError(at + 2, kPacked, "base has more bits than the column");
  if ((packed.size() - at - kHeadBytes) / n < head.planes) {
    throw FormatError(packed.size(), kPacked, "packed columns end in a plane");
  }
  return head;
}

// Calls put(i, value) for the values of a column with a fixed number of planes.
template <unsigned kPlanes, class Put>
void sum_planes(const Head& head, std::size_t n, const Put& put) {
  std::uint64_t value = head.base;
  for (std::size_t i = 0; i < n; ++i) {
    std::uint64_t code = 0;
    for (unsigned k = 0; k < kPlanes; ++k)
      code |= load<std::uint8_t>(head.codes, k * n + i) * (std::uint64_t{1} << 8 * k);
    value += (code >> 1 ^ (0 - (code & 1))) << head.shift;
    put(i, value);
  }
}

// Calls put(i, value) for each value of a column. Bits above the column's are not masked off.
template <class Put>
void sum_up(const Head& head, std::size_t n, const Put& put) {
  switch (head.planes) {
    case 0:
      return sum_planes<0>(head, n, put);
    case 1:
      return sum_planes<1>(head, n, put);
    case 2:
      return sum_planes<2>(head, n, put);
    case 3:
      return sum_planes<3>(head, n, put);
    case 4:
      return sum_planes<4>(head, n, put);
    case 5:
      return sum_planes<5>(head, n, put);
    case 6:
      return sum_planes<6>(head, n, put);
    case 7:
      return sum_planes<7>(head, n, put);
    default:
      return sum_planes<8>(head, n, put);
  }
}

// Stores the values of a column of type T, added to those of the column `minus` if there is one.
template <class T>
void unpack_values(const Head& head, std::size_t n, const std::byte* minus, std::byte* to) {
  if (minus == nullptr) {
    return sum_up(head, n, [&](std::size_t i, std::uint64_t value) {
      store(to, i * sizeof(T), static_cast<T>(value));
    });
  }
  sum_up(head, n, [&](std::size_t i, std::uint64_t value) {
    store(to, i * sizeof(T), static_cast<T>(value + load<T>(minus, i * sizeof(T))));
  });
}

// Stores a coordinate of a point page: 32 bits in its own column, 10 in the column `high`, which x
// starts and y and z complete.
void unpack_coordinates(const Head& head, std::size_t n, const PackedColumn& column,
                        std::byte* payload) {
  std::byte* const low = payload + column.before * n;
  std::byte* const high = payload + kHigh * n;
  const unsigned shift = high_shift(column);
  sum_up(head, n, [&](std::size_t i, std::uint64_t value) {
    const std::uint32_t others = shift == 0 ? 0 : load<std::uint32_t>(high, 4 * i);
    store(low, 4 * i, static_cast<std::uint32_t>(value));
    store(high, 4 * i,
          others | static_cast<std::uint32_t>((value & mask(kCoordinateBits)) >> 32) << shift);
  });
}

void unpack(const Head& head, std::size_t n, std::span<const PackedColumn> columns,
            const PackedColumn& column, std::byte* payload) {
  if (column.bits == kCoordinateBits) return unpack_coordinates(head, n, column, payload);
  const std::byte* const minus =
      column.minus == PackedColumn::kNone ? nullptr : payload + columns[column.minus].before * n;
  std::byte* const to = payload + column.before * n;
  if (column.bits == 8) return unpack_values<std::uint8_t>(head, n, minus, to);
  if (column.bits == 16) return unpack_values<std::uint16_t>(head, n, minus, to);
  if (column.bits == 32) return unpack_values<std::uint32_t>(head, n, minus, to);
  unpack_values<std::uint64_t>(head, n, minus, to);
}

}  // namespace

void check_packed_size(std::size_t bytes, std::uint32_t count,
                       std::span<const PackedColumn> columns) {
  std::size_t row = 0;
  for (const PackedColumn& column : columns) {
    const std::size_t width = column.bits == kCoordinateBits ? 4 : column.bits / 8;
    row = std::max(row, column.before + width);
  }
  if (count == 0 || bytes != row * count)
    throw std::invalid_argument("packed columns: the size of the payload does not match");
}

std::span<const PackedColumn> packed_point_columns(std::uint8_t point_bytes) noexcept {
  return point_bytes == kPointBytes ? std::span(kPointColumns).first(kColumnsWithoutEmission)
                                    : std::span(kPointColumns);
}

std::vector<PackedColumn> packed_group_columns(std::span<const Channel> channels,
                                               std::uint8_t group) {
  std::vector<PackedColumn> columns;
  std::uint32_t before = 0;
  for (const Channel& channel : channels) {
    if (channel.group != group) continue;
    const auto bytes = static_cast<std::uint8_t>(channel.component_bytes());
    for (unsigned component = 0; component < channel.components; ++component, before += bytes) {
      columns.push_back({.before = before, .bits = static_cast<std::uint8_t>(8 * bytes)});
    }
  }
  return columns;
}

void unpack_columns(std::span<const std::byte> packed, std::uint32_t count,
                    std::span<const PackedColumn> columns, std::span<std::byte> payload) {
  check_packed_size(payload.size(), count, columns);
  std::size_t at = 0;
  for (const PackedColumn& column : columns) {
    const Head head = read_head(packed, at, column.bits, count);
    unpack(head, count, columns, column, payload.data());
    at += kHeadBytes + std::size_t{head.planes} * count;
  }
  if (at != packed.size())
    throw FormatError(at, kPacked, "bytes are left over after the packed columns");
}

}  // namespace ptc
