// Reads meshes from STL, text and binary. Source: 3D Systems, "StereoLithography Interface
// Specification", 1988.
#include <array>
#include <bit>
#include <cstring>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/mesh/mesh_soup.h"
#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

static_assert(std::endian::native == std::endian::little, "binary STL is little-endian");

constexpr std::size_t kHeaderBytes = 84;    // 80 bytes of free text, u32 number of triangles
constexpr std::size_t kTriangleBytes = 50;  // normal, three positions, 16 bits without meaning

class StlMesh {
 public:
  StlMesh(const std::filesystem::path& path, const MeshRoom& room)
      : path_(path), soup_(path, room) {}

  MeshFile read() {
    if (!read_binary()) read_text();
    return mesh_file(std::move(soup_), {}, {});
  }

 private:
  // Reads a binary file, or returns false when the file is text. The size of the file decides: text
  // begins with "solid", but so do the headers of many binary files.
  bool read_binary() {
    ByteStream stream(path_);
    const std::uint64_t bytes = stream.max_left();
    if (bytes < kHeaderBytes) return false;
    std::uint32_t count = 0;
    std::memcpy(&count, stream.take(kHeaderBytes).data() + 80, sizeof count);
    if (bytes - kHeaderBytes != std::uint64_t{count} * kTriangleBytes) return false;
    for (std::uint32_t i = 0; i < count; ++i) {
      std::array<float, 12> values{};
      std::memcpy(values.data(), stream.take(kTriangleBytes).data(), sizeof values);
      for (std::size_t k = 3; k < 12; k += 3) {
        add_corner({values[k], values[k + 1], values[k + 2]});
      }
      end_facet();
    }
    return true;
  }

  // Reads text: "vertex x y z" between "outer loop" and "endloop". The normals of facets are
  // ignored, because those of the triangles are exact.
  void read_text() {
    ByteStream stream(path_);
    std::string_view line;
    bool open = false;
    while (stream.next_line(line)) {
      Words words(line);
      const std::string_view keyword = words.next();
      if (keyword == "vertex") {
        add_corner(read_vertex(stream, words));
      } else if (keyword == "endloop") {
        end_facet();
      } else if (keyword == "solid" || keyword == "endsolid") {
        open = keyword == "solid";
      } else if (!keyword.empty() && keyword != "facet" && keyword != "outer" &&
                 keyword != "endfacet") {
        stream.fail_at_line("the line does not begin with a keyword of STL");
      }
    }
    if (open) stream.fail_at_line("the file ends too early");
  }

  static glm::dvec3 read_vertex(const ByteStream& stream, Words& words) {
    glm::dvec3 position;
    for (int i = 0; i < 3; ++i) {
      const auto value = parse_number(words.next());
      if (!value) stream.fail_at_line("the vertex does not have three numbers");
      position[i] = *value;
    }
    return position;
  }

  void add_corner(const glm::dvec3& position) {
    if (soup_.positions.size() >= MeshSoup::kNone)
      throw DataError(path_.string() + ": the file has more than 2^32 / 3 triangles");
    corners_.push_back(
        {static_cast<std::uint32_t>(soup_.positions.size()), MeshSoup::kNone, MeshSoup::kNone});
    soup_.add_position(position);
  }

  void end_facet() {
    soup_.add_polygon(corners_, 0);
    corners_.clear();
  }

  std::filesystem::path path_;
  MeshSoup soup_;
  std::vector<MeshSoup::Corner> corners_;
};

}  // namespace

MeshFile read_stl_mesh(const std::filesystem::path& path, const MeshRoom& room) {
  return StlMesh(path, room).read();
}

}  // namespace ptc
