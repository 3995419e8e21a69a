// The payload of a point page: columns of surfels in Morton order (spec/points.md).
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

/// Returns the number of points in a full point page, a multiple of 8.
[[nodiscard]] std::uint32_t points_per_page(const FileHeader& file) noexcept;

/// Says whether a page may hold the numbers of a point: radius, radiance and emission are finite
/// and not negative, though colours may be negative zeros, and flags are 0.
[[nodiscard]] bool is_storable(const PointRecord& point) noexcept;

/// Encodes the payload of a point page: columns of n values each, one after another. Positions are
/// lossless. A negative zero becomes zero.
///
///   u32 x[n] y[n] z[n]     low 32 bits of the lattice coordinates
///   u32 high[n]            their bits 32..41:  x | y << 10 | z << 20, bits 30 and 31 zero
///   f32 radius[n]   i16 normal_u[n] normal_v[n]   u16 radiance_r[n] _g[n] _b[n] (half)
///   u8 albedo_r[n] _g[n] _b[n]   u8 flags[n]       34 bytes a point
///   u16 emission_r[n] _g[n] _b[n] (half)           6 more where points may emit light
/// @param points       1 to points_per_page() points by ascending key, all is_storable()
/// @param point_bytes  FileHeader::point_bytes; kPointBytes leaves emission out
/// @throws std::invalid_argument when there are no points
[[nodiscard]] std::vector<std::byte> encode_point_page(std::span<const PointRecord> points,
                                                       std::uint8_t point_bytes);

/// A decoded point page: a view into its payload that is valid as long as the payload. Indices of
/// points are below size(); no function checks them.
class PointPage {
 public:
  /// Checks the size of the payload only; verify() checks its values.
  /// @throws FormatError when it is not `point_bytes` a point, or there are no points
  PointPage(std::span<const std::byte> payload, std::uint32_t count, std::uint8_t point_bytes);
  /// Makes a view without checks. @pre the payload passed the check above and verify() when it was
  /// loaded
  PointPage(const std::byte* payload, std::uint32_t count, std::uint8_t point_bytes) noexcept
      : payload_(payload), count_(count), emits_(point_bytes != kPointBytes) {}

  /// Returns the number of points.
  [[nodiscard]] std::uint32_t size() const noexcept { return count_; }
  /// Returns all fields of point i.
  [[nodiscard]] PointRecord operator[](std::uint32_t i) const noexcept;
  /// Returns the lattice coordinates of point i.
  [[nodiscard]] LatticePoint position(std::uint32_t i) const noexcept {
    const std::uint64_t high = value<std::uint32_t>(12, i);
    return {value<std::uint32_t>(0, i) | (high & 1023) << 32,
            value<std::uint32_t>(4, i) | (high >> 10 & 1023) << 32,
            value<std::uint32_t>(8, i) | (high >> 20 & 1023) << 32};
  }
  /// Returns the radius of point i, scene units.
  [[nodiscard]] float radius(std::uint32_t i) const noexcept { return value<float>(16, i); }
  /// Returns the normal of point i as octahedral u and v (decode_octahedral()).
  [[nodiscard]] std::array<std::int16_t, 2> normal(std::uint32_t i) const noexcept {
    return {value<std::int16_t>(20, i), value<std::int16_t>(22, i)};
  }
  /// Returns the light that point i reflects, RGB as half patterns, W / (m^2 sr).
  [[nodiscard]] std::array<std::uint16_t, 3> radiance(std::uint32_t i) const noexcept {
    return {value<std::uint16_t>(24, i), value<std::uint16_t>(26, i), value<std::uint16_t>(28, i)};
  }
  /// Returns whether the page has the columns of emission; without them no point emits light.
  [[nodiscard]] bool emits() const noexcept { return emits_; }
  /// Returns the light of its own that point i emits, RGB as half patterns, W / (m^2 sr).
  [[nodiscard]] std::array<std::uint16_t, 3> emission(std::uint32_t i) const noexcept {
    if (!emits_) return {};
    return {value<std::uint16_t>(34, i), value<std::uint16_t>(36, i), value<std::uint16_t>(38, i)};
  }
  /// Returns the albedo of point i, RGB in steps of 1 / 255.
  [[nodiscard]] std::array<std::uint8_t, 3> albedo(std::uint32_t i) const noexcept {
    return {value<std::uint8_t>(30, i), value<std::uint8_t>(31, i), value<std::uint8_t>(32, i)};
  }

  /// Checks everything that shading relies on: bits 30 and 31 of `high` are zero, keys do not
  /// descend, radius, radiance and emission are finite and not negative, flags are zero.
  /// @throws FormatError that names the first bad point of the first bad column
  void verify() const;

 private:
  /// Checks that every bit pattern of a column is below `limit`. @throws FormatError otherwise
  template <class T>
  void verify_column(std::size_t bytes_before, T limit, const char* clause, const char* text) const;

  /// Returns the i-th value of the column that has `bytes_before` bytes per point in front of it.
  template <class T>
  [[nodiscard]] T value(std::size_t bytes_before, std::size_t i) const noexcept {
    T v;
    std::memcpy(&v, payload_ + bytes_before * count_ + i * sizeof v, sizeof v);
    return v;
  }

  const std::byte* payload_;
  std::uint32_t count_;
  bool emits_;
};

}  // namespace ptc
