// glTF whose meshes are compressed by Draco: streams that Draco's own encoder writes.
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
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

constexpr std::uint32_t kWide = 7, kHigh = 5;
constexpr std::uint32_t kPoints = kWide * kHigh, kTriangles = 2 * (kWide - 1) * (kHigh - 1);

// What lies at a point of the sheet: all follows from its position.
glm::vec3 place_at(float x, float y) {
  return {x, y, 0.1F * x * y};
}
glm::vec3 normal_at(const glm::vec3& p) {
  return glm::normalize(glm::vec3(-0.1F * p.y, -0.1F * p.x, 1));
}
glm::vec2 uv_at(const glm::vec3& p) {
  return {p.x / kWide, p.y / kHigh};
}
glm::vec3 colour_at(const glm::vec3& p) {
  return {p.x * 40 / 255, p.y * 50 / 255, 1};
}

// A sheet of 7 x 5 points, as a stream and as the JSON of a glTF.
struct Sheet {
  std::unique_ptr<draco::Mesh> mesh = std::make_unique<draco::Mesh>();
  Json json = Json::parse(R"({
    "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
    "extensionsUsed": ["KHR_draco_mesh_compression"],
    "extensionsRequired": ["KHR_draco_mesh_compression"],
    "accessors": [{"componentType": 5125, "type": "SCALAR"}],
    "meshes": [{"primitives": [{"indices": 0, "attributes": {}, "extensions": {
      "KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}}}]}]})");

  Sheet() {
    mesh->set_num_points(kPoints);
    for (std::uint32_t y = 0; y + 1 < kHigh; ++y) {
      for (std::uint32_t x = 0; x + 1 < kWide; ++x) {
        const std::uint32_t at = y * kWide + x;
        add_triangle(at, at + 1, at + kWide);
        add_triangle(at + 1, at + kWide + 1, at + kWide);
      }
    }
    json["accessors"][0]["count"] = 3 * kTriangles;
  }

  void add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    draco::Mesh::Face face;
    face[0] = a;
    face[1] = b;
    face[2] = c;
    mesh->AddFace(face);
  }

  // Adds an attribute and its accessor.
  template <typename T>
  void add(const char* name, draco::GeometryAttribute::Type kind, draco::DataType type,
           unsigned component_type, std::size_t components, bool normalised,
           const std::function<std::array<double, 4>(const glm::vec3&)>& value) {
    draco::GeometryAttribute made;
    made.Init(kind, nullptr, static_cast<std::uint8_t>(components), type, normalised,
              static_cast<std::int64_t>(components * sizeof(T)), 0);
    const int id = mesh->AddAttribute(made, true, kPoints);
    for (std::uint32_t i = 0; i < kPoints; ++i) {
      const std::array<double, 4> numbers =
          value(place_at(static_cast<float>(i % kWide), static_cast<float>(i / kWide)));
      std::array<T, 4> stored{};
      for (std::size_t k = 0; k < 4; ++k) stored[k] = static_cast<T>(numbers[k]);
      mesh->attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), stored.data());
    }
    const std::uint32_t unique = 10 + 3 * static_cast<std::uint32_t>(id);
    mesh->attribute(id)->set_unique_id(unique);
    constexpr std::array kTypes{"", "SCALAR", "VEC2", "VEC3", "VEC4"};
    Json& primitive = json["meshes"][0]["primitives"][0];
    primitive["attributes"][name] = json["accessors"].size();
    stream()["attributes"][name] = unique;
    json["accessors"].push_back({{"componentType", component_type},
                                 {"count", kPoints},
                                 {"type", kTypes[components]},
                                 {"normalized", normalised}});
  }
  void add_positions() {
    add<float>("POSITION", draco::GeometryAttribute::POSITION, draco::DT_FLOAT32, 5126, 3, false,
               [](const glm::vec3& p) {
                 return std::array<double, 4>{p.x, p.y, p.z};
               });
  }
  void add_all() {
    add<float>("NORMAL", draco::GeometryAttribute::NORMAL, draco::DT_FLOAT32, 5126, 3, false,
               [](const glm::vec3& p) {
                 const glm::vec3 n = normal_at(p);
                 return std::array<double, 4>{n.x, n.y, n.z};
               });
    add_positions();
    add<float>("TEXCOORD_0", draco::GeometryAttribute::TEX_COORD, draco::DT_FLOAT32, 5126, 2, false,
               [](const glm::vec3& p) {
                 return std::array<double, 4>{uv_at(p).x, 1.0 - static_cast<double>(uv_at(p).y)};
               });
    add<std::uint8_t>("COLOR_0", draco::GeometryAttribute::COLOR, draco::DT_UINT8, 5121, 4, true,
                      [](const glm::vec3& p) {
                        const glm::vec3 c = colour_at(p) * 255.0F;
                        return std::array<double, 4>{std::round(c.x), std::round(c.y), c.z, 9};
                      });
  }
  Json& stream() {
    return json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"];
  }

  std::string encode(int method, int speed = 3) const {
    draco::Encoder encoder;
    encoder.SetEncodingMethod(method);
    encoder.SetSpeedOptions(speed, speed);
    for (const auto kind : {draco::GeometryAttribute::POSITION, draco::GeometryAttribute::NORMAL,
                            draco::GeometryAttribute::TEX_COORD})
      encoder.SetAttributeQuantization(kind, 14);
    draco::EncoderBuffer buffer;
    REQUIRE(encoder.EncodeMeshToBuffer(*mesh, &buffer).ok());
    return {buffer.data(), buffer.size()};
  }
};

struct Files {
  test::TemporaryDirectory scratch;

  std::filesystem::path write(Json json, const std::string& stream) const {
    json["buffers"] = {{{"uri", "a.bin"}, {"byteLength", stream.size()}}};
    json["bufferViews"] = {{{"buffer", 0}, {"byteLength", stream.size()}}};
    scratch.file("a.bin", stream);
    return scratch.file("a.gltf", json.dump());
  }
  MeshFile read(const Json& json, const std::string& stream) const {
    return read_mesh(write(json, stream));
  }
  std::string fault(const Json& json, const std::string& stream) const {
    return refusal([&] { static_cast<void>(read(json, stream)); });
  }
};

constexpr std::array kMethods{draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING};

double near(const glm::vec3& a, const glm::vec3& b) {
  return static_cast<double>(glm::distance(a, b));
}

}  // namespace

TEST_CASE("draco: streams of both methods give the mesh that was encoded", "[io][gltf][draco]") {
  const Files files;
  Sheet sheet;
  sheet.add_all();
  for (const int method : kMethods) {
    for (const int speed : {0, 3, 10}) {
      CAPTURE(method, speed);
      const MeshFile file = files.read(sheet.json, sheet.encode(method, speed));
      CHECK(file.warnings.empty());
      const Mesh& mesh = file.mesh;
      REQUIRE(mesh.triangles.size() == kTriangles);
      REQUIRE(mesh.positions.size() == kPoints);
      REQUIRE(mesh.normals.size() == kPoints);
      REQUIRE(mesh.uvs.size() == kPoints);
      REQUIRE(mesh.colours.size() == kPoints);
      for (std::size_t i = 0; i < kPoints; ++i) {
        const auto p = glm::vec3(mesh.origin + glm::dvec3(mesh.positions[i]));
        const glm::vec3 exact = place_at(std::round(p.x), std::round(p.y));
        CHECK(near(p, exact) < 1e-3);
        CHECK(near(mesh.normals[i], normal_at(exact)) < 1e-3);
        CHECK(glm::distance(mesh.uvs[i], uv_at(exact)) < 1e-3F);
        CHECK(near(mesh.colours[i], colour_at(exact)) < 0.004);
      }
      double area = 0;  // seen from the front
      for (const auto& t : mesh.triangles) {
        const glm::dvec3 a = mesh.positions[t[0]], b = mesh.positions[t[1]],
                         c = mesh.positions[t[2]];
        CHECK(glm::cross(b - a, c - a).z > 0);
        area += glm::cross(b - a, c - a).z / 2;
      }
      CHECK(area == Approx((kWide - 1) * (kHigh - 1)).epsilon(1e-3));
    }
  }
}

TEST_CASE("draco: integers are taken as the accessor says", "[io][gltf][draco]") {
  const Files files;
  for (const auto& [normalised, in_stream] :
       std::vector<std::array<bool, 2>>{{false, false}, {false, true}, {true, false}}) {
    Sheet sheet;
    sheet.add<std::int16_t>("POSITION", draco::GeometryAttribute::POSITION, draco::DT_INT16, 5122,
                            3, in_stream, [](const glm::vec3& p) {
                              return std::array<double, 4>{4000.0 * p.x, -2000.0 * p.y, -32768};
                            });
    sheet.json["accessors"][1]["normalized"] = normalised;
    const double unit = normalised ? 32767 : 1;
    for (const int method : kMethods) {
      const Bounds bounds = files.read(sheet.json, sheet.encode(method)).mesh.bounds();
      CHECK(bounds.low.x == Approx(0).margin(1e-6));
      CHECK(bounds.high.x == Approx(24000 / unit));
      CHECK(bounds.low.y == Approx(-8000 / unit));
      CHECK(bounds.low.z == Approx(normalised ? -1 : -32768));
    }
  }
}

TEST_CASE("draco: attributes that a stream lacks come from their accessors", "[io][gltf][draco]") {
  const Files files;
  Sheet sheet;
  sheet.add_positions();
  const std::string stream = sheet.encode(draco::MESH_SEQUENTIAL_ENCODING);
  std::string colours;
  for (std::uint32_t i = 0; i < kPoints; ++i) colours += raw(0.25F) + raw(0.5F) + raw(1.0F);
  Json json = sheet.json;
  json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json["accessors"].size();
  json["accessors"].push_back(
      {{"bufferView", 1}, {"componentType", 5126}, {"count", kPoints}, {"type", "VEC3"}});
  const std::filesystem::path path = files.write(json, stream + colours);
  json["buffers"] = {{{"uri", "a.bin"}, {"byteLength", stream.size() + colours.size()}}};
  json["bufferViews"] = {
      {{"buffer", 0}, {"byteLength", stream.size()}},
      {{"buffer", 0}, {"byteOffset", stream.size()}, {"byteLength", colours.size()}}};
  const Mesh mesh = read_mesh(files.scratch.file("a.gltf", json.dump())).mesh;
  REQUIRE(mesh.colours.size() == kPoints);
  for (const glm::vec3& colour : mesh.colours) CHECK(colour == glm::vec3(0.25F, 0.5F, 1));
}

TEST_CASE("draco: a stream that does not match its accessors is refused", "[io][gltf][draco]") {
  const Files files;
  for (const int method : kMethods) {
    Sheet sheet;
    sheet.add_all();
    const std::string stream = sheet.encode(method);
    const auto with = [&](const char* pointer, const Json& value) {
      Json json = sheet.json;
      Json::json_pointer at(pointer);
      if (value.is_null()) {
        json[at.parent_pointer()].erase(at.back());
      } else {
        json[at] = value;
      }
      return files.fault(json, stream);
    };
    const std::string primitive = "/meshes/0/primitives/0";
    const std::string extension = primitive + "/extensions/KHR_draco_mesh_compression";
    CHECK(with("/asset/version", "2.0").empty());
    for (const std::uint32_t triangles : {0U, 1U, kTriangles - 1, kTriangles + 1, 1U << 20}) {
      CHECK_THAT(with("/accessors/0/count", 3 * triangles),
                 Contains("a.gltf: bufferView 0: Draco: it has another number of triangles"));
    }
    CHECK_THAT(with("/accessors/0/count", std::uint64_t{3} << 60), Contains("repeat vertices"));
    CHECK_THAT(with("/accessors/0/count", 4), Contains("has a part of a triangle"));
    CHECK_THAT(with("/accessors/1/count", kPoints + 1), Contains("another number of elements"));
    Json json = sheet.json;
    for (std::size_t i = 1; i < 5; ++i) json["accessors"][i]["count"] = kPoints - 1;
    CHECK_THAT(files.fault(json, stream), Contains("Draco: it has another number of points"));
    for (std::size_t i = 1; i < 5; ++i) json["accessors"][i]["count"] = std::uint64_t{1} << 62;
    CHECK_THAT(files.fault(json, stream), Contains("repeat vertices to more"));
    CHECK_THAT(with("/accessors/1/type", "VEC2"), Contains("accessor 1 is of the wrong type"));
    CHECK_THAT(with("/accessors/4/type", "VEC3"),
               Contains("Draco: attribute 19 has other numbers than its accessor"));
    CHECK_THAT(with((extension + "/attributes/NORMAL").c_str(), 11),
               Contains("Draco: attribute 11 does not exist"));
    CHECK_THAT(with((extension + "/attributes/NORMAL").c_str(), -1),
               Contains("NORMAL is not an unsigned integer"));
    CHECK_THAT(with((extension + "/attributes").c_str(), Json::object()),
               Contains("accessor 2 has no bufferView"));
    CHECK_THAT(with((extension + "/attributes").c_str(), {}), Contains("names no attributes"));
    CHECK_THAT(with((extension + "/bufferView").c_str(), {}), Contains("has no bufferView"));
    CHECK_THAT(with((extension + "/bufferView").c_str(), 1),
               Contains("bufferViews has no entry 1"));
    CHECK_THAT(with((primitive + "/mode").c_str(), 5), Contains("no list of triangles"));
    CHECK_THAT(with((primitive + "/indices").c_str(), {}), Contains("has no indices"));

    // Two attributes that the primitive does not name pass, three do not
    const Json normal = json["accessors"][1];
    json = sheet.json;
    json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"] = {
        {"POSITION", 13}};
    json["meshes"][0]["primitives"][0]["attributes"] = {{"POSITION", 2}};
    CHECK_THAT(files.fault(json, stream), Contains("more attributes than its primitive"));
    json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"] = {
        {"POSITION", 13}, {"_ID", 10}};
    CHECK(files.fault(json, stream).empty());
  }
}

TEST_CASE("draco: counts of a stream are checked before memory is taken for them",
          "[io][gltf][draco]") {
  const Files files;
  Sheet sheet;
  sheet.add_all();
  const std::string stream = sheet.encode(draco::MESH_EDGEBREAKER_ENCODING);
  const auto with = [&](std::size_t at, int byte) {
    std::string changed = stream;
    changed[at] = static_cast<char>(byte);
    return files.fault(sheet.json, changed);
  };
  // The header: name, version, kind; behind it: kind of traversal, vertices, triangles, seams, ...
  for (const std::size_t at : {0U, 4U, 5U, 6U, 7U})
    CHECK_THAT(with(at, 1 - (stream[at] & 1)), Contains("it is not a mesh of Draco's bitstream"));
  CHECK_THAT(with(8, 0), Contains("Draco: "));
  REQUIRE(stream[12] == kPoints);
  REQUIRE(stream[13] == kTriangles);
  CHECK_THAT(with(13, 127), Contains("another number of triangles"));
  CHECK_THAT(with(14, 6), Contains("more attributes than its primitive"));
  CHECK_THAT(with(15, 127), Contains("its connectivity has more parts than triangles"));
  CHECK_THAT(with(16, 127), Contains("its connectivity has more parts than triangles"));
  for (const char* number : {"\x80\x80\x80\x80\x80\x01", "\xff\xff\xff\xff\x10"}) {
    CHECK_THAT(files.fault(sheet.json, stream.substr(0, 12) + number),
               Contains("does not fit in 32 bits"));
  }
  const std::string sequential = sheet.encode(draco::MESH_SEQUENTIAL_ENCODING);
  bool found = false;  // somewhere behind the corners is the number of decoders
  for (std::size_t at = 13; at < sequential.size(); ++at) {
    std::string changed = sequential;
    changed[at] = 100;
    found |= files.fault(sheet.json, changed).ends_with("it has more decoders than attributes");
  }
  CHECK(found);

  draco::GeometryAttribute wide;
  wide.Init(draco::GeometryAttribute::GENERIC, nullptr, 5, draco::DT_UINT8, false, 5, 0);
  sheet.mesh->AddAttribute(wide, true, kPoints);
  for (const int method : kMethods)
    CHECK_THAT(files.fault(sheet.json, sheet.encode(method)), Contains("has more than 4 numbers"));
}

TEST_CASE("draco: metadata of a stream is left out", "[io][gltf][draco]") {
  const Files files;
  Sheet sheet;
  sheet.add_all();
  const auto metadata = [] {
    auto made = std::make_unique<draco::AttributeMetadata>();
    made->AddEntryString("name", "value");
    auto inner = std::make_unique<draco::Metadata>();
    inner->AddEntryInt("depth", 2);
    inner->AddSubMetadata("empty", std::make_unique<draco::Metadata>());
    made->AddSubMetadata("inner", std::move(inner));
    made->AddSubMetadata("other", std::make_unique<draco::Metadata>());
    return made;
  };
  const std::string plain = sheet.encode(draco::MESH_EDGEBREAKER_ENCODING);
  sheet.mesh->AddMetadata(std::make_unique<draco::GeometryMetadata>(*metadata()));
  sheet.mesh->AddAttributeMetadata(0, metadata());
  sheet.mesh->AddAttributeMetadata(2, metadata());
  const std::string with = sheet.encode(draco::MESH_EDGEBREAKER_ENCODING);
  REQUIRE(with.size() > plain.size() + 100);
  const Mesh mesh = files.read(sheet.json, with).mesh;
  CHECK(mesh.triangles.size() == kTriangles);
  CHECK(mesh.positions == files.read(sheet.json, plain).mesh.positions);
  for (std::size_t size = 11; size < with.size() - plain.size() + 11; ++size)
    CHECK_THAT(files.fault(sheet.json, with.substr(0, size)), Contains("Draco: "));
}

TEST_CASE("draco: a mesh that is decoded in more memory than there is names the cap",
          "[io][gltf][draco]") {
  const Files files;
  Sheet sheet;
  sheet.add_all();
  const auto path = files.write(sheet.json, sheet.encode(draco::MESH_EDGEBREAKER_ENCODING));
  MeshRoom room;
  room.temp_directory = files.scratch.path();
  const std::uint64_t json_bytes = GltfDocument(path, 1 << 20).json_bytes();
  room.memory_bytes = json_bytes + 20'000 + std::filesystem::file_size(path);
  CHECK_THROWS_WITH(read_mesh(path, room),
                    Contains("a Draco-compressed mesh does not fit in `run.memory_bytes`"));
  room.memory_bytes = json_bytes + 60'000 + std::filesystem::file_size(path);
  CHECK_NOTHROW(read_mesh(path, room));

  // More than the file justifies is a fault of the file, whatever the cap
  for (std::size_t i = 1; i < 5; ++i) sheet.json["accessors"][i]["count"] = std::uint64_t{1} << 40;
  const auto many = files.write(sheet.json, sheet.encode(draco::MESH_EDGEBREAKER_ENCODING));
  room.memory_bytes = 1 << 30;
  CHECK_THROWS_WITH(read_mesh(many, room), Contains("repeat vertices to more"));
}

TEST_CASE("draco: every truncation and every flipped byte is read or refused",
          "[io][gltf][draco]") {
  const Files files;
  Sheet sheet;
  sheet.add_all();
  for (const int method : kMethods) {
    const std::string whole = sheet.encode(method, method == 1 ? 0 : 3);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      CAPTURE(method, size);
      CHECK_FALSE(files.fault(sheet.json, whole.substr(0, size)).empty());
    }
    for (std::size_t i = 0; i < whole.size(); ++i) {
      for (const int flip : {1, 2, 0x10, 0x80}) {
        std::string damaged = whole;
        damaged[i] = static_cast<char>(damaged[i] ^ flip);
        static_cast<void>(files.fault(sheet.json, damaged));
      }
    }
  }
}
