// Little-endian numbers in a span of bytes: the only way in which format/ reads and fills the
// structures of a file.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

namespace ptc {

static_assert(std::endian::native == std::endian::little,
              "numbers are copied as they lie in files, which are little-endian");

/// This is true for the types that load() and store() accept: numbers, and arrays of three doubles.
template <class T>
inline constexpr bool kIsStored =
    std::is_arithmetic_v<T> || std::is_same_v<T, std::array<double, 3>>;

/// Reads the number that starts `at` bytes into `bytes`. Its alignment does not matter.
/// @pre the caller has checked that the number lies inside the bytes
template <class T>
[[nodiscard]] T load(const std::byte* bytes, std::size_t at) noexcept {
  static_assert(kIsStored<T>);
  T value;
  std::memcpy(&value, bytes + at, sizeof value);
  return value;
}

/// Writes a number `at` bytes into `bytes`. Its alignment does not matter.
/// @pre the caller has checked that the number lies inside the bytes
template <class T>
void store(std::byte* bytes, std::size_t at, T value) noexcept {
  static_assert(kIsStored<T>);
  std::memcpy(bytes + at, &value, sizeof value);
}

/// A number at a fixed place of a structure. A structure states each of its fields once, for its
/// encoder, its decoder and its errors.
template <class T>
struct Field {
  std::size_t at;  ///< bytes from the start of the structure

  /// Reads the field. @pre the structure lies inside the bytes
  [[nodiscard]] T of(const std::byte* structure) const noexcept { return load<T>(structure, at); }
  /// Writes the field. @pre the structure lies inside the bytes
  void put(std::byte* structure, std::type_identity_t<T> value) const noexcept {
    store(structure, at, value);
  }
};

/// Returns the position of the first byte that is not zero, or bytes.size() when all are zero.
[[nodiscard]] inline std::size_t first_nonzero(std::span<const std::byte> bytes) noexcept {
  const auto found = std::ranges::find_if(bytes, [](std::byte b) { return b != std::byte{0}; });
  return static_cast<std::size_t>(found - bytes.begin());
}

}  // namespace ptc
