#include "engine/io/mesh/gltf_numbers.h"

#include <bit>
#include <cstring>

namespace ptc {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF buffers are little-endian");

template <typename T>
double load_as(const std::byte* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return static_cast<double>(value);
}

}  // namespace

std::optional<GltfNumber> gltf_number(std::uint64_t type) {
  switch (type) {
    case kGltfInt8:
      return GltfNumber{1, 127};
    case kGltfUint8:
      return GltfNumber{1, 255};
    case kGltfInt16:
      return GltfNumber{2, 32767};
    case kGltfUint16:
      return GltfNumber{2, 65535};
    case kGltfUint32:
      return GltfNumber{4, 4294967295.0};
    case kGltfFloat:
      return GltfNumber{4, 1};
    default:
      return std::nullopt;
  }
}

double load_gltf_number(const std::byte* from, std::uint64_t type) {
  switch (type) {
    case kGltfInt8:
      return load_as<std::int8_t>(from);
    case kGltfUint8:
      return load_as<std::uint8_t>(from);
    case kGltfInt16:
      return load_as<std::int16_t>(from);
    case kGltfUint16:
      return load_as<std::uint16_t>(from);
    case kGltfUint32:
      return load_as<std::uint32_t>(from);
    default:
      return load_as<float>(from);
  }
}

}  // namespace ptc
