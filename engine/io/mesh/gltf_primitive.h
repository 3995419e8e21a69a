// Internal to the glTF reader: vertices and corners of a primitive, wherever the file keeps them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "engine/io/mesh/gltf_document.h"
#include "engine/io/mesh/gltf_draco.h"

namespace ptc {

/// A primitive whose attributes and indices lie in accessors or, in their place, in a stream of
/// Draco (KHR_draco_mesh_compression).
class GltfPrimitive {
 public:
  using Json = GltfDocument::Json;

  /// Reads what the JSON says. Both must outlive this.
  /// @throws DataError when that breaks a rule
  GltfPrimitive(GltfDocument& document, const Json& primitive);

  /// Returns the mode: 4 to 6 are triangles, strips and fans; less are points and lines.
  [[nodiscard]] std::uint64_t mode() const noexcept { return mode_; }
  /// Says whether there are triangles: no points or lines, and positions.
  [[nodiscard]] bool has_triangles() const { return mode_ >= 4 && has("POSITION"); }
  /// Says whether there is an attribute of this name.
  [[nodiscard]] bool has(const char* attribute) const;
  /// Returns the index of the accessor of an attribute, or nothing.
  [[nodiscard]] std::optional<std::uint64_t> accessor(const char* attribute) const;
  /// Says whether there is a stream.
  [[nodiscard]] bool is_compressed() const noexcept { return compressed_ != nullptr; }
  /// Says whether a stream holds an attribute.
  [[nodiscard]] bool is_compressed(const char* attribute) const;

  /// Returns the number of vertices. @pre has_triangles() @throws DataError
  [[nodiscard]] std::uint64_t vertices() const { return vertices_; }
  /// Returns the number of corners, in the order of the mode.
  [[nodiscard]] std::uint64_t corners() const { return corners_; }

  /// Returns the memory that decode() takes, bytes; 0 without a stream.
  [[nodiscard]] std::uint64_t decode_bytes() const;
  /// Decodes the stream, if there is one, before anything is read.
  /// @throws DataError when it is damaged or does not match the accessors; std::system_error
  void decode();

  /// Reads an attribute of all vertices; normalised integers are scaled.
  /// @param components  numbers of each vertex
  /// @param take        is called with these
  /// @pre    has(attribute)
  /// @throws DataError when it has another shape; std::system_error
  void read(const char* attribute, std::size_t components,
            const std::function<void(std::span<const double>)>& take) const;
  /// Reads the vertices of all corners. @throws as read(), and when there is no such vertex
  void read_corners(const std::function<void(std::uint64_t)>& take) const;

 private:
  [[nodiscard]] DracoMesh::Shape shape() const;
  /// Returns the bufferView of the stream. @throws DataError when it has none
  [[nodiscard]] std::uint64_t stream_view() const;

  GltfDocument& document_;
  const Json* attributes_;                ///< null without any
  const Json* extension_;                 ///< null without a stream
  const Json* compressed_ = nullptr;      ///< ids of attributes in the stream
  std::optional<std::uint64_t> indices_;  ///< accessor
  std::uint64_t mode_;
  std::uint64_t vertices_ = 0, corners_ = 0;
  std::optional<DracoMesh> decoded_;
};

}  // namespace ptc
