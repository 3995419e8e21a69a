// Until the exposure is known, the light of the vertices waits in temporary files.
//
// Source: Turk, "The PLY Polygon File Format", 1994; Khronos, "glTF 2.0 Specification", sections
// 3.7.2 (meshes), 3.9 (materials) and 4 (GLB); Khronos, KHR_materials_emissive_strength.
#include "engine/pipeline/render/vertex_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <nlohmann/json.hpp>

#include "engine/base/error.h"
#include "engine/io/file/buffered_output.h"
#include "engine/io/image/srgb.h"
#include "engine/io/mesh/gltf_numbers.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kVertices = 34962, kIndices = 34963;  // targets of buffer views

bool is_ply(const PictureTarget& target) {
  return lower_extension(target.path) == ".ply";
}

/// Returns the layer that a target shows.
std::string layer_of(const PictureTarget& target) {
  return !is_ply(target) && target.layer == "beauty" ? "irradiance" : target.layer;
}

/// Returns the names of a layer's components, as those of shaded points are named.
std::vector<std::string> component_names(const ExrLayerType& layer) {
  const std::string name = layer.name.empty() ? "radiance" : layer.name;
  if (layer.components() == 1) return {name};
  const bool is_vector = layer.kind == ExrLayerType::Kind::vector;
  std::vector<std::string> names;
  for (const char* const end :
       is_vector ? std::array{"_x", "_y", "_z"} : std::array{"_r", "_g", "_b"})
    names.push_back(name + end);
  return names;
}

template <typename T>
void put(BufferedOutput& out, const T& value) {
  out.put(&value, sizeof(value));
}

/// Writes a mesh as PLY.
/// @param shown   of each vertex, to be seen on a screen
/// @param names   of the values of a vertex
/// @param values  of all vertices
void write_ply(BufferedOutput& out, const Mesh& mesh, Spool<glm::vec3>& shown,
               const Display& display, const std::vector<std::string>& names,
               Spool<float>& values) {
  // What floats hold exactly is written as float
  const bool wide = mesh.origin != glm::dvec3(0);
  std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment light by PTCX, W/m^2/sr and W/m^2\nelement "
      "vertex {}\n",
      mesh.positions.size());
  const auto declare = [&](const char* type, const std::string& name) {
    header += fmt::format("property {} {}\n", type, name);
  };
  for (const char* const name : {"x", "y", "z"}) declare(wide ? "double" : "float", name);
  if (!mesh.normals.empty()) {
    for (const char* const name : {"nx", "ny", "nz"}) declare("float", name);
  }
  if (!mesh.uvs.empty()) {
    for (const char* const name : {"s", "t"}) declare("float", name);
  }
  for (const char* const name : {"red", "green", "blue"}) declare("uchar", name);
  for (const std::string& name : names) declare("float", name);
  header += fmt::format("element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
                        mesh.triangles.size());
  out.put(header.data(), header.size());
  SpoolReader<glm::vec3> light(shown, 0);
  SpoolReader<float> value(values, 0);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    if (wide) {
      put(out, mesh.origin + glm::dvec3(mesh.positions[i]));
    } else {
      put(out, mesh.positions[i]);
    }
    if (!mesh.normals.empty()) put(out, mesh.normals[i]);
    if (!mesh.uvs.empty()) put(out, mesh.uvs[i]);
    std::array colour{light[i]};
    display.show(colour);
    for (int c = 0; c < 3; ++c) {
      const double linear = std::clamp<double>(colour[0][c], 0, 1);
      put(out, static_cast<std::uint8_t>(std::lround(255 * linear_to_srgb(linear))));
    }
    for (std::size_t k = 0; k < names.size(); ++k) put(out, value[i * names.size() + k]);
  }
  for (const auto& triangle : mesh.triangles) {
    put(out, std::uint8_t{3});
    put(out, triangle);
  }
}

/// Writes a mesh as GLB, whose parts are put together in the order of its binary chunk.
class GlbMesh {
 public:
  explicit GlbMesh(const Mesh& mesh) : mesh_(mesh), first_(mesh.materials.size() + 1) {
    // Find where the triangles of each material begin in their order
    for (const std::uint16_t material : mesh.material_of) ++first_[material + 1U];
    for (std::size_t m = 1; m < first_.size(); ++m) first_[m] += first_[m - 1];
    const std::uint64_t vertices = mesh.positions.size();
    Json attributes;
    attributes["POSITION"] = add(vertices, 3, kGltfFloat, "VEC3", kVertices);
    set_bounds();
    if (!mesh.normals.empty())
      attributes["NORMAL"] = add(vertices, 3, kGltfFloat, "VEC3", kVertices);
    if (!mesh.uvs.empty())
      attributes["TEXCOORD_0"] = add(vertices, 2, kGltfFloat, "VEC2", kVertices);
    attributes["COLOR_0"] = add(vertices, 3, kGltfFloat, "VEC3", kVertices);
    Json primitives = Json::array();
    for (std::size_t m = 0; m < mesh.materials.size(); ++m) {
      const std::uint64_t triangles = first_[m + 1] - first_[m];
      if (triangles == 0) continue;
      primitives.push_back({{"attributes", attributes},
                            {"indices", add(3 * triangles, 1, kGltfUint32, "SCALAR", kIndices)},
                            {"material", materials_.size()}});
      add_material(mesh.materials[m]);
    }
    const glm::dvec3& o = mesh.origin;
    Json node{{"mesh", 0}};
    if (o != glm::dvec3(0)) node["translation"] = {o.x, o.y, o.z};
    Json root{{"asset", {{"version", "2.0"}, {"generator", "PTCX"}}},
              {"scene", 0},
              {"scenes", {{{"nodes", {0}}}}},
              {"nodes", {node}},
              {"meshes", {{{"primitives", primitives}}}},
              {"materials", materials_},
              {"accessors", accessors_},
              {"bufferViews", views_},
              {"buffers", {{{"byteLength", bytes_}}}}};
    if (has_strength_) root["extensionsUsed"] = {"KHR_materials_emissive_strength"};
    json_ = root.dump(-1, ' ', false, Json::error_handler_t::replace);
    json_.resize((json_.size() + 3) / 4 * 4, ' ');
  }

  /// Returns the bytes of the file.
  [[nodiscard]] std::uint64_t file_bytes() const noexcept {
    return 12 + 8 + json_.size() + 8 + bytes_;
  }

  /// @param gain      by which the light is multiplied
  /// @param coloured  whether it is multiplied by the colours of the vertices, too
  void write(BufferedOutput& out, Spool<glm::vec3>& shown, float gain, bool coloured) const {
    const auto put32 = [&](std::uint64_t value) { put(out, static_cast<std::uint32_t>(value)); };
    put32(kGlbMagic);
    put32(2);
    put32(file_bytes());
    put32(json_.size());
    put32(kGlbJson);
    out.put(json_.data(), json_.size());
    put32(bytes_);
    put32(kGlbBinary);
    for (const glm::vec3& position : mesh_.positions) put(out, position);
    for (const glm::vec3& normal : mesh_.normals) put(out, normal);
    for (const glm::vec2& uv : mesh_.uvs) put(out, glm::vec2(uv.x, 1 - uv.y));
    SpoolReader<glm::vec3> light(shown, 0);
    for (std::size_t i = 0; i < mesh_.positions.size(); ++i) {
      const glm::vec3 colour = coloured && !mesh_.colours.empty() ? mesh_.colours[i] : glm::vec3(1);
      put(out, glm::clamp(gain * colour * light[i], 0.0F, 1.0F));
    }
    // Put the triangles in the order of their materials
    std::vector<std::uint32_t> order(mesh_.triangles.size()), next = first_;
    for (std::uint32_t i = 0; i < order.size(); ++i) order[next[mesh_.material_of[i]]++] = i;
    for (const std::uint32_t triangle : order) put(out, mesh_.triangles[triangle]);
  }

 private:
  /// Adds an accessor of elements that follow those before it.
  std::size_t add(std::uint64_t count, std::uint64_t components, std::uint64_t type,
                  const char* shape, int target) {
    const std::uint64_t bytes = 4 * count * components;
    views_.push_back(
        {{"buffer", 0}, {"byteOffset", bytes_}, {"byteLength", bytes}, {"target", target}});
    accessors_.push_back({{"bufferView", views_.size() - 1},
                          {"componentType", type},
                          {"count", count},
                          {"type", shape}});
    bytes_ += bytes;
    return accessors_.size() - 1;
  }

  /// Gives the accessor of positions its bounds, which the format asks for.
  void set_bounds() {
    glm::vec3 low = mesh_.positions.front(), high = low;
    for (const glm::vec3& p : mesh_.positions) {
      low = glm::min(low, p);
      high = glm::max(high, p);
    }
    accessors_[0]["min"] = {low.x, low.y, low.z};
    accessors_[0]["max"] = {high.x, high.y, high.z};
  }

  void add_material(const Material& material) {
    const glm::vec3& a = material.albedo;
    Json json{{"pbrMetallicRoughness",
               {{"baseColorFactor", {a.x, a.y, a.z, material.opacity}},
                {"metallicFactor", 0},
                {"roughnessFactor", 1}}}};
    if (!material.name.empty()) json["name"] = material.name;
    if (material.double_sided) json["doubleSided"] = true;
    if (material.opacity < 1) json["alphaMode"] = "BLEND";
    const glm::vec3& e = material.emission;
    const float strength = std::max({1.0F, e.x, e.y, e.z});
    if (e != glm::vec3(0))
      json["emissiveFactor"] = {e.x / strength, e.y / strength, e.z / strength};
    if (strength > 1) {
      json["extensions"] = {{"KHR_materials_emissive_strength", {{"emissiveStrength", strength}}}};
      has_strength_ = true;
    }
    materials_.push_back(std::move(json));
  }

  const Mesh& mesh_;
  std::vector<std::uint32_t> first_;  ///< triangle of each material, and the end
  Json accessors_ = Json::array(), views_ = Json::array(), materials_ = Json::array();
  bool has_strength_ = false;
  std::uint64_t bytes_ = 0;  ///< of the binary chunk
  std::string json_;
};

}  // namespace

VertexFiles::VertexFiles(std::span<const PictureTarget> targets, const Mesh& mesh,
                         std::optional<float> exposure, const std::filesystem::path& directory)
    : targets_(targets), mesh_(mesh), exposure_(exposure) {
  has_ply_ = std::ranges::any_of(targets, is_ply);
  const auto glb = std::ranges::find_if_not(targets, is_ply);
  if (glb != targets.end() && GlbMesh(mesh).file_bytes() > UINT32_MAX) {
    throw RequestError("targets", glb->path.string() +
                                      " would take 4 GiB or more, which a .glb cannot: choose a "
                                      ".ply");
  }
  for (std::size_t i = 0; i < targets.size(); ++i) {
    shown_.push_back(std::make_unique<Spool<glm::vec3>>());
    shown_.back()->spill(directory);
  }
  if (has_ply_) values_.spill(directory);
}

void VertexFiles::write(const Film& film) {
  const std::uint64_t left = mesh_.positions.size() - vertices_;
  const std::size_t count =
      std::min<std::uint64_t>(left, std::uint64_t{film.width()} * film.height());
  const auto shown = [&](const std::string& layer) {
    std::vector<glm::vec3> light = film.shown(layer, 0, film.height());
    light.resize(count);
    return light;
  };
  for (std::size_t i = 0; i < targets_.size(); ++i) shown_[i]->append(shown(layer_of(targets_[i])));
  meter_.add(shown("irradiance"));
  vertices_ += count;
  if (!has_ply_) return;
  layers_.clear();
  std::vector<Film::Layer> layers = film.layers();
  std::erase_if(layers, [](const Film::Layer& layer) { return layer.type.name == "A"; });
  for (const Film::Layer& layer : layers) layers_.push_back(layer.type);
  for (std::size_t i = 0; i < count; ++i) {
    for (const Film::Layer& layer : layers) {
      const std::size_t each = layer.type.components();
      values_.append(layer.values.subspan(i * each, each));
    }
  }
}

std::optional<float> VertexFiles::publish() {
  std::optional<float> chosen;
  std::vector<std::string> names;
  for (const ExrLayerType& layer : layers_) {
    const std::vector<std::string> more = component_names(layer);
    names.insert(names.end(), more.begin(), more.end());
  }
  values_.end();
  if (vertices_ != mesh_.positions.size())
    throw std::logic_error("a baked mesh lacks the light of some vertices");
  Display usual = exposure_ ? Display::at_exposure(*exposure_) : meter_.display();
  usual = {.gain = usual.gain / usual.white};  // without a curve, what is bright must stay below 1
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    shown_[i]->end();
    BufferedOutput out(targets_[i].path);
    const std::string layer = layer_of(targets_[i]);
    const Display display = is_light(layer) ? usual : Display{};
    if (is_ply(targets_[i])) {
      write_ply(out, mesh_, *shown_[i], display, names, values_);
    } else {
      GlbMesh(mesh_).write(out, *shown_[i], display.gain, layer == "irradiance");
    }
    if (is_light(layer) && !exposure_) chosen = std::log2(display.gain);
    out.publish();
  }
  return chosen;
}

std::uint64_t VertexFiles::bytes(std::span<const PictureTarget> targets,
                                 const Mesh& mesh) noexcept {
  constexpr std::uint64_t kSpoolBytes = 1 << 19, kOutputBytes = 1 << 20, kMaterialBytes = 8 << 10;
  return kOutputBytes + (targets.size() + 1) * kSpoolBytes +
         kMaterialBytes * mesh.materials.size() + sizeof(std::uint32_t) * mesh.triangles.size();
}

}  // namespace ptc
