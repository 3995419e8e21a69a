// Nodes of glTF: transforms, which animations may set, multiply on the way down from the roots of
// the default scene.
#include "engine/io/mesh/gltf_nodes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>

#include "engine/base/error.h"
#include "engine/io/mesh/gltf_animation.h"
#include "engine/io/mesh/mesh_soup.h"

namespace ptc {
namespace {

using Json = GltfDocument::Json;

constexpr char kLights[] = "KHR_lights_punctual";
constexpr char kInstancing[] = "EXT_mesh_gpu_instancing";

class NodeWalk {
 public:
  NodeWalk(GltfDocument& document, GltfSearch search, std::optional<double> seconds, Motion part,
           std::uint64_t memory_bytes, MeshWarnings& warnings)
      : document_(document),
        search_(search),
        part_(part),
        animation_(document, seconds, warnings),
        memory_bytes_(memory_bytes),
        warnings_(warnings),
        visited_(document.count("nodes")) {}

  GltfNodes walk() {
    walk_nodes();
    found_.animation_seconds = animation_.end_seconds();
    return std::move(found_);
  }

 private:
  // Notes that a mesh stands in a place.
  void add_use(std::uint64_t mesh, std::uint64_t node, const glm::dmat4& world) {
    found_.uses.push_back({mesh, node, Placement(world)});
    constexpr std::size_t kUsesBetweenChecks = 1 << 12;
    if (found_.uses.size() % kUsesBetweenChecks == 0) check_uses(found_.uses.size());
  }

  // Checks that so many places fit in memory, twice: here and in what comes of it.
  void check_uses(std::uint64_t count) const {
    if (count <= memory_bytes_ / (2 * (sizeof(GltfUse) + sizeof(Placement)))) return;
    throw LimitError(document_.path().string() + ": its " + std::to_string(count) +
                     " instances take more memory than there is: raise the cap");
  }

  // Notes the instances of a node. Source: Khronos, EXT_mesh_gpu_instancing.
  void add_instances(std::uint64_t mesh, std::uint64_t node, const Json& instancing,
                     const glm::dmat4& world) {
    const Json* const attributes = GltfDocument::member(instancing, "attributes");
    if (attributes == nullptr) document_.fail("the instances of a node have no attributes");
    std::optional<std::uint64_t> count;
    const auto find = [&](const char* key, std::size_t components) {
      const auto accessor = document_.unsigned_at(*attributes, key);
      if (!accessor) return GltfDocument::Elements{};
      const GltfDocument::Elements found = document_.find_elements(*accessor, components, count);
      count = found.count;
      check_uses(found_.uses.size() + found.count);
      return found;
    };
    const GltfDocument::Elements translations = find("TRANSLATION", 3);
    const GltfDocument::Elements rotations = find("ROTATION", 4);
    const GltfDocument::Elements scales = find("SCALE", 3);
    if (!count) return add_use(mesh, node, world);
    std::vector<GltfTransform> parts(*count);
    const auto read = [&](const GltfDocument::Elements& from, auto member) {
      if (from.components == 0) return;
      std::size_t at = 0;
      document_.read(from, [&](std::span<const double> numbers) {
        std::ranges::copy(numbers, (parts[at++].*member).begin());
      });
    };
    read(translations, &GltfTransform::translation);
    read(rotations, &GltfTransform::rotation);
    read(scales, &GltfTransform::scale);
    for (const GltfTransform& part : parts) add_use(mesh, node, world * part.matrix());
  }

  // Returns the nodes of the default scene or, in a file without scenes, those without a parent.
  std::vector<std::uint64_t> root_nodes() const {
    if (document_.count("scenes") > 0) {
      const std::uint64_t scene = document_.unsigned_at(document_.root(), "scene").value_or(0);
      return node_list(document_.at("scenes", scene), "nodes");
    }
    std::vector<bool> child(document_.count("nodes"));
    for (std::size_t i = 0; i < child.size(); ++i) {
      for (const std::uint64_t c : node_list(document_.at("nodes", i), "children")) {
        if (c < child.size()) child[c] = true;
      }
    }
    std::vector<std::uint64_t> roots;
    for (std::size_t i = 0; i < child.size(); ++i) {
      if (!child[i]) roots.push_back(i);
    }
    return roots;
  }

  std::vector<std::uint64_t> node_list(const Json& object, const char* key) const {
    const auto found = object.find(key);
    if (found == object.end()) return {};
    if (!found->is_array()) document_.fail(std::string(key) + " is not an array");
    std::vector<std::uint64_t> nodes;
    for (const Json& index : *found) {
      if (!index.is_number_unsigned())
        document_.fail(std::string(key) + " holds a value that is not an index");
      nodes.push_back(index.get<std::uint64_t>());
    }
    return nodes;
  }

  // Notes the meshes, cameras and lights of all nodes, parents before their children.
  void walk_nodes() {
    struct Open {
      std::uint64_t node;
      glm::dmat4 parent;
      bool parent_moves;
    };
    std::vector<Open> open;
    const auto push = [&](std::vector<std::uint64_t> nodes, const glm::dmat4& parent, bool moves) {
      std::ranges::reverse(nodes);  // the last one pushed is the next one read
      for (const std::uint64_t node : nodes) open.push_back({node, parent, moves});
    };
    push(root_nodes(), glm::dmat4(1), false);
    while (!open.empty()) {
      const auto [index, parent, parent_moves] = open.back();
      open.pop_back();
      const Json& node = document_.at("nodes", index);
      if (visited_[index]) {
        document_.fail("node " + std::to_string(index) + " has two parents or contains itself");
      }
      visited_[index] = true;
      const GltfAnimation::Pose pose = animation_.pose(index);
      const glm::dmat4 world = parent * pose.local;
      const bool moves = parent_moves || pose.moves;
      if (const auto camera = document_.unsigned_at(node, "camera"))
        add_camera(*camera, node, world);
      const bool shows = node.contains("mesh") || GltfDocument::extension(node, kLights) != nullptr;
      found_.moves_mesh |= moves && shows;
      const bool wanted = part_ == Motion::any || moves == (part_ == Motion::moving);
      if (search_ == GltfSearch::all && wanted) add_shown(index, node, world);
      push(node_list(node, "children"), world, moves);
    }
  }

  // Notes the mesh and the light of a node.
  void add_shown(std::uint64_t index, const Json& node, const glm::dmat4& world) {
    if (const auto mesh = document_.unsigned_at(node, "mesh")) {
      if (GltfDocument::has_weights(node))
        warnings_.add(kWeightsLeftOut, "node " + std::to_string(index));
      if (const Json* const instancing = GltfDocument::extension(node, kInstancing)) {
        add_instances(*mesh, index, *instancing, world);
      } else {
        add_use(*mesh, index, world);
      }
    }
    if (const Json* const light = GltfDocument::extension(node, kLights)) add_light(*light, world);
  }

  // Returns the name of an object; empty if it has none.
  static std::string name_of(const Json& object) {
    const auto name = object.find("name");
    return name == object.end() || !name->is_string() ? std::string() : name->get<std::string>();
  }

  // Adds a perspective camera, which looks along -z with y up (section 3.10).
  void add_camera(std::uint64_t index, const Json& node, const glm::dmat4& world) {
    const Json& json = document_.at("cameras", index);
    const Json* const perspective = GltfDocument::member(json, "perspective");
    if (perspective == nullptr) {
      if (cameras_left_out_.insert(index).second)
        warnings_.add(kCameraLeftOut,
                      "camera " + std::to_string(index) + ", not a perspective one");
      return;
    }
    const double vertical = document_.number_at(*perspective, "yfov", 0.7);
    const double aspect = document_.number_at(*perspective, "aspectRatio", 16.0 / 9);
    auto camera = make_camera(glm::dvec3(world[3]), -glm::dvec3(world[2]), glm::dvec3(world[1]),
                              2 * std::atan(std::tan(vertical / 2) * aspect));
    if (camera) {
      camera->name = name_of(node);
      if (camera->name.empty()) camera->name = name_of(json);
      found_.cameras.push_back(std::move(*camera));
    } else if (cameras_left_out_.insert(index).second) {
      warnings_.add(kCameraLeftOut, "camera " + std::to_string(index));
    }
  }

  // Adds a light, which shines along -z. Its range is left out, since light has no end.
  // Source: Khronos, KHR_lights_punctual.
  void add_light(const Json& of_node, const glm::dmat4& world) {
    const Json* const all = GltfDocument::extension(document_.root(), kLights);
    const auto index = document_.unsigned_at(of_node, "light");
    const auto list = all == nullptr ? Json::const_iterator() : all->find("lights");
    if (!index || all == nullptr || list == all->end() || !list->is_array() ||
        *index >= list->size() || !(*list)[*index].is_object()) {
      document_.fail("a node shows a light that does not exist");
    }
    const Json& json = (*list)[*index];
    const auto type = json.find("type");
    MeshLight light{.position = glm::dvec3(world[3])};
    if (type != json.end() && *type == "directional") {
      light.kind = MeshLight::Kind::sun;
    } else if (type != json.end() && *type == "spot") {
      light.kind = MeshLight::Kind::spot;
      set_cone(json, light);
    } else if (type == json.end() || *type != "point") {
      document_.fail("a light is neither directional, point nor spot");
    }
    const auto colour = document_.numbers_at<3>(json, "color").value_or(std::array{1.0, 1.0, 1.0});
    const double intensity = document_.number_at(json, "intensity", 1);
    for (std::size_t i = 0; i < 3; ++i) {
      const double value = colour[i] * intensity;
      light.intensity[static_cast<int>(i)] =
          static_cast<float>(std::clamp<double>(value, 0, std::numeric_limits<float>::max()));
    }
    const glm::dvec3 axis = -glm::dvec3(world[2]);
    const double length = glm::length(axis);
    const bool aims = std::isfinite(length) && length > 0;
    const glm::dvec3& p = light.position;
    if (!std::isfinite(p.x + p.y + p.z) || (!aims && light.kind != MeshLight::Kind::point)) {
      warnings_.add(kLightLeftOut, "light " + std::to_string(*index));
      return;
    }
    if (aims) light.direction = glm::vec3(axis / length);
    found_.lights.push_back(light);
  }

  void set_cone(const Json& json, MeshLight& light) const {
    const auto spot = json.find("spot");
    if (spot == json.end() || !spot->is_object()) return;
    constexpr double kLeast = 1e-4, kMost = 1.5707963;
    const double outer =
        std::clamp(document_.number_at(*spot, "outerConeAngle", 0.7853981633974483), kLeast, kMost);
    light.outer_angle = static_cast<float>(outer);
    light.inner_angle =
        static_cast<float>(std::clamp(document_.number_at(*spot, "innerConeAngle", 0), 0.0, outer));
  }

  GltfDocument& document_;
  GltfSearch search_;
  Motion part_;
  GltfAnimation animation_;
  std::uint64_t memory_bytes_;
  MeshWarnings& warnings_;
  GltfNodes found_;
  std::set<std::uint64_t> cameras_left_out_;  // indices in the file
  std::vector<bool> visited_;                 // by node
};

}  // namespace

GltfNodes walk_gltf_nodes(GltfDocument& document, GltfSearch search, std::optional<double> seconds,
                          Motion part, std::uint64_t memory_bytes, MeshWarnings& warnings) {
  return NodeWalk(document, search, seconds, part, memory_bytes, warnings).walk();
}

}  // namespace ptc
