// Reads meshes from OFF text. Source: Geomview manual, "OFF Files".
//
//   OFF                 or STOFF, COFF, NOFF, STCNOFF, ...: what each vertex has
//   8 6 0               numbers of vertices, faces and edges (the last is ignored)
//   0 0 1               a vertex for each line: x y z [nx ny nz] [colour] [s t]
//   4 0 1 2 3           a face for each line: number of corners, indices from 0 on [colour]
#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/mesh/mesh_soup.h"
#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

using Corner = MeshSoup::Corner;

class OffMesh {
 public:
  OffMesh(const std::filesystem::path& path, const MeshRoom& room)
      : stream_(path), soup_(path, room) {}

  MeshFile read() {
    read_header();
    for (std::uint64_t i = 0; i < vertices_; ++i) read_vertex();
    for (std::uint64_t i = 0; i < faces_; ++i) read_face();
    return mesh_file(std::move(soup_), {}, {});
  }

 private:
  // Returns the next line that has words, without its comment. It lies in the stream's buffer.
  std::string_view next_content() {
    std::string_view line;
    do {
      if (!stream_.next_line(line)) stream_.fail_at_line("the file ends too early");
      line = line.substr(0, line.find('#'));
    } while (Words(line).next().empty());
    return line;
  }

  std::uint64_t count(Words& words) const {
    const auto number = parse_integer(words.next());
    if (!number || *number < 0)
      stream_.fail_at_line("the numbers of vertices and faces are missing");
    return static_cast<std::uint64_t>(*number);
  }

  // Reads the header: [ST][C][N]OFF, which may be missing, then the counts on the same line or the
  // next.
  void read_header() {
    std::string_view line = next_content();
    const std::size_t mark = line.find("OFF");
    if (mark != std::string_view::npos) {
      std::string_view prefix = Words(line.substr(0, mark)).rest();
      has_uvs_ = take_prefix(prefix, "ST");
      take_prefix(prefix, "C");
      has_normals_ = take_prefix(prefix, "N");
      if (!prefix.empty()) stream_.fail_at_line("this kind of OFF is not supported");
      line = line.substr(mark + 3);
      if (Words(line).next() == "BINARY") stream_.fail_at_line("binary OFF is not supported");
      if (Words(line).next().empty()) line = next_content();
    }
    Words words(line);
    vertices_ = count(words);
    faces_ = count(words);
    // A vertex takes at least "0 0 0" and a line end, a face at least "0" and a line end.
    const std::uint64_t left = stream_.max_left() + 1;
    if (vertices_ > left / 6 || faces_ > (left - 6 * vertices_) / 2) {
      stream_.fail_at_line("the header counts more vertices or faces than the file can hold");
    }
  }

  // Removes a part from the front of the prefix, if it is there.
  static bool take_prefix(std::string_view& prefix, std::string_view part) {
    if (!prefix.starts_with(part)) return false;
    prefix.remove_prefix(part.size());
    return true;
  }

  // Reads x y z [nx ny nz] [colour] [s t]. Texture coordinates are the last two values, because a
  // colour may have three or four components.
  void read_vertex() {
    std::array<double, 16> values{};
    std::size_t n = 0;
    Words words(next_content());
    for (std::string_view word = words.next(); !word.empty(); word = words.next()) {
      const auto value = parse_number(word);
      if (!value) stream_.fail_at_line("a value is not a number");
      if (n == values.size()) stream_.fail_at_line("the vertex has more values than OFF allows");
      values[n++] = *value;
    }
    const std::size_t least = 3U + (has_normals_ ? 3U : 0U) + (has_uvs_ ? 2U : 0U);
    if (n < least) stream_.fail_at_line("the vertex has too few values");
    soup_.add_position({values[0], values[1], values[2]});
    if (has_normals_) soup_.add_normal({values[3], values[4], values[5]});
    if (has_uvs_) soup_.add_uv({values[n - 2], values[n - 1]});
  }

  void read_face() {
    Words words(next_content());
    const auto size = parse_integer(words.next());
    if (!size || *size < 0) stream_.fail_at_line("a face must begin with its number of corners");
    corners_.clear();
    for (std::int64_t i = 0; i < *size; ++i) {
      const std::string_view word = words.next();
      const auto index = parse_integer(word);
      if (word.empty()) stream_.fail_at_line("the face has fewer corners than it declares");
      if (!index || *index < 0 || static_cast<std::uint64_t>(*index) >= soup_.positions.size() ||
          *index >= MeshSoup::kNone) {
        stream_.fail_at_line("an index refers to no vertex");
      }
      const auto at = static_cast<std::uint32_t>(*index);
      corners_.push_back(
          {at, has_normals_ ? at : MeshSoup::kNone, has_uvs_ ? at : MeshSoup::kNone});
    }
    soup_.add_polygon(corners_, 0);
  }

  ByteStream stream_;
  MeshSoup soup_;
  std::uint64_t vertices_ = 0;  // as the header counts them
  std::uint64_t faces_ = 0;     // as the header counts them
  bool has_normals_ = false;
  bool has_uvs_ = false;
  std::vector<Corner> corners_;  // of one face, kept between calls
};

}  // namespace

MeshFile read_off_mesh(const std::filesystem::path& path, const MeshRoom& room) {
  return OffMesh(path, room).read();
}

}  // namespace ptc
