// A point page's payload: columns of surfels in Morton order (spec/points.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "format/container.h"
#include "format/point_record.h"

namespace ptc {

/// Points that fit a page: a multiple of 8.
[[nodiscard]] std::uint32_t points_per_page(const FileHeader& file) noexcept;

/// Bytes of a point page's payload.
[[nodiscard]] std::uint64_t point_page_bytes(std::uint32_t points) noexcept;

/// Payload of a point page: columns, each count long, one after another. Positions are lossless.
///
///   u32 x[n] y[n] z[n]     low 32 bits of the lattice coordinates
///   u32 high[n]            their bits 32..41:  x | y << 10 | z << 20, bits 30 and 31 zero
///   f32 radius[n]   i16 normal_u[n] normal_v[n]   u16 radiance_r[n] _g[n] _b[n] (half)
///   u8 albedo_r[n] _g[n] _b[n]   u8 flags[n]       34 bytes a point
/// @param points  1 to points_per_page, by ascending key; numbers finite and not negative, flags 0
[[nodiscard]] std::vector<std::byte> encode_point_page(std::span<const PointRecord> points);

/// A decoded point page: a view into its payload, valid as long as the payload.
class PointPage {
 public:
  /// Checks the payload's size: 34 bytes a point. @throws FormatError
  PointPage(std::span<const std::byte> payload, std::uint32_t count);
  /// Trusts a payload that passed the check and verify() when its frame was loaded.
  PointPage(const std::byte* payload, std::uint32_t count) noexcept
      : payload_(payload), count_(count) {}

  [[nodiscard]] std::uint32_t size() const noexcept { return count_; }
  [[nodiscard]] PointRecord operator[](std::uint32_t i) const noexcept;
  [[nodiscard]] LatticePoint position(std::uint32_t i) const noexcept {
    const std::uint64_t high = value<std::uint32_t>(12, i);
    return {value<std::uint32_t>(0, i) | (high & 1023) << 32,
            value<std::uint32_t>(4, i) | (high >> 10 & 1023) << 32,
            value<std::uint32_t>(8, i) | (high >> 20 & 1023) << 32};
  }
  [[nodiscard]] float radius(std::uint32_t i) const noexcept { return value<float>(16, i); }
  /// Octahedral, u and v.
  [[nodiscard]] std::array<std::int16_t, 2> normal(std::uint32_t i) const noexcept {
    return {value<std::int16_t>(20, i), value<std::int16_t>(22, i)};
  }
  /// Half, RGB.
  [[nodiscard]] std::array<std::uint16_t, 3> radiance(std::uint32_t i) const noexcept {
    return {value<std::uint16_t>(24, i), value<std::uint16_t>(26, i), value<std::uint16_t>(28, i)};
  }
  /// RGB, v / 255.
  [[nodiscard]] std::array<std::uint8_t, 3> albedo(std::uint32_t i) const noexcept {
    return {value<std::uint8_t>(30, i), value<std::uint8_t>(31, i), value<std::uint8_t>(32, i)};
  }

  /// Checks what shading relies on: bits 30 and 31 of `high` zero, keys ascending, radius finite
  /// and not negative, radiance finite and not negative, flags zero.
  /// @throws FormatError naming the first bad point
  void verify() const;

 private:
  template <class T>
  void verify_column(std::size_t bytes_before, T limit, const char* clause, const char* text) const;

  /// The i-th value of the column that starts bytes_before bytes a point from the payload's start.
  template <class T>
  [[nodiscard]] T value(std::size_t bytes_before, std::size_t i) const noexcept {
    T v;
    std::memcpy(&v, payload_ + bytes_before * count_ + i * sizeof v, sizeof v);
    return v;
  }

  const std::byte* payload_;
  std::uint32_t count_;
};

}  // namespace ptc
