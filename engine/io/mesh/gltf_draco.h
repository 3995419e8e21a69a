// Internal to the glTF reader: meshes that are compressed by Draco.
// Source: Khronos, "KHR_draco_mesh_compression"; Google, "Draco Bitstream Specification", 2.2.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace draco {
class Mesh;
}

namespace ptc {

/// A mesh from a stream of Draco: points with attributes, and triangles over them.
class DracoMesh {
 public:
  /// What the file says of a stream, which must be so.
  struct Shape {
    std::uint64_t points = 0;
    std::uint64_t triangles = 0;
    std::size_t attributes = 0;  ///< at most; of 1 to 4 numbers each
  };
  /// Returns the memory that decoding takes at its peak, bytes. Tables of the library's entropy
  /// coders are not counted. They take a few MiB, but in a damaged stream up to 1 KiB for each of
  /// its bytes and, for some seconds, 256 MiB for flags of texture coordinates.
  [[nodiscard]] static std::uint64_t peak_bytes(std::uint64_t stream_bytes,
                                                const Shape& shape) noexcept;

  /// Decodes a stream.
  /// @param name  name of the stream for errors
  /// @throws DataError when it is damaged, or has another shape
  DracoMesh(std::vector<std::byte> stream, const Shape& shape, std::string name);
  ~DracoMesh();
  DracoMesh(DracoMesh&&) noexcept;
  DracoMesh& operator=(DracoMesh&&) noexcept;

  /// How an attribute is read.
  struct Reading {
    std::size_t components;   ///< numbers of each point
    bool normalised = false;  ///< whether integers are scaled to [0, 1] or [-1, 1]
    /// Whether they are scaled if the stream says so.
    bool may_normalise = false;
  };
  /// Reads an attribute of all points, in their order.
  /// @param id    unique id of the attribute
  /// @param take  is called with the numbers of each point
  /// @throws DataError when there is no such attribute
  void read(std::uint64_t id, const Reading& reading,
            const std::function<void(std::span<const double>)>& take) const;
  /// Reads the points of the corners of all triangles.
  void read_corners(const std::function<void(std::uint64_t)>& take) const;

 private:
  [[noreturn]] void fail(const std::string& rule) const;

  std::string name_;
  std::unique_ptr<draco::Mesh> mesh_;
};

}  // namespace ptc
