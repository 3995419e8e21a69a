// Meshoptimizer: a library decodes the streams, whose authors keep it safe for any bytes. What it
// asserts of sizes is checked here.
#include "engine/io/mesh/gltf_meshopt.h"

#include <algorithm>
#include <array>
#include <string>

#include <meshoptimizer.h>

namespace ptc {

bool MeshoptView::may_come_of(std::uint64_t stream_bytes) const noexcept {
  if (stream_bytes > (std::uint64_t{1} << 48)) return false;
  const std::uint64_t most_bytes = 64 * stream_bytes;
  if (mode == Mode::attributes) return count <= most_bytes / stride;
  return count <= (mode == Mode::triangles ? 3 : 1) * stream_bytes;
}

const char* read_meshopt_view(const nlohmann::json& extension, MeshoptView& view) {
  using Mode = MeshoptView::Mode;
  using Filter = MeshoptView::Filter;
  const auto find = [&](const char* key, const auto& names, const char* otherwise) {
    const auto word = extension.find(key);
    const std::string text = word == extension.end() ? otherwise
                             : word->is_string()     ? word->template get<std::string>()
                                                     : "";
    return static_cast<std::size_t>(std::ranges::find(names, text) - names.begin());
  };
  constexpr std::array kModes{"ATTRIBUTES", "TRIANGLES", "INDICES"};
  constexpr std::array kFilters{"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL"};
  const std::size_t mode = find("mode", kModes, ""), filter = find("filter", kFilters, "NONE");
  if (mode == kModes.size()) return "its mode is unknown";
  if (filter == kFilters.size()) return "its filter is unknown";
  view.mode = static_cast<Mode>(mode);
  view.filter = static_cast<Filter>(filter);
  const bool is_attributes = view.mode == Mode::attributes;
  const std::uint64_t stride = view.stride;
  if (is_attributes ? stride == 0 || stride % 4 != 0 || stride > 256 : stride != 2 && stride != 4)
    return "its byteStride does not go with its mode";
  if (view.mode == Mode::triangles && view.count % 3 != 0) return "it has a part of a triangle";
  if ((view.filter != Filter::none && !is_attributes) ||
      (view.filter == Filter::octahedral && stride != 4 && stride != 8) ||
      (view.filter == Filter::quaternion && stride != 8)) {
    return "its filter does not go with its mode or byteStride";
  }
  return nullptr;
}

std::vector<std::byte> decode_meshopt(std::span<const std::byte> stream, const MeshoptView& view) {
  std::vector<std::byte> bytes(view.bytes());
  if (bytes.empty()) return bytes;
  const auto* const from = reinterpret_cast<const unsigned char*>(stream.data());
  int error = 0;
  switch (view.mode) {
    case MeshoptView::Mode::attributes:
      error =
          meshopt_decodeVertexBuffer(bytes.data(), view.count, view.stride, from, stream.size());
      break;
    case MeshoptView::Mode::triangles:
      error = meshopt_decodeIndexBuffer(bytes.data(), view.count, view.stride, from, stream.size());
      break;
    case MeshoptView::Mode::indices:
      error =
          meshopt_decodeIndexSequence(bytes.data(), view.count, view.stride, from, stream.size());
      break;
  }
  if (error != 0) return {};
  switch (view.filter) {
    case MeshoptView::Filter::none:
      break;
    case MeshoptView::Filter::octahedral:
      meshopt_decodeFilterOct(bytes.data(), view.count, view.stride);
      break;
    case MeshoptView::Filter::quaternion:
      meshopt_decodeFilterQuat(bytes.data(), view.count, view.stride);
      break;
    case MeshoptView::Filter::exponential:
      meshopt_decodeFilterExp(bytes.data(), view.count, view.stride);
      break;
  }
  return bytes;
}

}  // namespace ptc
