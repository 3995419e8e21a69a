// Reads meshes from PLY: faces or triangle strips.
#include <algorithm>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/cloud/ply.h"
#include "engine/io/image/srgb.h"
#include "engine/io/mesh/mesh_soup.h"
#include "engine/io/mesh/mesh_warnings.h"

namespace ptc {
namespace {

using Corner = MeshSoup::Corner;

class PlyMesh {
 public:
  PlyMesh(const std::filesystem::path& path, const MeshRoom& room)
      : path_(path), reader_(path), soup_(path, room) {
    vertex_ = reader_.find("vertex");
    if (vertex_ == nullptr) throw DataError(path.string() + ": the PLY file has no vertices");
    // Find the properties now, because faces may come before the vertices and need to know them.
    position_ = find_all<3>({{{"x"}, {"y"}, {"z"}}});
    if (!position_) throw DataError(path.string() + ": the PLY vertices lack x, y or z");
    normal_ = find_all<3>({{{"nx", "normal_x"}, {"ny", "normal_y"}, {"nz", "normal_z"}}});
    uv_ = find_all<2>({{{"u", "s", "texture_u"}, {"v", "t", "texture_v"}}});
    colour_ = find_all<3>({{{"red", "r", "diffuse_red"},
                            {"green", "g", "diffuse_green"},
                            {"blue", "b", "diffuse_blue"}}});
    if (colour_) soup_.add_material({.albedo = glm::vec3(1)});
  }

  MeshFile read() {
    for (const PlyElement& element : reader_.elements()) {
      if (element.name == "vertex") {
        read_vertices(element);
      } else if (element.name == "face") {
        read_faces(element, false);
      } else if (element.name == "tristrips") {
        read_faces(element, true);
      } else {
        reader_.skip(element);
      }
    }
    reader_.require_end();
    return mesh_file(std::move(soup_), {}, warnings_.lines());
  }

 private:
  // Returns the indices of N scalar properties, each known by one of several names, if all exist.
  template <std::size_t N>
  std::optional<std::array<std::size_t, N>> find_all(
      const std::array<std::initializer_list<std::string_view>, N>& names) const {
    std::array<std::size_t, N> found{};
    for (std::size_t i = 0; i < N; ++i) {
      const auto index = vertex_->find_any(names[i]);
      if (!index || vertex_->properties[*index].length_type) return std::nullopt;
      found[i] = *index;
    }
    return found;
  }

  // Returns the value of a colour that stands for 1.
  static double most_of(PlyType type) {
    switch (type) {
      case PlyType::float32:
      case PlyType::float64:
        return 1;
      case PlyType::uint16:
        return 65535;
      default:  // wider integers hold bytes
        return 255;
    }
  }

  void read_vertices(const PlyElement& element) {
    PlyRecord record;
    for (std::uint64_t i = 0; i < element.count; ++i) {
      reader_.read(element, record);
      const auto value = [&](std::size_t at) { return record.scalars[at]; };
      const auto& p = *position_;
      soup_.add_position({value(p[0]), value(p[1]), value(p[2])});
      if (normal_) {
        const auto& n = *normal_;
        soup_.add_normal({value(n[0]), value(n[1]), value(n[2])});
      }
      if (uv_) soup_.add_uv({value((*uv_)[0]), value((*uv_)[1])});
      if (colour_) {
        const auto linear = [&](std::size_t at) {
          return srgb_to_linear(
              std::clamp(value(at) / most_of(element.properties[at].type), 0.0, 1.0));
        };
        const auto& c = *colour_;
        soup_.add_colour(i, {linear(c[0]), linear(c[1]), linear(c[2])});
      }
    }
  }

  void read_faces(const PlyElement& element, bool strips) {
    const auto indices = element.find_any({"vertex_indices", "vertex_index"});
    const PlyProperty* const list = indices ? &element.properties[*indices] : nullptr;
    if (list == nullptr || !list->length_type || list->type == PlyType::float32 ||
        list->type == PlyType::float64) {
      throw DataError(path_.string() + ": PLY element '" + element.name +
                      "' lacks a list of integers vertex_indices");
    }
    if (element.count > 0 && element.find_any({"red", "diffuse_red"}))
      warnings_.add(kFaceColourLeftOut, "element '" + element.name + "'");
    PlyRecord record;
    for (std::uint64_t i = 0; i < element.count; ++i) {
      reader_.read(element, record);
      if (strips) {
        add_strip(record, record.lists[*indices]);
      } else {
        corners_.clear();
        for (const double index : record.lists[*indices]) corners_.push_back(corner(record, index));
        soup_.add_polygon(corners_, 0);
      }
    }
  }

  // Adds a triangle for each index and the two before it; every second triangle is turned over. An
  // index of -1 begins a new strip.
  void add_strip(const PlyRecord& record, const std::vector<double>& indices) {
    corners_.clear();
    for (const double index : indices) {
      if (index == -1) {
        corners_.clear();
        continue;
      }
      corners_.push_back(corner(record, index));
      const std::size_t n = corners_.size();
      if (n < 3) continue;
      const bool turned = n % 2 == 0;
      const std::array<Corner, 3> triangle = {corners_[turned ? n - 2 : n - 3],
                                              corners_[turned ? n - 3 : n - 2], corners_[n - 1]};
      soup_.add_polygon(triangle, 0);
    }
  }

  Corner corner(const PlyRecord& record, double index) const {
    if (!(index >= 0 && index < static_cast<double>(vertex_->count) && index < MeshSoup::kNone)) {
      reader_.fail(record, "an index refers to no vertex");
    }
    const auto at = static_cast<std::uint32_t>(index);
    return {at, normal_ ? at : MeshSoup::kNone, uv_ ? at : MeshSoup::kNone};
  }

  std::filesystem::path path_;
  PlyReader reader_;
  const PlyElement* vertex_ = nullptr;
  std::optional<std::array<std::size_t, 3>> position_;
  std::optional<std::array<std::size_t, 3>> normal_;
  std::optional<std::array<std::size_t, 2>> uv_;
  std::optional<std::array<std::size_t, 3>> colour_;
  MeshSoup soup_;
  MeshWarnings warnings_;
  std::vector<Corner> corners_;
};

}  // namespace

MeshFile read_ply_mesh(const std::filesystem::path& path, const MeshRoom& room) {
  return PlyMesh(path, room).read();
}

}  // namespace ptc
