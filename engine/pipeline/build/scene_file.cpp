// Reads scene files. Where a member is wrong the error names it: "town.scene.json: objects[2]:
// placements[7]: scale must lie in ...".
#include "engine/pipeline/build/scene_file.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/file/text_file.h"
#include "engine/io/text/text.h"
#include "engine/pipeline/build/scene_places.h"
#include "engine/scene/camera.h"
#include "engine/scene/json_fields.h"

namespace ptc {
namespace {

constexpr std::uint64_t kMaxBytes = std::uint64_t{16} << 20;  // long lists of places have own files
constexpr std::uint64_t kJsonBytes = 25;  // memory of JSON for each byte of text
constexpr double kMax = std::numeric_limits<float>::max();

/// Reads one scene file.
class SceneFileReader {
 public:
  /// @param places  whether files of places are read
  SceneFileReader(const std::filesystem::path& path, TextureStore* textures, bool places,
                  std::uint64_t memory_bytes, const std::optional<Moment>& moment,
                  SceneObjects& scene)
      : path_(path),
        textures_(textures),
        reads_places_(places),
        memory_bytes_(memory_bytes),
        moment_(moment),
        scene_(scene) {}

  void read() {
    const InputFile file(path_);
    if (file.size() > kMaxBytes)
      throw DataError(path_.string() +
                      ": a scene file has 16 MiB at most: long lists of places "
                      "may stand in files of their own");
    if (file.size() * kJsonBytes > memory_bytes_)
      throw LimitError(fmt::format("{}: its JSON may take {} MiB of memory, more than there is",
                                   path_.string(), (file.size() * kJsonBytes >> 20) + 1));
    const Json json = parse_json(read_text(file), path_.string());
    JsonFields fields(json, path_.string());
    unsigned version = 0;
    fields.read("ptcx_scene", version, {1, 1});
    if (version != 1) fields.fail("\"ptcx_scene\": 1 is missing, which makes it a scene file");
    read_materials(fields);
    if (const Json* const lights = fields.find("lights")) read_lights(*lights);
    read_cameras(fields);
    for_each(fields, "objects",
             [&](const Json& object, const std::string& where) { read_object(object, where); });
    fields.finish();
  }

 private:
  /// Calls read(element, name for messages) for each element of an array.
  template <typename Read>
  void for_each(JsonFields& fields, const char* name, const Read& read) const {
    const Json* const list = fields.find(name);
    if (list == nullptr) return;
    if (!list->is_array()) fields.fail(std::string(name) + " must be an array");
    for (std::size_t i = 0; i < list->size(); ++i)
      read((*list)[i], fmt::format("{}: {}[{}]", path_.string(), name, i));
  }

  /// Returns the path of a file that the scene file names.
  /// @throws DataError when there is no such file
  [[nodiscard]] std::filesystem::path resolved(const std::string& name, const JsonFields& fields) {
    const std::filesystem::path path = path_.parent_path() / name;
    std::error_code absent;
    if (!std::filesystem::exists(path, absent)) fields.fail("there is no file " + path.string());
    return scene_.named.emplace_back(path);
  }

  /// Calls a function whose errors do not know the file.
  template <typename Function>
  auto within(const Function& function) const {
    try {
      return function();
    } catch (const DataError& error) {
      throw DataError(path_.string() + ": " + error.what());
    }
  }

  void read_materials(JsonFields& fields) {
    const Json* const materials = fields.find("materials");
    if (materials == nullptr) return;
    if (!materials->is_object()) fields.fail("materials must be an object");
    for (const auto& [name, json] : materials->items()) {
      JsonFields of(json, path_.string() + ": materials: " + name);
      Material material{.name = name};
      of.read("albedo", material.albedo, {0, 1});
      of.read("emission", material.emission, {0, kMax});
      std::string texture, emission_texture;
      of.read("albedo_texture", texture);
      of.read("emission_texture", emission_texture);
      of.finish();
      if (!texture.empty()) {
        if (json.find("albedo") == json.end()) material.albedo = glm::vec3(1);
        material.texture = load(texture, of);
      }
      if (!emission_texture.empty()) {
        if (json.find("emission") == json.end()) material.emission = glm::vec3(1);
        material.emission_texture = load(emission_texture, of);
      }
      materials_.emplace(name, std::move(material));
    }
  }

  [[nodiscard]] std::shared_ptr<const Texture> load(const std::string& name,
                                                    const JsonFields& fields) {
    const std::filesystem::path path = resolved(name, fields);
    return textures_ == nullptr ? nullptr : std::make_shared<const Texture>(textures_->read(path));
  }

  void read_lights(const Json& json) {
    if (scene_.lights) return;
    LightRig rig = within([&] { return light_rig_from_json(json.dump()); });
    if (!rig.sky.map_path.empty()) {
      const JsonFields fields(json, path_.string() + ": lights: sky");
      rig.sky.map_path =
          std::filesystem::absolute(resolved(rig.sky.map_path, fields)).lexically_normal();
    }
    scene_.lights = std::move(rig);
  }

  /// Reads the camera without a name, and then those that have one.
  void read_cameras(JsonFields& fields) {
    if (const Json* const camera = fields.find("camera")) read_camera(*camera, "", "camera");
    const Json* const named = fields.find("cameras");
    if (named == nullptr) return;
    if (!named->is_object()) fields.fail("cameras must be an object");
    for (const auto& [name, json] : named->items()) {
      if (name.empty()) fields.fail("a name of cameras is empty");
      read_camera(json, name, "cameras: " + name);
    }
  }

  /// Reads a camera. Each of its keys has the members of the camera, and those that it gives in
  /// place of them.
  void read_camera(const Json& json, const std::string& name, const std::string& where) {
    const std::string place = path_.string() + ": " + where;
    if (!json.is_object()) throw DataError(place + " must be an object");
    const auto parsed = [](const Json& members, const std::string& of) {
      try {
        return camera_from_json(members.dump());
      } catch (const DataError& error) {
        throw DataError(of + ": " + error.what());
      }
    };
    SceneCamera camera{.name = name};
    Json members = json;
    members.erase("keys");
    const Camera fixed = parsed(members, place);
    const auto keys = json.find("keys");
    if (keys == json.end()) {
      camera.keys.emplace_back(1, fixed);
    } else if (!keys->is_array() || keys->empty()) {
      throw DataError(place + ": keys must be an array that is not empty");
    } else {
      for (std::size_t i = 0; i < keys->size(); ++i) {
        const std::string key_place = fmt::format("{}: keys[{}]", place, i);
        Json key = (*keys)[i];
        JsonFields of(key, key_place);
        const double at = read_frame(
            of, camera.keys.empty() ? std::nullopt : std::optional(camera.keys.back().first));
        key.erase("frame");
        for (const char* const size : {"width", "height"}) {
          if (key.contains(size)) throw DataError(key_place + ": the size of a camera stays");
        }
        Json merged = members;
        merged.update(key);
        camera.keys.emplace_back(at, parsed(merged, key_place));
      }
    }
    scene_.cameras.push_back(std::move(camera));
  }

  void read_object(const Json& json, const std::string& where) {
    JsonFields fields(json, where);
    SceneObject object;
    std::string file, material;
    fields.read("file", file);
    if (file.empty()) fields.fail("file is missing");
    object.file = resolved(file, fields);
    if (is_scene_file(object.file)) fields.fail("a scene file cannot hold another one");
    fields.read("material", material);
    if (!material.empty()) {
      const auto found = materials_.find(material);
      if (found == materials_.end()) fields.fail("there is no material \"" + material + "\"");
      object.material = found->second;
    }
    if (const Json* const sided = fields.find("one_sided")) {
      if (!sided->is_boolean()) fields.fail("one_sided must be true or false");
      object.one_sided = sided->get<bool>();
    }
    const Json* const placements = fields.find("placements");
    if (const Json* const keys = fields.find("keys")) {
      if (placements != nullptr) fields.fail("keys excludes placements");
      object.places.push_back(
          read_keys(fields, *keys, where, moment_ ? std::optional(moment_->frame) : std::nullopt));
      object.moves = keys->size() > 1;
      scene_.moves |= object.moves;
    } else if (placements == nullptr) {
      if (const auto place = read_place(fields)) object.places.push_back(*place);
    } else if (placements->is_string()) {
      const std::filesystem::path path = resolved(placements->get<std::string>(), fields);
      if (reads_places_) object.places = read_places(path, places_, memory_bytes_);
    } else if (!placements->is_array() || placements->empty()) {
      fields.fail("placements must be an array of places, or the name of a file");
    } else {
      check_places(places_ + placements->size(), memory_bytes_, where);
      object.places.reserve(placements->size());
      for (std::size_t i = 0; i < placements->size(); ++i) {
        JsonFields of((*placements)[i], fmt::format("{}: placements[{}]", where, i));
        object.places.push_back(read_place(of).value_or(Placement(1)));
        of.finish();
      }
    }
    fields.finish();
    check_places(places_ += object.places.size() + 1, memory_bytes_, where);
    add(std::move(object), material);
  }

  /// Adds an object, or its places to those of one that differs in nothing else, so that a file
  /// that many objects name is read once.
  void add(SceneObject object, const std::string& material) {
    const auto [at, is_new] = known_.try_emplace(
        std::tuple(object.file, material, object.one_sided, object.moves), scene_.objects.size());
    if (is_new) {
      scene_.objects.push_back(std::move(object));
      return;
    }
    std::vector<Placement>& places = scene_.objects[at->second].places;
    if (places.empty()) places.emplace_back(1);
    if (object.places.empty()) object.places.emplace_back(1);
    places.insert(places.end(), object.places.begin(), object.places.end());
  }

  const std::filesystem::path& path_;
  TextureStore* textures_;
  bool reads_places_;
  std::uint64_t memory_bytes_;
  const std::optional<Moment>& moment_;
  SceneObjects& scene_;
  std::uint64_t places_ = 0;  ///< of all objects so far
  std::map<std::string, Material> materials_;
  /// Index of an object by its file, the name of its material, and whether it is one-sided and
  /// moves.
  std::map<std::tuple<std::filesystem::path, std::string, bool, bool>, std::size_t> known_;
};

/// Implements read_scene_objects().
/// @param places  whether files of places are read
SceneObjects read_objects(const std::vector<std::filesystem::path>& files, TextureStore* textures,
                          bool places, std::uint64_t memory_bytes,
                          const std::optional<Moment>& moment = {}) {
  SceneObjects scene;
  for (const std::filesystem::path& file : files) {
    if (is_scene_file(file)) {
      SceneFileReader(file, textures, places, memory_bytes, moment, scene).read();
    } else {
      scene.objects.push_back({.file = file});
    }
  }
  return scene;
}

}  // namespace

bool is_scene_file(const std::filesystem::path& path) {
  return lower_extension(path) == ".json" && lower_extension(path.stem()) == ".scene";
}

SceneObjects read_scene_objects(const std::vector<std::filesystem::path>& files,
                                TextureStore* textures, std::uint64_t memory_bytes,
                                const std::optional<Moment>& moment) {
  return read_objects(files, textures, true, memory_bytes, moment);
}

std::vector<std::filesystem::path> object_files(const std::vector<std::filesystem::path>& files,
                                                std::uint64_t memory_bytes) {
  std::vector<std::filesystem::path> found;
  for (SceneObject& object : read_objects(files, nullptr, false, memory_bytes).objects)
    found.push_back(std::move(object.file));
  return found;
}

Camera SceneCamera::at(double frame) const {
  const auto after = std::ranges::upper_bound(keys, frame, {}, &std::pair<double, Camera>::first);
  if (after == keys.begin()) return keys.front().second;
  if (after == keys.end()) return keys.back().second;
  const auto& [from_frame, from] = *std::prev(after);
  const auto& [to_frame, to] = *after;
  const double share = (frame - from_frame) / (to_frame - from_frame);
  Camera camera = from;
  camera.position = glm::mix(from.position, to.position, share);
  camera.look_at = glm::mix(from.look_at, to.look_at, share);
  camera.up = glm::vec3(
      glm::mix(glm::normalize(glm::dvec3(from.up)), glm::normalize(glm::dvec3(to.up)), share));
  if (camera.up == glm::vec3(0)) camera.up = from.up;  // half way between opposite directions
  camera.vertical_fov =
      static_cast<float>(glm::mix(double{from.vertical_fov}, double{to.vertical_fov}, share));
  return camera;
}

MeshCamera mesh_camera(const std::string& name, const Camera& camera) {
  const CameraAxes axes = axes_of(camera);
  const double aspect = static_cast<double>(camera.width) / camera.height;
  return {.position = camera.position,
          .forward = glm::vec3(axes.forward),
          .up = glm::vec3(axes.up),
          .horizontal_fov = static_cast<float>(
              2 * std::atan(std::tan(0.5 * static_cast<double>(camera.vertical_fov)) * aspect)),
          .size = {camera.width, camera.height},
          .name = name};
}

LightRig placed_lights(LightRig rig, const Placement& place) {
  for (Sun& sun : rig.suns) sun.to_sun = turned(sun.to_sun, place);
  for (PointLight& lamp : rig.points) lamp.position = place * glm::dvec4(lamp.position, 1);
  for (SpotLight& lamp : rig.spots) {
    lamp.position = place * glm::dvec4(lamp.position, 1);
    lamp.direction = turned(lamp.direction, place);
  }
  rig.sky.up = turned(rig.sky.up, place);
  return rig;
}

}  // namespace ptc
