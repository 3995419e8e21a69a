// The loops of packing (spec/points.md#packed-columns).
//
// A column goes through three loops: its values are loaded into an array of numbers, their
// differences become zigzag codes, and the codes are split into byte planes. The loops are plain,
// so that the compiler makes vectors of them (format/instruction_sets.h).
#include <bit>
#include <vector>

#include "format/bytes.h"
#include "format/packed_layout.h"

namespace ptc {
namespace {

template <class T, class Value>
void load_all(const std::byte* column, std::vector<Value>& values) noexcept {
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = load<T>(column, i * sizeof(T));
}

// Loads a column of 8, 16 or 32 bits.
void load_column(const std::byte* payload, const PackedColumn& column,
                 std::vector<std::uint32_t>& values) noexcept {
  const std::byte* const from = payload + column.before * values.size();
  if (column.bits == 8) return load_all<std::uint8_t>(from, values);
  if (column.bits == 16) return load_all<std::uint16_t>(from, values);
  load_all<std::uint32_t>(from, values);
}

// Loads a coordinate of a point page: 32 bits from its own column, 10 from the column `high`.
void load_coordinates(const std::byte* payload, const PackedColumn& column,
                      std::vector<std::uint64_t>& values) noexcept {
  load_all<std::uint32_t>(payload + column.before * values.size(), values);
  const std::byte* const high = payload + kHigh * values.size();
  const unsigned shift = high_shift(column);
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] |= std::uint64_t{load<std::uint32_t>(high, 4 * i) >> shift & ((1U << kHighBits) - 1)}
                 << 32;
  }
}

// Returns the bits that are set in any of the values.
template <class Value>
Value bits_of(const std::vector<Value>& values) noexcept {
  Value seen = 0;
  for (const Value value : values) seen |= value;
  return seen;
}

// Computes the differences between neighbours as zigzag codes, without the `shift` zero bits that
// all values end in.
template <class Value>
void difference(const std::vector<Value>& values, unsigned bits, unsigned shift,
                std::vector<Value>& codes) noexcept {
  const unsigned width = bits - shift;  // bits of a code
  const auto all = static_cast<Value>(mask(width));
  codes[0] = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const auto step = static_cast<Value>((values[i] >> shift) - (values[i - 1] >> shift));
    const auto negative = static_cast<Value>(step >> (width - 1) & 1);
    codes[i] = static_cast<Value>((step << 1 ^ (Value{0} - negative)) & all);
  }
}

// Appends a packed column: its head and its planes.
template <class Value>
void pack(const std::vector<Value>& values, unsigned bits, std::vector<Value>& codes,
          std::vector<std::byte>& packed) {
  const Value seen = bits_of(values);
  const unsigned shift = seen == 0 ? 0 : static_cast<unsigned>(std::countr_zero(seen));
  difference(values, bits, shift, codes);
  const auto planes = static_cast<unsigned>(std::bit_width(bits_of(codes)) + 7) / 8;

  // Write the head, then byte after byte of all codes.
  const std::size_t at = packed.size(), n = values.size();
  packed.resize(at + kHeadBytes + planes * n);
  std::byte* const p = packed.data() + at;
  store(p, 0, static_cast<std::uint8_t>(shift));
  store(p, 1, static_cast<std::uint8_t>(planes));
  store(p, 2, std::uint64_t{values.front()});
  for (unsigned plane = 0; plane < planes; ++plane) {
    std::byte* const out = p + kHeadBytes + plane * n;
    for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<std::byte>(codes[i] >> (8 * plane));
  }
}

void pack_all(std::span<const std::byte> payload, std::uint32_t count,
              std::span<const PackedColumn> columns, std::vector<std::byte>& packed) {
  std::vector<std::uint32_t> values(count), others(count);
  std::vector<std::uint64_t> wide, codes;
  for (const PackedColumn& column : columns) {
    if (column.bits == kCoordinateBits || column.bits == 64) {
      wide.resize(count);
      codes.resize(count);
      if (column.bits == 64) {
        load_all<std::uint64_t>(payload.data() + std::size_t{column.before} * count, wide);
      } else {
        load_coordinates(payload.data(), column, wide);
      }
      pack(wide, column.bits, codes, packed);
      continue;
    }
    load_column(payload.data(), column, values);
    if (column.minus != PackedColumn::kNone) {
      load_column(payload.data(), columns[column.minus], others);
      const auto all = static_cast<std::uint32_t>(mask(column.bits));
      for (std::size_t i = 0; i < count; ++i) values[i] = (values[i] - others[i]) & all;
    }
    pack(values, column.bits, others, packed);
  }
}

}  // namespace

void pack_columns(std::span<const std::byte> payload, std::uint32_t count,
                  std::span<const PackedColumn> columns, std::vector<std::byte>& packed,
                  InstructionSet set) {
  check_packed_size(payload.size(), count, columns);
  packed.clear();
  with_instructions(set, [&] { pack_all(payload, count, columns, packed); });
}

}  // namespace ptc
