// Internal to what reads and writes glTF: types of numbers, and the marks of a GLB.
// Source: Khronos, "glTF 2.0 Specification", sections 3.6.2.2 (component types) and 4.4 (GLB).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

namespace ptc {

inline constexpr std::uint32_t kGlbMagic = 0x46546C67;   ///< "glTF", the first bytes of a GLB
inline constexpr std::uint32_t kGlbJson = 0x4E4F534A;    ///< type of its chunk of JSON
inline constexpr std::uint32_t kGlbBinary = 0x004E4942;  ///< type of its chunk of numbers

// Values of componentType.
inline constexpr std::uint64_t kGltfInt8 = 5120, kGltfUint8 = 5121, kGltfInt16 = 5122,
                               kGltfUint16 = 5123, kGltfUint32 = 5125, kGltfFloat = 5126;

/// What a componentType says of a number.
struct GltfNumber {
  std::size_t bytes;
  double scale;  ///< greatest value of a normalised integer, which stands for 1; 1 for float
};

/// Returns what a componentType says, or nothing when it is unknown.
[[nodiscard]] std::optional<GltfNumber> gltf_number(std::uint64_t type);
/// Reads a number of a known componentType.
[[nodiscard]] double load_gltf_number(const std::byte* from, std::uint64_t type);

}  // namespace ptc
