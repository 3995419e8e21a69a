// Meshes, materials and cameras from glTF and GLB.
#include <cmath>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "engine/base/error.h"
#include "engine/io/mesh/gltf_document.h"
#include "engine/io/mesh/mesh.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::Contains;
using Json = nlohmann::json;

namespace {

// A triangle in the plane z = 0: 36 bytes of positions, 6 of indices, 24 of texture coordinates.
std::string buffer_bytes() {
  std::string bytes;
  for (const int p : {0, 0, 0, 1, 0, 0, 0, 1, 0}) bytes += raw(static_cast<float>(p));
  for (const int i : {0, 1, 2}) bytes += raw(static_cast<std::uint16_t>(i));
  bytes += std::string(2, '\0');
  for (const float t : {0.0F, 0.25F, 1.0F, 0.0F, 0.0F, 1.0F}) bytes += raw(t);
  return bytes;
}

Json document() {
  return Json::parse(R"({
    "asset": {"version": "2.0"}, "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "accessors": [
      {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
      {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
      {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2"}],
    "bufferViews": [
      {"buffer": 0, "byteLength": 36},
      {"buffer": 0, "byteOffset": 36, "byteLength": 6},
      {"buffer": 0, "byteOffset": 44, "byteLength": 24}],
    "buffers": [{"uri": "a%20b.bin", "byteLength": 68}]})");
}

std::string glb(const Json& json, const std::string& binary) {
  std::string text = json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const auto u32 = [](std::size_t value) { return raw(static_cast<std::uint32_t>(value)); };
  return "glTF" + u32(2) + u32(12 + 8 + text.size() + 8 + binary.size()) + u32(text.size()) +
         "JSON" + text + u32(binary.size()) + std::string("BIN\0", 4) + binary;
}

std::string base64(const std::string& bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      text += i + k > bytes.size() ? '=' : kDigits[bits >> (18 - 6 * k) & 63];
    }
  }
  return text;
}

struct Files {
  test::TemporaryDirectory scratch;
  Files() { scratch.file("a b.bin", buffer_bytes()); }

  MeshFile read(const Json& json) const { return read_mesh(scratch.file("a.gltf", json.dump())); }
  std::string fault(const Json& json) const {
    return refusal([&] { static_cast<void>(read(json)); });
  }
};

glm::dvec3 corner(const Mesh& mesh, std::size_t triangle, std::size_t k) {
  return mesh.origin + glm::dvec3(mesh.positions[mesh.triangles[triangle][k]]);
}

}  // namespace

TEST_CASE("gltf: buffers next to the file, in it and in a GLB give the same triangle",
          "[io][gltf]") {
  const Files files;
  Json inside = document();
  inside["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64(buffer_bytes());
  Json chunk = document();
  chunk["buffers"][0].erase("uri");
  const auto packed = files.scratch.file("a.glb", glb(chunk, buffer_bytes()));
  for (const MeshFile& file : {files.read(document()), files.read(inside), read_mesh(packed)}) {
    CHECK(file.mesh.triangles.size() == 1);
    CHECK(corner(file.mesh, 0, 1) == glm::dvec3(1, 0, 0));
    CHECK(corner(file.mesh, 0, 2) == glm::dvec3(0, 1, 0));
    CHECK(file.mesh.normals.empty());
    CHECK(file.mesh.uvs.empty());
    REQUIRE(file.mesh.materials.size() == 1);
    CHECK(file.mesh.materials[0].albedo == glm::vec3(1));
    CHECK(file.warnings.empty());
  }
}

TEST_CASE("gltf: transforms of nested nodes are applied in double", "[io][gltf]") {
  const Files files;
  Json json = document();
  const double half = std::sqrt(0.5);
  json["nodes"] =
      Json::array({{{"children", {1}}, {"translation", {10000000.001, 0, 0}}},
                   {{"children", {2}},
                    {"rotation", {0, 0, half, half}},  // a quarter turn about z
                    {"scale", {2, 3, 1}}},
                   {{"mesh", 0}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.5, 0, 7, 1}}}});
  const Mesh mesh = files.read(json).mesh;
  const auto near = [](const glm::dvec3& a, const glm::dvec3& b) {
    return glm::length(a - b) < 1e-6;
  };
  CHECK(near(corner(mesh, 0, 0), {10000000.001, 1, 7}));
  CHECK(near(corner(mesh, 0, 1), {10000000.001, 3, 7}));
  CHECK(near(corner(mesh, 0, 2), {9999997.001, 1, 7}));
}

TEST_CASE("gltf: a mirroring node keeps the front in front", "[io][gltf]") {
  const Files files;
  Json json = document();
  json["nodes"][0]["scale"] = {-1, 1, 1};
  const Mesh mesh = files.read(json).mesh;
  const glm::dvec3 normal =
      glm::cross(corner(mesh, 0, 1) - corner(mesh, 0, 0), corner(mesh, 0, 2) - corner(mesh, 0, 0));
  CHECK(normal.z > 0);
}

TEST_CASE("gltf: only the nodes of the scene are read, and each of them once", "[io][gltf]") {
  const Files files;
  Json json = document();
  json["nodes"].push_back({{"mesh", 0}});
  CHECK(files.read(json).mesh.triangles.size() == 1);
  json.erase("scenes");
  json.erase("scene");
  CHECK(files.read(json).mesh.triangles.size() == 2);
  json["nodes"][0]["children"] = {1};
  CHECK(files.read(json).mesh.triangles.size() == 2);
  json["nodes"][1]["children"] = {0};  // a cycle: no node is a root
  CHECK_THAT(files.fault(json), Contains("no triangle"));
  json["scenes"] = Json::array({{{"nodes", {0}}}});
  CHECK_THAT(files.fault(json), Contains("node 0 has two parents or contains itself"));
  json["scenes"] = Json::array({{{"nodes", {0, 0}}}});
  json["nodes"] = Json::array({{{"mesh", 0}}});
  CHECK_THAT(files.fault(json), Contains("node 0 has two parents"));
}

TEST_CASE("gltf: objects are the nodes that show a mesh", "[io][gltf]") {
  const Files files;
  Json json = document();
  json["meshes"].push_back(json["meshes"][0]);
  json["meshes"][1]["name"] = "leaf";
  json["meshes"][1]["primitives"].push_back(json["meshes"][0]["primitives"][0]);
  json["scenes"][0]["nodes"] = Json::parse("[0, 1, 2, 4]");
  json["nodes"] = Json::parse(R"([{"mesh": 1, "name": "tree"}, {"mesh": 1}, {"children": [3]},
                                  {"mesh": 0, "name": 5}, {"mesh": 0, "name": "tree"}])");
  const Mesh mesh = files.read(json).mesh;
  CHECK(mesh.objects == std::vector<std::string>{"tree", "leaf", "node 3", "tree"});
  CHECK(mesh.object_runs == std::vector<ObjectRun>{{0, 0}, {2, 1}, {4, 2}, {5, 3}});
}

TEST_CASE("gltf: strips and fans become triangles that face one side, points and lines nothing",
          "[io][gltf]") {
  const Files files;
  Json json = document();
  std::string bytes;
  for (const int p : {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, -1, 1, 0})
    bytes += raw(static_cast<float>(p));
  json["buffers"][0] = {{"uri", "data:;base64," + base64(bytes)}, {"byteLength", 60}};
  json["bufferViews"][0]["byteLength"] = 60;
  json["accessors"][0]["count"] = 5;
  Json& primitive = json["meshes"][0]["primitives"][0];
  primitive.erase("indices");
  primitive["mode"] = 6;
  const Mesh fan = files.read(json).mesh;
  REQUIRE(fan.triangles.size() == 3);
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(corner(fan, i, 0) == glm::dvec3(0));
    CHECK(glm::cross(corner(fan, i, 1), corner(fan, i, 2)).z > 0);
  }
  primitive["mode"] = 5;
  CHECK(files.read(json).mesh.triangles.size() == 2);  // the last three are on a line
  primitive["mode"] = 4;
  CHECK(files.read(json).mesh.triangles.size() == 1);
  for (const int mode : {0, 1, 2, 3}) {
    primitive["mode"] = mode;
    CHECK_THAT(files.fault(json), Contains("no triangle"));
  }
  primitive["mode"] = 7;
  CHECK_THAT(files.fault(json), Contains("the mode of a primitive is unknown"));
}

TEST_CASE("gltf: materials have factor, texture, emission and sides", "[io][gltf]") {
  const Files files;
  write_png(files.scratch.path() / "t.png", {2, 1, {glm::vec3(1, 0, 0), glm::vec3(0, 0, 0)}});
  Json json = document();
  json["materials"] = Json::parse(R"([
    {"name": "wall", "doubleSided": true, "emissiveFactor": [1, 0.5, 0],
     "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 2, 1],
                              "baseColorTexture": {"index": 0}},
     "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 20}}}])");
  json["textures"] = Json::parse(R"([{"source": 0}])");
  json["images"] = Json::parse(R"([{"uri": "t.png"}])");
  Json& primitive = json["meshes"][0]["primitives"][0];
  primitive["material"] = 0;
  primitive["attributes"]["TEXCOORD_0"] = 2;
  const MeshFile file = files.read(json);
  REQUIRE(file.mesh.materials.size() == 1);
  const Material& material = file.mesh.materials[0];
  CHECK(material.name == "wall");
  CHECK(material.albedo == glm::vec3(0.5F, 0.25F, 1));
  CHECK(material.emission == glm::vec3(20, 10, 0));
  CHECK(material.double_sided);
  REQUIRE(material.texture);
  CHECK(material.texture->at(0, 0) == glm::vec3(1, 0, 0));
  // v grows downwards in the file and upwards in the mesh.
  CHECK(file.mesh.uvs[file.mesh.triangles[0][0]] == glm::vec2(0, 0.75F));
  CHECK(file.mesh.uvs[file.mesh.triangles[0][1]] == glm::vec2(1, 1));
  CHECK(file.warnings.empty());

  // An emission texture lies where the base colour does, or is replaced by its mean, in a
  // bufferView and in a data URI alike.
  const std::string png = slurp(files.scratch.path() / "t.png");
  json["images"] = Json::array({{{"uri", "data:image/png;base64," + base64(png)}}});
  json["materials"][0]["emissiveTexture"] = {{"index", 0}};
  const MeshFile textured = files.read(json);
  CHECK(textured.mesh.materials[0].emission == glm::vec3(20, 10, 0));
  REQUIRE(textured.mesh.materials[0].emission_texture);
  CHECK(textured.mesh.materials[0].emission_texture->width() == 2);
  CHECK(textured.warnings.empty());
  json["materials"][0]["emissiveTexture"]["texCoord"] = 1;
  const MeshFile lit = files.read(json);
  CHECK_FALSE(lit.mesh.materials[0].emission_texture);
  CHECK(lit.mesh.materials[0].emission == glm::vec3(10, 0, 0));
  CHECK(lit.mesh.materials[0].texture->width() == 2);
  CHECK(lit.warnings.size() == 1);

  // A missing texture is a warning.
  json["images"] = Json::parse(R"([{"uri": "none.png"}])");
  const MeshFile plain = files.read(json);
  CHECK_FALSE(plain.mesh.materials[0].texture);
  REQUIRE(plain.warnings.size() == 1);
  CHECK_THAT(plain.warnings[0], Contains("none.png"));
}

TEST_CASE("gltf: images that share a file or a bufferView are one picture", "[io][gltf]") {
  const Files files;
  write_png(files.scratch.path() / "t.png", {1, 1, {glm::vec3(1, 0, 0)}});
  const std::string png = slurp(files.scratch.path() / "t.png");
  files.scratch.file("t.bin", png);
  Json json = document();
  json["buffers"].push_back({{"uri", "t.bin"}, {"byteLength", png.size()}});
  json["bufferViews"].push_back({{"buffer", 1}, {"byteLength", png.size()}});
  json["images"] = Json::parse(
      R"([{"bufferView": 3}, {"bufferView": 3}, {"uri": "t.png"}, {"uri": "./t.png"}])");
  json["materials"] = Json::array();
  const Json triangle = json["meshes"][0]["primitives"][0];
  json["meshes"][0]["primitives"] = Json::array();
  for (int i = 0; i < 4; ++i) {
    json["textures"].push_back({{"source", i}});
    json["materials"].push_back({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", i}}}}}});
    json["meshes"][0]["primitives"].push_back(triangle);
    json["meshes"][0]["primitives"][static_cast<std::size_t>(i)]["material"] = i;
  }
  const std::vector<Material> materials = files.read(json).mesh.materials;
  REQUIRE(materials.size() == 4);
  for (const Material& material : materials) REQUIRE(material.texture);
  CHECK(materials[0].texture == materials[1].texture);
  CHECK(materials[2].texture == materials[3].texture);
}

TEST_CASE("gltf: a file that has the name of a picture inside is another picture", "[io][gltf]") {
  const Files files;
  write_png(files.scratch.path() / "red.png", {1, 1, {glm::vec3(1, 0, 0)}});
  write_png(files.scratch.path() / "green.png", {1, 1, {glm::vec3(0, 1, 0)}});
  std::filesystem::rename(files.scratch.path() / "red.png", files.scratch.path() / "image 0");
  const std::string green = slurp(files.scratch.path() / "green.png");
  Json json = document();
  json["images"] = {{{"uri", "data:image/png;base64," + base64(green)}}, {{"uri", "image%200"}}};
  const Json triangle = json["meshes"][0]["primitives"][0];
  json["meshes"][0]["primitives"] = {triangle, triangle};
  for (std::size_t i = 0; i < 2; ++i) {
    json["textures"].push_back({{"source", i}});
    json["materials"].push_back({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", i}}}}}});
    json["meshes"][0]["primitives"][i]["material"] = i;
  }
  files.scratch.file("a.gltf", json.dump());
  // Read it by a name without a directory.
  const std::filesystem::path here = std::filesystem::current_path();
  std::filesystem::current_path(files.scratch.path());
  const std::vector<Material> materials = read_mesh("a.gltf").mesh.materials;
  std::filesystem::current_path(here);
  REQUIRE(materials.size() == 2);
  REQUIRE(materials[0].texture);
  REQUIRE(materials[1].texture);
  CHECK(materials[0].texture->at(0, 0) == glm::vec3(0, 1, 0));
  CHECK(materials[1].texture->at(0, 0) == glm::vec3(1, 0, 0));
}

TEST_CASE("gltf: each texture and camera that is left out is counted once", "[io][gltf]") {
  const Files files;
  Json json = document();
  const Json triangle = json["meshes"][0]["primitives"][0];
  json["meshes"][0]["primitives"] = Json::array();
  json["nodes"][0]["children"] = Json::array();
  for (std::size_t i = 0; i < 12; ++i) {  // two uses of six textures and of six cameras
    const Json texture{{"index", i % 6}};
    json["materials"].push_back({{"pbrMetallicRoughness", {{"baseColorTexture", texture}}}});
    json["meshes"][0]["primitives"].push_back(triangle);
    json["meshes"][0]["primitives"][i]["material"] = i;
    json["nodes"].push_back({{"camera", i % 6}});
    json["nodes"][0]["children"].push_back(i + 1);
    if (i % 2 == 0) continue;
    json["textures"].push_back(Json::object());
    json["cameras"].push_back({{"perspective", {{"yfov", 0}}}});
  }
  const std::vector<std::string> warnings = files.read(json).warnings;
  REQUIRE(warnings.size() == 2);
  CHECK_THAT(warnings[0], Catch::StartsWith("6 cameras") && Catch::EndsWith("and 2 more"));
  CHECK_THAT(warnings[1], Catch::StartsWith("6 textures") && Catch::EndsWith("and 2 more"));
}

// This would take five minutes if the mean were computed for each material.
TEST_CASE("gltf: 30,000 materials that emit by one texture compute its mean once", "[io][gltf]") {
  const Files files;
  constexpr unsigned kSide = 2048;
  write_png(files.scratch.path() / "t.png",
            {kSide, kSide, std::vector<glm::vec3>(kSide * kSide, glm::vec3(1, 0, 0))});
  Json json = document();
  json["images"] = Json::parse(R"([{"uri": "t.png"}])");
  json["textures"] = Json::parse(R"([{"source": 0}])");
  Json primitive = json["meshes"][0]["primitives"][0];
  json["meshes"][0]["primitives"] = Json::array();
  for (int i = 0; i < 30'000; ++i) {
    json["materials"].push_back({{"emissiveFactor", {1, 1, 1}},
                                 {"emissiveTexture", {{"index", 0}, {"texCoord", 1}}},
                                 {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
    primitive["material"] = i;
    json["meshes"][0]["primitives"].push_back(primitive);
  }
  const MeshFile file = files.read(json);
  REQUIRE(file.mesh.materials.size() == 30'000);
  CHECK(file.mesh.materials[29'999].emission == glm::vec3(1, 0, 0));
  CHECK(file.warnings.size() == 1);
}

TEST_CASE("gltf: a file that several buffers name is read once", "[io][gltf]") {
  const Files files;
  Json json = document();
  for (const char* name : {"./a%20b.bin", "x/../a%20b.bin"}) {
    json["buffers"].push_back({{"uri", name}, {"byteLength", 68}});
  }
  json["bufferViews"][1]["buffer"] = 1;
  json["bufferViews"][2]["buffer"] = 2;
  const std::string text = json.dump();
  GltfDocument document(files.scratch.file("a.gltf", text), text.size() << 10);
  for (std::uint64_t view = 0; view < 3; ++view) static_cast<void>(document.view(view));
  CHECK(document.bytes_read() == text.size() + 68);
  CHECK(files.read(json).mesh.triangles.size() == 1);
}

TEST_CASE("gltf: a texture transform moves the coordinates", "[io][gltf]") {
  const Files files;
  Json json = document();
  json["materials"] = Json::parse(R"([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0,
    "extensions": {"KHR_texture_transform":
      {"offset": [0.5, 0.25], "scale": [2, 4], "rotation": 1.5707963267948966}}}}}])");
  json["textures"] = Json::parse(R"([{}])");
  Json& primitive = json["meshes"][0]["primitives"][0];
  primitive["material"] = 0;
  primitive["attributes"]["TEXCOORD_0"] = 2;
  const MeshFile file = files.read(json);
  // (0, 0.25) becomes (0, 1) when scaled, (1, 0) when turned, (1.5, 0.25) when moved; v upwards is
  // 0.75.
  const glm::vec2 uv = file.mesh.uvs[file.mesh.triangles[0][0]];
  CHECK(uv.x == Approx(1.5F));
  CHECK(uv.y == Approx(0.75F));
  CHECK_THAT(file.warnings.at(0), Contains("it has no supported source"));
}

TEST_CASE("gltf: integers are scaled when they are marked as normalized", "[io][gltf]") {
  const Files files;
  Json json = document();
  const std::string bytes = std::string("\0\0\0\xff\0\0\0\xff\0", 9);
  json["buffers"][0] = {{"uri", "data:;base64," + base64(bytes)}, {"byteLength", 9}};
  json["bufferViews"][0]["byteLength"] = 9;
  json["accessors"][0]["componentType"] = 5121;
  json["meshes"][0]["primitives"][0].erase("indices");
  CHECK(corner(files.read(json).mesh, 0, 1) == glm::dvec3(255, 0, 0));
  json["accessors"][0]["normalized"] = true;
  CHECK(corner(files.read(json).mesh, 0, 1) == glm::dvec3(1, 0, 0));
}

TEST_CASE("gltf: COLOR_0 colours the vertices of its primitive, others stay white", "[io][gltf]") {
  const Files files;
  const std::string colours = std::string("\xff\0\x80\x11\0\xff\0\x11\0\0\0\x11", 12);
  Json json = document();
  json["buffers"].push_back({{"uri", "data:;base64," + base64(colours)}, {"byteLength", 12}});
  json["bufferViews"].push_back({{"buffer", 1}, {"byteLength", 12}});
  json["accessors"].push_back({{"bufferView", 3},
                               {"componentType", 5121},
                               {"normalized", true},
                               {"count", 3},
                               {"type", "VEC4"}});
  Json& primitives = json["meshes"][0]["primitives"];
  primitives.push_back(primitives[0]);
  primitives[1]["attributes"]["COLOR_0"] = 3;
  primitives.push_back(primitives[0]);
  const Mesh mesh = files.read(json).mesh;
  REQUIRE(mesh.triangles.size() == 3);
  REQUIRE(mesh.colours.size() == mesh.positions.size());
  for (std::size_t k = 0; k < 3; ++k) {
    CHECK(mesh.colours[mesh.triangles[0][k]] == glm::vec3(1));
    CHECK(mesh.colours[mesh.triangles[2][k]] == glm::vec3(1));
  }
  CHECK(mesh.colours[mesh.triangles[1][0]].x == 1);
  CHECK(static_cast<double>(mesh.colours[mesh.triangles[1][0]].z) == Approx(128 / 255.0));
  CHECK(mesh.colours[mesh.triangles[1][1]] == glm::vec3(0, 1, 0));
}

TEST_CASE("gltf: elements of a sparse accessor take the place of others", "[io][gltf]") {
  const Files files;
  // The second position, and the second colour of others that are black
  std::string bytes = buffer_bytes();
  const std::size_t at = bytes.size();
  bytes += raw(std::uint16_t{1}) + std::string(2, '\0') + raw(5.0F) + raw(1.0F) + raw(0.5F);
  files.scratch.file("a b.bin", bytes);
  Json json = document();
  json["buffers"][0]["byteLength"] = bytes.size();
  json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", at}, {"byteLength", 2}});
  json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", at + 4}, {"byteLength", 12}});
  const Json sparse{{"count", 1},
                    {"indices", {{"bufferView", 3}, {"componentType", 5123}}},
                    {"values", {{"bufferView", 4}}}};
  json["accessors"][0]["sparse"] = sparse;
  json["accessors"].push_back(
      {{"componentType", 5126}, {"count", 3}, {"type", "VEC3"}, {"sparse", sparse}});
  json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = 3;
  const MeshFile file = files.read(json);
  CHECK(file.warnings.empty());
  REQUIRE(file.mesh.triangles.size() == 1);
  CHECK(corner(file.mesh, 0, 0) == glm::dvec3(0));
  CHECK(corner(file.mesh, 0, 1) == glm::dvec3(5, 1, 0.5));
  CHECK(corner(file.mesh, 0, 2) == glm::dvec3(0, 1, 0));
  for (std::size_t k = 0; k < 3; ++k) {
    const glm::vec3 colour = k == 1 ? glm::vec3(1, 1, 0.5F) : glm::vec3(0);
    CHECK(file.mesh.colours[file.mesh.triangles[0][k]] == colour);
  }

  // What breaks a rule is refused
  const auto said = [&](const char* pointer, const Json& value) {
    Json broken = json;
    broken[Json::json_pointer(std::string("/accessors/0/sparse") + pointer)] = value;
    return files.fault(broken);
  };
  CHECK_THAT(said("/count", 0), Contains("accessor 0 is sparse without a count"));
  CHECK_THAT(said("/count", 4), Contains("accessor 0 is sparse without a count"));
  CHECK_THAT(said("/count", 2), Contains("reach past their bufferView"));
  CHECK_THAT(said("/indices/componentType", 5126), Contains("are of no unsigned type"));
  CHECK_THAT(said("/indices/byteOffset", UINT64_MAX), Contains("reach past their bufferView"));
  CHECK_THAT(said("/values/bufferView", 99), Contains("bufferViews has no entry 99"));
  CHECK_THAT(said("/indices", {{"bufferView", 4}, {"byteOffset", 2}, {"componentType", 5123}}),
             Contains("do not ascend or lie behind"));
  json["accessors"][0].erase("bufferView");
  CHECK_THAT(files.fault(json), Contains("accessor 0 has no bufferView"));
}

TEST_CASE("gltf: what is not read is told", "[io][gltf]") {
  const Files files;
  Json json = document();
  json["meshes"][0]["weights"] = {0, 0.5};
  Json points = json["meshes"][0]["primitives"][0];
  points["mode"] = 0;
  json["meshes"][0]["primitives"].push_back(points);
  json["cameras"] = {{{"type", "orthographic"}, {"orthographic", {{"xmag", 1}}}}};
  json["nodes"][0]["camera"] = 0;
  json["nodes"][0]["weights"] = {1};
  const MeshFile file = files.read(json);
  CHECK(file.mesh.triangles.size() == files.read(document()).mesh.triangles.size());
  REQUIRE(file.warnings.size() == 3);
  CHECK_THAT(file.warnings[0], Contains("camera 0, not a perspective one"));
  CHECK_THAT(file.warnings[1], Contains("weights of morph targets are left out") &&
                                   Contains("node 0") && Contains("mesh 0"));
  CHECK_THAT(file.warnings[2], Contains("a primitive of points or lines is left out"));
}

TEST_CASE("gltf: colours that are not in the file are left out and told", "[io][gltf]") {
  const Files files;
  Json json = document();
  json["accessors"].push_back({{"componentType", 5126}, {"count", 3}, {"type", "VEC3"}});
  json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = 3;
  const MeshFile file = files.read(json);
  CHECK(file.mesh.colours.empty());
  REQUIRE(file.warnings.size() == 1);
  CHECK_THAT(file.warnings[0], Contains("not in the file: accessor 3"));
}

TEST_CASE("gltf: samplers say how textures go on, and what is not understood is told",
          "[io][gltf]") {
  const Files files;
  write_png(files.scratch.path() / "t.png", {1, 1, {glm::vec3(1)}});
  Json json = document();
  json["materials"] = Json::parse(R"([{"name": "leaf", "alphaMode": "MASK",
    "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 1},
    "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}])");
  json["textures"] = Json::parse(R"([{"source": 0, "sampler": 0}, {"source": 0, "sampler": 1}])");
  json["samplers"] = Json::parse(R"([{"wrapS": 33071, "wrapT": 33648}, {"wrapT": 10497}])");
  json["images"] = Json::parse(R"([{"uri": "t.png"}])");
  json["extensionsUsed"] = {"KHR_texture_transform", "KHR_materials_volume", "EXT_new"};
  Json& primitive = json["meshes"][0]["primitives"][0];
  primitive["material"] = 0;
  primitive["attributes"]["TEXCOORD_0"] = 2;
  const MeshFile file = files.read(json);
  CHECK(file.mesh.materials[0].wrap == TextureWrap{Wrap::clamp, Wrap::mirror});
  CHECK(file.mesh.materials[0].emission_wrap == TextureWrap{});
  CHECK(file.mesh.materials[0].emission_texture);
  REQUIRE(file.warnings.size() == 1);
  CHECK(file.warnings[0] == "2 extensions of glTF are left out: KHR_materials_volume; EXT_new");
  json["textures"][0]["sampler"] = 2;
  CHECK_FALSE(files.fault(json).empty());
}

TEST_CASE("gltf: alpha counts where a material masks or blends", "[io][gltf]") {
  const Files files;
  files.scratch.file("a.tga", tga_with_alpha({0, 51}));
  Json json = document();
  json["textures"] = Json::parse(R"([{"source": 0}])");
  json["images"] = Json::parse(R"([{"uri": "a.tga"}])");
  json["meshes"][0]["primitives"][0]["material"] = 0;
  json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 2;
  const auto read = [&](const char* material) {
    json["materials"] = {Json::parse(material)};
    const MeshFile file = files.read(json);
    CHECK(file.warnings.empty());
    return file.mesh.materials[0];
  };
  const Material opaque = read(R"({"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.25],
      "baseColorTexture": {"index": 0}}})");
  CHECK(opaque.is_opaque());
  const Material mask = read(R"({"alphaMode": "MASK", "pbrMetallicRoughness": {
      "baseColorFactor": [1, 1, 1, 0.25], "baseColorTexture": {"index": 0}}})");
  CHECK(mask.opacity == 0.25F);
  CHECK(mask.opacity_cutoff == 0.5F);
  REQUIRE(mask.opacity_texture);
  CHECK(mask.opacity_texture->at(0, 0) == glm::vec3(0));
  CHECK(mask.opacity_texture->at(1, 0).x == Approx(0.2));
  const Material blend = read(R"({"alphaMode": "BLEND", "alphaCutoff": 0.75, "extensions": {
      "KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [1, 1, 1, 0.5]}}})");
  CHECK(blend.opacity == 0.5F);
  CHECK(blend.opacity_cutoff == 0);
  CHECK_FALSE(blend.opacity_texture);
  CHECK(read(R"({"alphaMode": "MASK", "alphaCutoff": 0.75})").opacity_cutoff == 0.75F);
  CHECK(read(R"({"alphaMode": "MASK", "alphaCutoff": 0, "pbrMetallicRoughness": {
      "baseColorFactor": [1, 1, 1, 0]}})")
            .is_opaque());
  CHECK(read(R"({"alphaMode": "MASK", "alphaCutoff": 1.5})").opacity == 0);
  // A picture that cannot be had is told once
  json["images"] = Json::parse(R"([{"uri": "none.png"}])");
  json["materials"] = Json::parse(R"([{"alphaMode": "MASK", "pbrMetallicRoughness": {
      "baseColorTexture": {"index": 0}}}])");
  const MeshFile missing = files.read(json);
  REQUIRE(missing.warnings.size() == 1);
  CHECK_THAT(missing.warnings[0], Contains("a texture is left out"));
  json["images"][0] = {{"uri", "data:image/png;base64,AAAA"}};
  CHECK(files.read(json).warnings.size() == 1);
}

TEST_CASE("gltf: lights stand and shine as their nodes do", "[io][gltf]") {
  const Files files;
  Json json = document();
  json["extensions"]["KHR_lights_punctual"]["lights"] = Json::parse(R"([
    {"type": "directional", "intensity": 1000, "color": [1, 0.5, 0]},
    {"type": "point", "intensity": 20, "range": 5},
    {"type": "spot", "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}},
    {"type": "spot", "spot": {"innerConeAngle": 3, "outerConeAngle": 2}}])");
  const auto node = [](int light) {
    return Json{{"translation", {1, 2, 3}},
                {"scale", {2, 2, 2}},
                {"rotation", {-0.70710678118654752, 0, 0, 0.70710678118654752}},  // -z goes to -y
                {"extensions", {{"KHR_lights_punctual", {{"light", light}}}}}};
  };
  for (int i = 0; i < 4; ++i) json["nodes"].push_back(node(i));
  json["scenes"][0]["nodes"] = {0, 1, 2, 3, 4};
  const MeshFile file = files.read(json);
  REQUIRE(file.lights.size() == 4);
  CHECK(file.warnings.empty());
  CHECK(file.lights[0].kind == MeshLight::Kind::sun);
  CHECK(file.lights[0].intensity == glm::vec3(1000, 500, 0));
  CHECK(glm::distance(file.lights[0].direction, glm::vec3(0, -1, 0)) < 1e-6F);
  CHECK(file.lights[1].kind == MeshLight::Kind::point);
  CHECK(file.lights[1].position == glm::dvec3(1, 2, 3));
  CHECK(file.lights[1].intensity == glm::vec3(20));
  CHECK(file.lights[2].kind == MeshLight::Kind::spot);
  CHECK(file.lights[2].inner_angle == 0.2F);
  CHECK(file.lights[2].outer_angle == 0.5F);
  CHECK(file.lights[3].outer_angle < 1.5708F);
  CHECK(file.lights[3].inner_angle <= file.lights[3].outer_angle);

  json["nodes"][1] = node(4);
  CHECK_THAT(files.fault(json), Contains("a node shows a light that does not exist"));
  json["nodes"][1] = node(1);
  json["extensions"]["KHR_lights_punctual"]["lights"][1]["type"] = "area";
  CHECK_THAT(files.fault(json), Contains("neither directional, point nor spot"));
  json.erase("extensions");
  CHECK_THAT(files.fault(json), Contains("a node shows a light that does not exist"));
}

TEST_CASE("gltf: cameras look along -z of their node", "[io][gltf]") {
  const Files files;
  Json json = document();
  json["cameras"] = Json::parse(
      R"([{"type": "perspective", "perspective": {"yfov": 0.8, "aspectRatio": 2}},
          {"type": "orthographic"}])");
  json["nodes"][0]["children"] = {1, 2};
  json["nodes"][0]["translation"] = {0, 0, 5};
  json["nodes"].push_back({{"camera", 0}, {"rotation", {0, std::sqrt(0.5), 0, std::sqrt(0.5)}}});
  json["nodes"].push_back({{"camera", 1}});
  const MeshFile file = files.read(json);
  REQUIRE(file.cameras.size() == 1);
  const MeshCamera& camera = file.cameras[0];
  CHECK(camera.position == glm::dvec3(0, 0, 5));
  CHECK(glm::length(camera.forward - glm::vec3(-1, 0, 0)) < 1e-6F);
  CHECK(glm::length(camera.up - glm::vec3(0, 1, 0)) < 1e-6F);
  CHECK(static_cast<double>(camera.horizontal_fov) == Approx(2 * std::atan(2 * std::tan(0.4))));
}

TEST_CASE("gltf: ranges that reach past their buffer are refused", "[io][gltf]") {
  const Files files;
  const auto with = [&](const char* pointer, const Json& value) {
    Json json = document();
    json[Json::json_pointer(pointer)] = value;
    return files.fault(json);
  };
  CHECK_THAT(with("/buffers/0/byteLength", 69),
             Contains("buffer 0 has only 68 bytes of the declared 69"));
  CHECK_THAT(with("/bufferViews/0/byteOffset", 33),
             Contains("bufferView 0 reaches past its buffer"));
  CHECK_THAT(with("/bufferViews/0/byteOffset", UINT64_MAX), Contains("bufferView 0 reaches past"));
  CHECK_THAT(with("/accessors/0/count", 4), Contains("accessor 0 reaches past its bufferView"));
  CHECK_THAT(with("/accessors/0/count", UINT64_MAX), Contains("accessor 0 reaches past"));
  CHECK_THAT(with("/accessors/0/byteOffset", 1), Contains("accessor 0 reaches past"));
  CHECK_THAT(with("/accessors/0/byteOffset", UINT64_MAX), Contains("accessor 0 reaches past"));
  CHECK_THAT(with("/bufferViews/0/byteStride", 13), Contains("accessor 0 reaches past"));
  CHECK_THAT(with("/bufferViews/0/byteStride", 11),
             Contains("accessor 0 has elements that overlap"));
  CHECK_THAT(with("/bufferViews/0/byteStride", 0),
             Contains("accessor 0 has elements that overlap"));
  CHECK_THAT(with("/accessors/0/type", "VEC2"), Contains("accessor 0 is of the wrong type"));
  CHECK_THAT(with("/accessors/0/componentType", 5124), Contains("unknown componentType"));
  CHECK_THAT(with("/accessors/0/sparse", Json::object()), Contains("is sparse without a count"));
  CHECK_THAT(with("/accessors/1/componentType", 5121), Contains("no triangle"));
  CHECK_THAT(with("/nodes/0/mesh", 1), Contains("meshes has no entry 1"));
  CHECK_THAT(with("/nodes/0/mesh", -1), Contains("mesh is not an unsigned integer"));
  CHECK_THAT(with("/nodes/0/scale", {1, 1}), Contains("scale does not have 3 numbers"));
  CHECK_THAT(with("/nodes/0/scale", {1e300, 1, 1}), Contains("2e18 apart"));
  CHECK_THAT(with("/scenes/0/nodes/0", 7), Contains("nodes has no entry 7"));
  CHECK_THAT(with("/scene", 1), Contains("scenes has no entry 1"));
  CHECK_THAT(with("/scene", "0"), Contains("scene is not an unsigned integer"));
  CHECK_THAT(with("/extensionsRequired", {"EXT_new"}),
             Contains("the extension 'EXT_new' is not supported"));
  CHECK_THAT(with("/buffers/0/uri", "none.bin"), Contains("none.bin"));
  CHECK_THAT(with("/buffers/0/uri", "data:;base64,!"), Contains("base64"));
  CHECK_THAT(with("/buffers/0/uri", "data:,x"), Contains("not base64"));
}

TEST_CASE("gltf: an index past the vertices is refused", "[io][gltf]") {
  const Files files;
  std::string bytes = buffer_bytes();
  bytes.replace(36, 2, raw(std::uint16_t{3}));
  files.scratch.file("a b.bin", bytes);
  CHECK_THAT(files.fault(document()), Contains("an index refers to no vertex"));
}

TEST_CASE("gltf: a small file cannot make many vertices by repeating a mesh", "[io][gltf]") {
  const Files files;
  Json json = document();
  std::string bytes(12 * 20000, '\0');
  json["buffers"][0] = {{"uri", "data:;base64," + base64(bytes)}, {"byteLength", bytes.size()}};
  json["bufferViews"][0]["byteLength"] = bytes.size();
  json["accessors"][0]["count"] = 20000;
  Json& primitive = json["meshes"][0]["primitives"][0];
  primitive.erase("indices");
  Json& primitives = json["meshes"][0]["primitives"];
  for (int i = 1; i < 4000; ++i) primitives.push_back(primitives[0]);
  CHECK_THAT(files.fault(json), Contains("repeat vertices to more"));
}

TEST_CASE("gltf: a mesh in many places is copied where memory allows, else it keeps its places",
          "[io][gltf]") {
  const Files files;
  Json json = document();
  // A node that is moved and turned by its parent, and one that shows three instances
  json["extensionsUsed"] = json["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  json["nodes"] = Json::parse(R"([
    {"mesh": 0, "children": [1, 2]},
    {"mesh": 0, "translation": [5, 0, 0], "scale": [2, 1, -1]},
    {"mesh": 0, "translation": [0, 7, 0], "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {
      "TRANSLATION": 3, "ROTATION": 4, "SCALE": 5}}}}])");
  std::string bytes = buffer_bytes();
  for (const float t : {1.0F, 0.0F, 0.0F, 2.0F, 0.0F, 0.0F, 3.0F, 0.0F, 0.0F}) bytes += raw(t);
  for (int i = 0; i < 3; ++i) {  // no turn, and two of 90 degrees about z as normalised shorts
    for (const int q : {0, 0, i == 0 ? 0 : 23170, i == 0 ? 32767 : 23170})
      bytes += raw(static_cast<std::int16_t>(q));
  }
  for (const float s : {1.0F, 1.0F, 1.0F, 1.0F, 1.0F, 1.0F, 4.0F, 4.0F, 4.0F}) bytes += raw(s);
  files.scratch.file("a b.bin", bytes);
  json["buffers"][0]["byteLength"] = bytes.size();
  json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 68}, {"byteLength", 36}});
  json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 104}, {"byteLength", 24}});
  json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 128}, {"byteLength", 36}});
  json["accessors"].push_back(
      {{"bufferView", 3}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}});
  json["accessors"].push_back({{"bufferView", 4},
                               {"componentType", 5122},
                               {"normalized", true},
                               {"count", 3},
                               {"type", "VEC4"}});
  json["accessors"].push_back(
      {{"bufferView", 5}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}});

  const std::filesystem::path path = files.scratch.file("a.gltf", json.dump());
  const Mesh copies = read_mesh(path).mesh;
  REQUIRE(copies.triangles.size() == 5);
  CHECK(glm::distance(corner(copies, 3, 1), glm::dvec3(2, 8, 0)) < 1e-4);   // turned
  CHECK(glm::distance(corner(copies, 4, 1), glm::dvec3(3, 11, 0)) < 1e-3);  // and enlarged
  MeshRoom little;
  little.memory_bytes = GltfDocument(path, 8 << 20).json_bytes() + 2800;
  little.temp_directory = files.scratch.path();
  const MeshFile file = read_mesh(path, little);
  CHECK(file.mesh.triangles.empty());
  REQUIRE(file.placed.size() == 1);
  REQUIRE(file.placed[0].mesh);
  REQUIRE(file.placed[0].places.size() == 5);
  for (std::size_t i = 0; i < 5; ++i) {
    Mesh one = *file.placed[0].mesh;
    place_mesh(one, file.placed[0].places[i]);
    for (std::size_t k = 0; k < 3; ++k)
      CHECK(glm::distance(corner(one, 0, k), corner(copies, i, k)) < 1e-5);
  }

  // Lists of different lengths, and more instances than memory holds
  Json bad = json;
  bad["accessors"][3]["count"] = 2;
  CHECK_THAT(files.fault(bad), Contains("another number of elements"));
  bytes += std::string(12 * 9999, '\0');
  files.scratch.file("a b.bin", bytes);
  bad["buffers"][0]["byteLength"] = bytes.size();
  bad["bufferViews"][3] = {{"buffer", 0}, {"byteOffset", 164}, {"byteLength", 12 * 9999}};
  bad["accessors"][3]["count"] = 9999;
  const std::filesystem::path many = files.scratch.file("many.gltf", bad.dump());
  CHECK_THROWS_WITH(read_mesh(many, little), Contains("instances take more memory"));

  // A place that flattens the mesh is a copy, and a mesh without a triangle is left out
  bad = json;
  bad["nodes"][1]["scale"] = {2, 2, 0};
  bad["meshes"].push_back(bad["meshes"][0]);
  bad["meshes"][1]["primitives"][0]["attributes"]["POSITION"] = 5;  // three equal points
  for (unsigned i = 3; i < 6; ++i) {
    bad["nodes"].push_back({{"mesh", 1}});
    bad["nodes"][0]["children"].push_back(i);
  }
  const std::filesystem::path some = files.scratch.file("flat.gltf", bad.dump());
  little.memory_bytes = GltfDocument(some, 8 << 20).json_bytes() + 2800;
  const MeshFile flat = read_mesh(some, little);
  CHECK(flat.mesh.triangles.size() == 1);
  REQUIRE(flat.placed.size() == 1);
  CHECK(flat.placed[0].places.size() == 4);
}

TEST_CASE("glb: every truncation and every flipped byte is read or refused", "[io][gltf]") {
  const Files files;
  Json json = document();
  json["buffers"][0].erase("uri");
  const std::string whole = glb(json, buffer_bytes());
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto cut = files.scratch.file("cut.glb", whole.substr(0, size));
    CHECK_THROWS_AS(static_cast<void>(read_mesh(cut)), DataError);
  }
  for (std::size_t i = 0; i < whole.size(); ++i) {
    for (const int flip : {1, 2, 0x10, 0x80}) {
      std::string damaged = whole;
      damaged[i] = static_cast<char>(damaged[i] ^ flip);
      const auto at = files.scratch.file("bad.glb", damaged);
      static_cast<void>(refusal([&] { static_cast<void>(read_mesh(at)); }));
    }
  }
}
