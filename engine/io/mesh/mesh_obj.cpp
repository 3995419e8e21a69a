// Reads meshes from Wavefront OBJ: polygons with materials. Source: Wavefront, "Object Files
// (.obj)", Advanced Visualizer manual, appendix B1.
//
//   v x y z [r g b]    a position              f 1/1/1 2/2/1 3/3/1   a polygon, corners
//   vn x y z           a normal                                      POSITION[/[UV][/NORMAL]]
//   vt u v             texture coordinates     usemtl NAME           material of what follows
//   mtllib FILE ...    material libraries      # ...                 comment
//   o NAME             object of what follows  g NAME ...            group of what follows
//
// Groups count as objects in files that have no objects before them. Statements of other kinds
// (curves, lines) are left out and told; smoothing groups mean nothing here. Positions, normals and
// texture coordinates are counted separately; negative indices count backwards from the last one
// read.
#include <algorithm>
#include <array>
#include <exception>
#include <functional>
#include <map>
#include <new>
#include <set>
#include <system_error>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/file/url.h"
#include "engine/io/image/srgb.h"
#include "engine/io/mesh/mesh_soup.h"
#include "engine/io/mesh/mtl.h"
#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

using Corner = MeshSoup::Corner;

class ObjMesh {
 public:
  ObjMesh(const std::filesystem::path& path, const MeshRoom& room)
      : path_(path), stream_(path), soup_(path, room), textures_(path, warnings_, room.textures) {}

  MeshFile read() {
    std::string_view line;
    while (next_logical_line(line)) read_line(line);
    // What has no material is white where vertices have colours
    for (const std::size_t plain : plain_) {
      if (!soup_.colours.empty()) soup_.materials[plain].albedo = glm::vec3(1);
    }
    return mesh_file(std::move(soup_), {}, warnings_.lines());
  }

 private:
  // Reads the next line; a backslash at the end of a line joins it to the next one.
  bool next_logical_line(std::string_view& line) {
    if (!stream_.next_line(line)) return false;
    if (!line.ends_with('\\')) return true;
    joined_.clear();
    do {
      joined_.append(line.substr(0, line.size() - (line.ends_with('\\') ? 1 : 0)));
      if (joined_.size() > ByteStream::kMaxBytesAtOnce) {
        stream_.fail_at_line("the line has more than 64 MiB");
      }
      if (!line.ends_with('\\')) break;
    } while (stream_.next_line(line));
    line = joined_;
    return true;
  }

  void read_line(std::string_view line) {
    line = line.substr(0, line.find('#'));
    Words words(line);
    const std::string_view keyword = words.next();
    if (keyword == "v") {
      const auto p = read_numbers<3>(words, 3);
      soup_.add_position({p[0], p[1], p[2]});
      read_colour(words);
    } else if (keyword == "vn") {
      const auto n = read_numbers<3>(words, 3);
      soup_.add_normal({n[0], n[1], n[2]});
    } else if (keyword == "vt") {
      const auto t = read_numbers<2>(words, 1);
      soup_.add_uv({t[0], t[1]});
    } else if (keyword == "f") {
      read_face(words);
    } else if (keyword == "usemtl") {
      material_ = use_material(std::string(words.rest()));
    } else if (keyword == "mtllib") {
      read_libraries(words);
    } else if (keyword == "o" || (keyword == "g" && !has_objects_)) {
      has_objects_ |= keyword == "o";
      use_object(std::string(words.rest()));
    } else if (!keyword.empty() && keyword != "g" && keyword != "s" && told_.size() < kMostTold &&
               told_.emplace(keyword).second) {
      warnings_.add(kStatementLeftOut, "'" + std::string(keyword) + "'");
    }
  }

  // Reads up to N numbers, of which the first `least` must exist; the others default to 0.
  template <std::size_t N>
  std::array<double, N> read_numbers(Words& words, std::size_t least) const {
    std::array<double, N> numbers{};
    for (std::size_t i = 0; i < N; ++i) {
      const std::string_view word = words.next();
      if (word.empty() && i >= least) break;
      const auto number = parse_number(word);
      if (!number)
        stream_.fail_at_line(word.empty() ? "the vertex has too few values"
                                          : "a value is not a number");
      numbers[i] = *number;
    }
    return numbers;
  }

  // Reads the colour behind a position, on the sRGB curve from 0 to 1. One or two numbers more are
  // no colour.
  void read_colour(Words words) {
    std::array<double, 3> colour{};
    for (double& channel : colour) {
      const auto number = parse_number(words.next());
      if (!number) return;
      channel = srgb_to_linear(std::clamp(*number, 0.0, 1.0));
    }
    soup_.add_colour(soup_.positions.size() - 1, {colour[0], colour[1], colour[2]});
  }

  // Returns the index from 0 on for a word that counts from 1 on, or backwards from -1, the last
  // one read.
  std::uint32_t resolve(std::string_view word, std::size_t count) const {
    const auto index = parse_integer(word);
    const auto limit = static_cast<std::int64_t>(count);
    if (!index || *index == 0 || *index < -limit || *index >= std::int64_t{MeshSoup::kNone}) {
      stream_.fail_at_line("an index refers to no vertex");
    }
    return static_cast<std::uint32_t>(*index < 0 ? limit + *index : *index - 1);
  }

  // Reads a corner: POSITION[/[UV][/NORMAL]].
  Corner read_corner(std::string_view word) const {
    Corner corner;
    const std::size_t slash = word.find('/');
    corner.position = resolve(word.substr(0, slash), soup_.positions.size());
    if (slash == std::string_view::npos) return corner;
    word.remove_prefix(slash + 1);
    const std::size_t second = word.find('/');
    const std::string_view uv = word.substr(0, second);
    if (!uv.empty()) corner.uv = resolve(uv, soup_.uvs.size());
    if (second == std::string_view::npos) return corner;
    const std::string_view normal = word.substr(second + 1);
    if (!normal.empty()) corner.normal = resolve(normal, soup_.normals.size());
    return corner;
  }

  void read_face(Words& words) {
    corners_.clear();
    for (std::string_view word = words.next(); !word.empty(); word = words.next()) {
      corners_.push_back(read_corner(word));
    }
    if (!material_) {
      material_ = soup_.add_material({});
      plain_.push_back(*material_);
    }
    soup_.add_polygon(corners_, *material_);
  }

  // Returns the index of a material in the soup, to which it is added when it is first used.
  std::size_t use_material(const std::string& name) {
    const auto used = used_.find(name);
    if (used != used_.end()) return used->second;
    const auto defined = defined_.find(name);
    Material material;
    material.name = name;
    if (defined != defined_.end()) {
      material = defined->second;
    } else {
      warnings_.add(kMaterialUndefined, "'" + name + "'");
    }
    const std::size_t index = used_[name] = soup_.add_material(std::move(material));
    if (defined == defined_.end()) plain_.push_back(index);
    return index;
  }

  // Puts what follows into an object, which may go on after others.
  void use_object(std::string name) {
    constexpr std::size_t kMaxName = 255;
    name.resize(std::min(name.size(), kMaxName));
    const auto known = objects_.find(name);
    if (known != objects_.end()) {
      soup_.resume_object(known->second);
    } else if (!soup_.spilled() && !soup_.has_too_many_objects()) {
      objects_[name] = soup_.begin_object(name);
      if (!soup_.has_too_many_objects()) return;
      objects_.clear();
      warnings_.add(kObjectsLeftOut, "more than 65,536 objects");
    }
  }

  static bool is_there(const std::filesystem::path& path) {
    try {
      return is_file(path);
    } catch (const std::system_error& error) {  // S3 answers so where nobody may list a folder
      if (error.code() != std::errc::permission_denied) throw;
      return false;
    }
  }

  // Reads libraries: names that are separated by blanks, or one name with blanks in it, which may
  // be escaped by backslashes.
  void read_libraries(Words& words) {
    std::string whole(words.rest());
    std::ranges::replace(whole, '\\', '/');
    if (is_there(file_beside(path_, whole))) {
      read_library(whole);
      return;
    }
    for (std::string_view word = words.next(); !word.empty(); word = words.next()) {
      std::string name(word);
      while (name.ends_with('\\')) {
        name.back() = ' ';
        name.append(words.next());
      }
      std::ranges::replace(name, '\\', '/');
      read_library(name);
    }
  }

  void read_library(const std::string& name) {
    const std::filesystem::path path = file_beside(path_, name);
    if (!libraries_.insert(path.string()).second) return;  // reading again would define nothing new
    try {
      read_mtl(path, textures_, defined_, warnings_);
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const LimitError&) {
      throw;
    } catch (const std::exception& error) {
      if (is_net_failure(path, error)) throw;
      warnings_.add(kLibraryLeftOut, reason_for(name, path, error));
    }
  }

  std::filesystem::path path_;
  ByteStream stream_;
  std::string joined_;  // the line of next_logical_line() when it was joined
  MeshSoup soup_;
  static constexpr std::size_t kMostTold = 64;
  MeshWarnings warnings_;
  std::set<std::string, std::less<>> told_;  // statements that are left out
  TextureLoader textures_;
  std::set<std::string> libraries_;               // paths of libraries that were read
  std::map<std::string, Material> defined_;       // materials of the libraries by name
  std::map<std::string, std::size_t> used_;       // index in the soup by name
  std::optional<std::size_t> material_;           // of the next face
  std::vector<std::size_t> plain_;                // materials that no library defines
  std::map<std::string, std::uint32_t> objects_;  // index in the soup by name
  bool has_objects_ = false;                      // there was an `o`
  std::vector<Corner> corners_;                   // of one face, kept between calls
};

}  // namespace

MeshFile read_obj_mesh(const std::filesystem::path& path, const MeshRoom& room) {
  return ObjMesh(path, room).read();
}

}  // namespace ptc
