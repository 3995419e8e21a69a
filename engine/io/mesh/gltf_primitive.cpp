// Primitives of glTF, plain or compressed.
#include "engine/io/mesh/gltf_primitive.h"

#include <vector>

#include "engine/io/mesh/gltf_numbers.h"

namespace ptc {
namespace {

constexpr std::uint64_t kTriangles = 4;  // mode

}  // namespace

GltfPrimitive::GltfPrimitive(GltfDocument& document, const Json& primitive)
    : document_(document),
      attributes_(GltfDocument::member(primitive, "attributes")),
      extension_(GltfDocument::extension(primitive, "KHR_draco_mesh_compression")),
      indices_(document.unsigned_at(primitive, "indices")),
      mode_(document.unsigned_at(primitive, "mode").value_or(kTriangles)) {
  if (mode_ > 6) document.fail("the mode of a primitive is unknown");
  if (!has_triangles()) return;
  if (extension_ == nullptr) {
    vertices_ = document.find_elements(*accessor("POSITION"), 3).count;
    corners_ = indices_ ? document.find_elements(*indices_, 1).count : vertices_;
    return;
  }
  compressed_ = GltfDocument::member(*extension_, "attributes");
  if (compressed_ == nullptr) document.fail("a Draco-compressed primitive names no attributes");
  if (mode_ != kTriangles) document.fail("a Draco-compressed primitive is no list of triangles");
  if (!indices_) document.fail("a Draco-compressed primitive has no indices");
  vertices_ = is_compressed("POSITION") ? document.find_shape(*accessor("POSITION"), 3).count
                                        : document.find_elements(*accessor("POSITION"), 3).count;
  corners_ = document.find_shape(*indices_, 1).count;
  if (corners_ % 3 != 0) document.fail("a Draco-compressed primitive has a part of a triangle");
}

std::optional<std::uint64_t> GltfPrimitive::accessor(const char* attribute) const {
  return attributes_ == nullptr ? std::nullopt : document_.unsigned_at(*attributes_, attribute);
}

bool GltfPrimitive::has(const char* attribute) const {
  return accessor(attribute).has_value();
}

bool GltfPrimitive::is_compressed(const char* attribute) const {
  return compressed_ != nullptr && compressed_->contains(attribute);
}

std::uint64_t GltfPrimitive::decode_bytes() const {
  if (compressed_ == nullptr) return 0;
  return DracoMesh::peak_bytes(document_.view(stream_view()).size(), shape());
}

std::uint64_t GltfPrimitive::stream_view() const {
  const auto view = document_.unsigned_at(*extension_, "bufferView");
  if (!view) document_.fail("a Draco-compressed primitive has no bufferView");
  return *view;
}

DracoMesh::Shape GltfPrimitive::shape() const {
  // Streams may hold a few attributes that the file does not name
  constexpr std::size_t kUnnamed = 2;
  return {
      .points = vertices_, .triangles = corners_ / 3, .attributes = compressed_->size() + kUnnamed};
}

void GltfPrimitive::decode() {
  if (compressed_ == nullptr) return;
  const std::uint64_t view = stream_view();
  const ByteRange range = document_.view(view);
  std::vector<std::byte> stream(range.size());
  range.read(0, stream);
  decoded_.emplace(std::move(stream), shape(),
                   document_.path().string() + ": bufferView " + std::to_string(view));
}

void GltfPrimitive::read(const char* attribute, std::size_t components,
                         const std::function<void(std::span<const double>)>& take) const {
  const std::uint64_t index = *accessor(attribute);
  if (!is_compressed(attribute)) {
    document_.read(document_.find_elements(index, components, vertices_), take);
    return;
  }
  const GltfDocument::Elements shape = document_.find_shape(index, components, vertices_);
  decoded_->read(*document_.unsigned_at(*compressed_, attribute),
                 {.components = components,
                  .normalised = shape.normalised,
                  .may_normalise = shape.type == kGltfFloat},
                 take);
}

void GltfPrimitive::read_corners(const std::function<void(std::uint64_t)>& take) const {
  const auto take_checked = [&](double index) {
    if (!(index >= 0 && index < static_cast<double>(vertices_)))
      document_.fail("an index refers to no vertex");
    take(static_cast<std::uint64_t>(index));
  };
  if (decoded_) {
    decoded_->read_corners([&](std::uint64_t point) { take_checked(static_cast<double>(point)); });
  } else if (indices_) {
    document_.read(document_.find_elements(*indices_, 1),
                   [&](std::span<const double> index) { take_checked(index[0]); });
  } else {
    for (std::uint64_t i = 0; i < vertices_; ++i) take(i);
  }
}

}  // namespace ptc
