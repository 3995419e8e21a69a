#include "engine/pipeline/build/meshes.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "engine/base/surfel.h"
#include "engine/pipeline/point_input.h"
#include "engine/scene/ray_scene.h"

namespace ptc {
namespace {

constexpr std::size_t kBackdropTriangles = 24;  // of its two boxes, the last ones of the mesh

/// Appends a box of 12 triangles whose front sides face outwards.
/// @param low, high  opposite corners, scene units
/// @param field      as for append_mesh()
void add_box(Mesh& mesh, const glm::dvec3& low, const glm::dvec3& high, const Material& material,
             const char* field) {
  Mesh box;
  box.origin = low;
  box.materials.push_back(material);
  const glm::vec3 size(high - low);
  for (int corner = 0; corner < 8; ++corner) {
    box.positions.emplace_back(corner & 1 ? size.x : 0, corner & 2 ? size.y : 0,
                               corner & 4 ? size.z : 0);
  }
  constexpr std::uint32_t kQuads[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                          {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& q : kQuads) {
    box.triangles.push_back({q[0], q[1], q[2]});
    box.triangles.push_back({q[0], q[2], q[3]});
    box.material_of.insert(box.material_of.end(), 2, 0);
  }
  append_mesh(mesh, box, glm::dmat4(1), field);
}

/// Makes a ground below a box and a red wall to its left.
void add_backdrop(Mesh& mesh, const Bounds& bounds, const char* field) {
  const glm::dvec3 extent = bounds.high - bounds.low;
  const double size = std::max({extent.x, extent.y, extent.z});
  const glm::dvec3 middle = (bounds.low + bounds.high) * 0.5;
  const double floor = bounds.low.y;
  const double wall = bounds.low.x - 0.15 * size;
  add_box(mesh, {middle.x - 1.6 * size, floor - 0.04 * size, middle.z - 1.6 * size},
          {middle.x + 1.6 * size, floor, middle.z + 1.6 * size},
          {.name = "ground", .albedo = glm::vec3(0.6F)}, field);
  add_box(mesh, {wall - 0.05 * size, floor, middle.z - 0.8 * size},
          {wall, floor + 0.9 * size, middle.z + 0.8 * size},
          {.name = "wall", .albedo = glm::vec3(0.65F, 0.07F, 0.05F)}, field);
}

/// Joins meshes: in memory as long as they fit, else as parts.
class Joiner {
 public:
  Joiner(const MeshLimits& limits, const char* field) : limits_(limits), field_(field) {}

  /// Returns the room that is left for another mesh.
  [[nodiscard]] MeshRoom room() const {
    const std::uint64_t held = parts_ ? parts_->bytes() : bytes_of(mesh_);
    return {limits_.reading > held ? limits_.reading - held : 0, limits_.temp_directory};
  }

  // The first mesh is taken over, so that a single one is never copied
  template <class M>
  void add(M&& mesh) {
    if (parts_) {
      parts_->add(std::forward<M>(mesh));
    } else if (mesh_.triangles.empty()) {
      mesh_ = std::forward<M>(mesh);
    } else {
      append_mesh(mesh_, mesh, glm::dmat4(1), field_);
      joined_ = true;
    }
  }
  void add(std::shared_ptr<const SpilledMesh> mesh) {
    divide();
    parts_->add(std::move(mesh));
  }

  [[nodiscard]] LoadedMeshes take(bool backdrop) {
    if (joined_) check_mesh(mesh_, field_);  // meshes may lie too far from each other
    if (traced_bytes() > limits_.traced) divide();
    if (backdrop && parts_) {
      Mesh boxes;
      add_backdrop(boxes, parts_->bounds(), field_);
      parts_->add(std::move(boxes));
    } else if (backdrop && !mesh_.triangles.empty()) {
      add_backdrop(mesh_, mesh_.bounds(), field_);
    }
    return {std::move(mesh_), std::move(parts_)};
  }

 private:
  /// Returns the memory of the mesh with what rays at it and its sampling take.
  [[nodiscard]] std::uint64_t traced_bytes() const {
    constexpr std::uint64_t kRayBytes = 90, kSamplingBytes = 24;  // for each triangle
    return bytes_of(mesh_) + mesh_.triangles.size() * (kRayBytes + kSamplingBytes);
  }
  void divide() {
    if (parts_) return;
    parts_ = std::make_unique<MeshParts>();
    parts_->add(std::exchange(mesh_, {}));
  }

  MeshLimits limits_;
  const char* field_;
  Mesh mesh_;
  std::unique_ptr<MeshParts> parts_;
  bool joined_ = false;
};

}  // namespace

LoadedMeshes load_meshes(const std::vector<std::filesystem::path>& inputs, const Mesh* also,
                         bool backdrop, const MeshLimits& limits, Progress& progress,
                         std::vector<MeshCamera>* cameras, const char* field) {
  // Read the mesh files
  Joiner joiner(limits, field);
  for (const std::filesystem::path& input : inputs) {
    if (holds_points(input)) continue;
    MeshFile file = read_mesh(input, joiner.room());
    for (const std::string& warning : file.warnings) {
      progress.note(input.string() + ": " + warning);
    }
    if (cameras) cameras->insert(cameras->end(), file.cameras.begin(), file.cameras.end());
    if (file.spilled) {
      joiner.add(std::move(file.spilled));
    } else {
      joiner.add(std::move(file.mesh));
    }
  }

  // Add the mesh in memory and the backdrop
  if (also) {
    check_mesh(*also);
    joiner.add(*also);
  }
  return joiner.take(backdrop);
}

Bounds bounds_before_backdrop(const Mesh& mesh) {
  Bounds bounds;
  for (std::size_t i = 0; i + kBackdropTriangles < mesh.triangles.size(); ++i) {
    for (const std::uint32_t vertex : mesh.triangles[i])
      bounds.add(mesh.origin + glm::dvec3(mesh.positions[vertex]));
  }
  return bounds;
}

}  // namespace ptc
