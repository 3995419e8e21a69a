#include "tools/bench/references/mitsuba.h"

#include <array>
#include <bit>
#include <cerrno>
#include <cstdint>
#include <fstream>
#include <initializer_list>
#include <system_error>
#include <vector>

#include <fmt/format.h>
#include <glm/trigonometric.hpp>

#include "engine/base/error.h"
#include "engine/io/image/image.h"

namespace ptc::bench {
namespace {

constexpr char kProgram[] = R"(import json, sys, time
import mitsuba as mi
scene, *pictures, reflections, paths, facts = sys.argv[1:]
mi.set_variant("scalar_rgb")
scene = mi.load_file(scene)
# A depth of 1 shows what emits; no path ends by chance
integrator = mi.load_dict({"type": "path", "max_depth": int(reflections) + 1, "rr_depth": 1000000})
begin = time.time()
for seed, picture in enumerate(pictures):
    image = mi.render(scene, integrator=integrator, seed=seed, spp=int(paths))
    mi.Bitmap(image).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False).write(picture)
with open(facts, "w") as file:
    json.dump({"seconds": time.time() - begin, "version": mi.__version__}, file)
)";

static_assert(std::endian::native == std::endian::little, "the PLY files are little-endian");

std::string numbers(const glm::dvec3& v) {
  return fmt::format("{}, {}, {}", v.x, v.y, v.z);
}

std::string rgb(const char* name, const glm::vec3& value) {
  return fmt::format("<rgb name=\"{}\" value=\"{}\"/>", name, numbers(glm::dvec3(value)));
}

template <class Value>
void put(std::string& bytes, Value value) {
  const auto raw = std::bit_cast<std::array<char, sizeof value>>(value);
  bytes.append(raw.data(), raw.size());
}

/// Returns the triangles of a material as a PLY file; three vertices for each triangle. Empty where
/// it has none.
std::string ply_of(const Mesh& mesh, std::uint16_t material) {
  std::string vertices, faces;
  std::uint32_t count = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.material_of[t] != material) continue;
    faces += '\3';
    for (const std::uint32_t corner : mesh.triangles[t]) {
      const glm::dvec3 place = mesh.origin + glm::dvec3(mesh.positions[corner]);
      for (int c = 0; c < 3; ++c) put(vertices, static_cast<float>(place[c]));
      if (!mesh.normals.empty()) {
        for (int c = 0; c < 3; ++c) put(vertices, mesh.normals[corner][c]);
      }
      if (!mesh.uvs.empty()) {
        put(vertices, mesh.uvs[corner].x);
        put(vertices, mesh.uvs[corner].y);
      }
      put(faces, count++);
    }
  }
  if (count == 0) return {};
  std::string head =
      fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", count);
  const auto add = [&](std::initializer_list<const char*> names) {
    for (const char* name : names) head += fmt::format("property float {}\n", name);
  };
  add({"x", "y", "z"});
  if (!mesh.normals.empty()) add({"nx", "ny", "nz"});
  if (!mesh.uvs.empty()) add({"u", "v"});
  head += fmt::format("element face {}\nproperty list uchar int vertex_indices\nend_header\n",
                      count / 3);
  return head + vertices + faces;
}

void write_file(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream out(path, std::ios::binary);
  out << bytes;
  out.close();
  if (!out) throw std::system_error(errno, std::generic_category(), "write " + path.string());
}

/// Writes a texture times the albedo, and returns the reflectance that names it.
std::string write_texture(const std::filesystem::path& path, const Material& material) {
  const Texture& texture = *material.texture;
  ExrLayer layer{{"", ExrLayerType::Kind::colour, true}, {}};
  texture.visit_rows([&](std::span<const glm::vec3> row) {
    for (const glm::vec3& pixel : row) {
      const glm::vec3 colour = pixel * material.albedo;
      layer.values.insert(layer.values.end(), {colour.r, colour.g, colour.b});
    }
  });
  write_exr(path, texture.width(), texture.height(), std::vector{layer});
  return fmt::format(
      "<texture type=\"bitmap\" name=\"reflectance\"><string name=\"filename\" value=\"{}\"/>"
      "<boolean name=\"raw\" value=\"true\"/></texture>",
      path.filename().string());
}

/// Refuses what a scene of Mitsuba is not given here.
void check(const Mesh& mesh, const LightRig& lights) {
  const auto refuse = [](bool has, const char* text) { require_request(!has, "scenes", text); };
  refuse(!lights.spots.empty(), "spot lights are not written for Mitsuba");
  refuse(lights.sky.map != nullptr, "a sky picture is not written for Mitsuba");
  refuse(!mesh.colours.empty(), "colours of vertices are not written for Mitsuba");
  for (const Material& material : mesh.materials) {
    refuse(!material.is_opaque(), "surfaces that let light through are not written for Mitsuba");
    refuse(material.emission_texture != nullptr, "textures that emit are not written for Mitsuba");
  }
}

std::string lights_of(const LightRig& lights) {
  std::string text;
  for (const Sun& sun : lights.suns) {
    text += fmt::format(
        "<emitter type=\"directional\"><vector name=\"direction\" value=\"{}\"/>{}</emitter>\n",
        numbers(-glm::dvec3(sun.to_sun)), rgb("irradiance", sun.irradiance));
  }
  for (const PointLight& point : lights.points) {
    text +=
        fmt::format("<emitter type=\"point\"><point name=\"position\" value=\"{}\"/>{}</emitter>\n",
                    numbers(point.position), rgb("intensity", point.intensity));
  }
  if (lights.sky.radiance != glm::vec3(0)) {
    text += fmt::format("<emitter type=\"constant\">{}</emitter>\n",
                        rgb("radiance", lights.sky.radiance));
  }
  return text;
}

std::string camera_of(const Camera& camera) {
  return fmt::format(
      "<sensor type=\"perspective\"><string name=\"fov_axis\" value=\"y\"/>"
      "<float name=\"fov\" value=\"{}\"/><float name=\"near_clip\" value=\"1e-3\"/>"
      "<transform name=\"to_world\"><lookat origin=\"{}\" target=\"{}\" up=\"{}\"/></transform>"
      "<film type=\"hdrfilm\"><integer name=\"width\" value=\"{}\"/>"
      "<integer name=\"height\" value=\"{}\"/><rfilter type=\"box\"/>"
      "<string name=\"pixel_format\" value=\"rgb\"/>"
      "<string name=\"component_format\" value=\"float32\"/></film>"
      "<sampler type=\"independent\"/></sensor>\n",
      glm::degrees(static_cast<double>(camera.vertical_fov)), numbers(camera.position),
      numbers(camera.look_at), numbers(glm::dvec3(camera.up)), camera.width, camera.height);
}

}  // namespace

void write_mitsuba_scene(const std::filesystem::path& directory, const Mesh& mesh,
                         const LightRig& lights, const Camera& camera) {
  check(mesh, lights);
  std::string text = "<scene version=\"3.0.0\">\n" + camera_of(camera) + lights_of(lights);
  for (std::size_t i = 0; i < mesh.materials.size(); ++i) {
    const Material& material = mesh.materials[i];
    const std::string triangles = ply_of(mesh, static_cast<std::uint16_t>(i));
    if (triangles.empty()) continue;
    const std::string name = std::to_string(i);
    write_file(directory / (name + ".ply"), triangles);
    std::string bsdf = "<bsdf type=\"diffuse\">" +
                       (material.texture ? write_texture(directory / (name + ".exr"), material)
                                         : rgb("reflectance", material.albedo)) +
                       "</bsdf>";
    if (material.double_sided) bsdf = "<bsdf type=\"twosided\">" + bsdf + "</bsdf>";
    text += fmt::format("<shape type=\"ply\"><string name=\"filename\" value=\"{}.ply\"/>{}", name,
                        bsdf);
    if (material.emission != glm::vec3(0)) {
      text += "<emitter type=\"area\">" + rgb("radiance", material.emission) + "</emitter>";
    }
    text += "</shape>\n";
  }
  write_file(directory / "scene.xml", text + "</scene>\n");
}

const std::string& mitsuba_program() {
  static const std::string program(kProgram);
  return program;
}

}  // namespace ptc::bench
