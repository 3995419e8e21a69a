// Internal to the glTF reader: bufferViews that are compressed by meshoptimizer.
// Source: Khronos, "EXT_meshopt_compression".
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <nlohmann/json.hpp>

namespace ptc {

/// How a bufferView is compressed: `count` elements of `stride` bytes.
struct MeshoptView {
  enum class Mode : std::uint8_t { attributes, triangles, indices } mode = Mode::attributes;
  enum class Filter : std::uint8_t { none, octahedral, quaternion, exponential };
  Filter filter = Filter::none;
  std::uint64_t count = 0;
  std::uint64_t stride = 0;

  /// Returns the number of bytes of the view. @pre may_come_of() of some stream
  [[nodiscard]] std::uint64_t bytes() const noexcept { return count * stride; }
  /// Says whether a stream of so many bytes can hold the elements: attributes take at least a 64th
  /// of their bytes, and triangles and indices a byte each.
  [[nodiscard]] bool may_come_of(std::uint64_t stream_bytes) const noexcept;
};

/// Reads mode and filter of the extension of a bufferView, and checks them with count and stride.
/// @return the rule that is broken, or null
[[nodiscard]] const char* read_meshopt_view(const nlohmann::json& extension, MeshoptView& view);
/// Decodes a stream. Returns nothing when it is damaged.
/// @pre read_meshopt_view() returned null, and view.may_come_of(stream.size())
[[nodiscard]] std::vector<std::byte> decode_meshopt(std::span<const std::byte> stream,
                                                    const MeshoptView& view);

}  // namespace ptc
