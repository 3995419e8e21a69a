// glTF whose buffer views are compressed by meshoptimizer: streams that its own encoder writes.
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <meshoptimizer.h>
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

// A sheet of 7 x 5 points in the plane z = x, and its buffer.
class Sheet {
 public:
  Json json = Json::parse(R"({
    "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
    "extensionsUsed": ["EXT_meshopt_compression"],
    "extensionsRequired": ["EXT_meshopt_compression"],
    "meshes": [{"primitives": [{"indices": 0, "attributes": {"POSITION": 1}}]}]})");

  explicit Sheet(const char* mode = "TRIANGLES") {
    std::vector<unsigned> indices;
    for (std::uint32_t y = 0; y + 1 < kHigh; ++y) {
      for (std::uint32_t x = 0; x + 1 < kWide; ++x) {
        const unsigned at = y * kWide + x;
        indices.insert(indices.end(), {at, at + 1, at + kWide, at + 1, at + kWide + 1, at + kWide});
      }
    }
    const bool triangles = std::string_view(mode) == "TRIANGLES";
    std::string stream(triangles ? meshopt_encodeIndexBufferBound(indices.size(), kPoints)
                                 : meshopt_encodeIndexSequenceBound(indices.size(), kPoints),
                       '\0');
    auto* const to = reinterpret_cast<unsigned char*>(stream.data());
    stream.resize(
        triangles ? meshopt_encodeIndexBuffer(to, stream.size(), indices.data(), indices.size())
                  : meshopt_encodeIndexSequence(to, stream.size(), indices.data(), indices.size()));
    add_view(stream, mode, "NONE", indices.size(), 2);
    add_accessor(5123, indices.size(), "SCALAR");

    std::vector<float> positions;
    for (std::uint32_t i = 0; i < kPoints; ++i) {
      const auto x = static_cast<float>(i % kWide), y = static_cast<float>(i / kWide);
      positions.insert(positions.end(), {x, y, x});
    }
    add_attributes(positions.data(), kPoints, 12, "NONE");
    add_accessor(5126, kPoints, "VEC3");
  }

  void add_view(const std::string& stream, const char* mode, const char* filter, std::size_t count,
                std::size_t stride) {
    json["bufferViews"].push_back({{"buffer", 1},
                                   {"byteLength", count * stride},
                                   {"extensions",
                                    {{"EXT_meshopt_compression",
                                      {{"buffer", 0},
                                       {"byteOffset", bytes.size()},
                                       {"byteLength", stream.size()},
                                       {"byteStride", stride},
                                       {"count", count},
                                       {"mode", mode},
                                       {"filter", filter}}}}}});
    bytes += stream;
  }
  void add_attributes(const void* data, std::size_t count, std::size_t stride, const char* filter) {
    std::string stream(meshopt_encodeVertexBufferBound(count, stride), '\0');
    stream.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(stream.data()),
                                             stream.size(), data, count, stride));
    add_view(stream, "ATTRIBUTES", filter, count, stride);
    json["bufferViews"].back()["byteStride"] = stride;
  }
  std::size_t add_accessor(unsigned type, std::size_t count, const char* shape,
                           bool normalised = false) {
    json["accessors"].push_back({{"bufferView", json["bufferViews"].size() - 1},
                                 {"componentType", type},
                                 {"count", count},
                                 {"type", shape},
                                 {"normalized", normalised}});
    return json["accessors"].size() - 1;
  }
  Json& stream(std::size_t view) {
    return json["bufferViews"][view]["extensions"]["EXT_meshopt_compression"];
  }

  std::filesystem::path write() {
    json["buffers"] = {{{"uri", "a.bin"}, {"byteLength", bytes.size()}},
                       {{"byteLength", 1 << 20}}};  // holds nothing
    scratch.file("a.bin", bytes);
    return scratch.file("a.gltf", json.dump());
  }
  MeshFile read(std::optional<double> seconds = {}) {
    MeshRoom room;
    room.seconds = seconds;
    return read_mesh(write(), room);
  }
  std::string fault() {
    return refusal([&] { static_cast<void>(read()); });
  }

  std::string bytes;
  test::TemporaryDirectory scratch;
};

}  // namespace

TEST_CASE("meshopt: triangles, indices and attributes are those that were encoded",
          "[io][gltf][meshopt]") {
  for (const char* mode : {"TRIANGLES", "INDICES"}) {
    Sheet sheet(mode);
    const MeshFile file = sheet.read();
    CHECK(file.warnings.empty());
    REQUIRE(file.mesh.triangles.size() == kTriangles);
    CHECK(file.mesh.positions.size() == kPoints);
    double area = 0;
    for (const auto& t : file.mesh.triangles) {
      const glm::dvec3 a = file.mesh.positions[t[0]], b = file.mesh.positions[t[1]],
                       c = file.mesh.positions[t[2]];
      area += glm::cross(b - a, c - a).z / 2;
    }
    CHECK(area == Approx((kWide - 1) * (kHigh - 1)));
    CHECK(file.mesh.bounds().high == glm::dvec3(kWide - 1, kHigh - 1, kWide - 1));
  }
}

TEST_CASE("meshopt: filters restore normals, rotations and exponents", "[io][gltf][meshopt]") {
  Sheet sheet;
  // A normal of each point, as octahedral bytes
  const glm::vec3 normal = glm::normalize(glm::vec3(-1, 0.5F, 1));
  std::vector<float> normals, times{0, 1, 2, 3};
  for (std::uint32_t i = 0; i < kPoints; ++i)
    normals.insert(normals.end(), {normal.x, normal.y, normal.z, 0});
  std::string filtered(4 * std::size_t{kPoints}, '\0');
  meshopt_encodeFilterOct(filtered.data(), kPoints, 4, 8, normals.data());
  sheet.add_attributes(filtered.data(), kPoints, 4, "OCTAHEDRAL");
  const std::size_t normals_at = sheet.add_accessor(5120, kPoints, "VEC3", true);
  sheet.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normals_at;
  // A turn by 90 degrees about z in each of three seconds
  const auto half = static_cast<float>(std::sqrt(0.5));
  const std::vector<float> turns{0, 0, 0, 1, 0, 0, half, half, 0, 0, 1, 0, 0, 0, half, -half};
  filtered.assign(8 * 4, '\0');
  meshopt_encodeFilterQuat(filtered.data(), 4, 8, 16, turns.data());
  sheet.add_attributes(filtered.data(), 4, 8, "QUATERNION");
  const std::size_t output = sheet.add_accessor(5122, 4, "VEC4", true);
  filtered.assign(4 * 4, '\0');
  meshopt_encodeFilterExp(filtered.data(), 4, 4, 23, times.data());
  sheet.add_attributes(filtered.data(), 4, 4, "EXPONENTIAL");
  const std::size_t input = sheet.add_accessor(5126, 4, "SCALAR");
  sheet.json["animations"] = {
      {{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "rotation"}}}}}},
       {"samplers", {{{"input", input}, {"output", output}}}}}};

  const Mesh still = sheet.read().mesh;
  REQUIRE(still.normals.size() == kPoints);
  for (const glm::vec3& n : still.normals) CHECK(glm::distance(n, normal) < 0.02F);
  const MeshFile file = sheet.read(1.5);
  CHECK(file.animation_seconds == 3);
  CHECK(file.moves_mesh);
  const double angle = 0.75 * std::numbers::pi;
  const glm::dvec3 high = file.mesh.bounds().high;
  CHECK(high.x == Approx(0).margin(1e-3));  // all of it is left of the axis
  CHECK(high.y == Approx(std::sin(angle) * (kWide - 1)).epsilon(1e-3));
}

TEST_CASE("meshopt: a buffer view that breaks a rule is refused", "[io][gltf][meshopt]") {
  const auto with = [](const char* pointer, const Json& value, const char* rule) {
    Sheet sheet;
    CHECK(sheet.fault().empty());
    sheet.json[Json::json_pointer(pointer)] = value;
    CAPTURE(pointer);
    CHECK_THAT(sheet.fault(), Contains(rule));
  };
  const std::string indices = "/bufferViews/0/extensions/EXT_meshopt_compression/";
  const std::string positions = "/bufferViews/1/extensions/EXT_meshopt_compression/";
  const auto index = [&](const char* key, const Json& value, const char* rule) {
    with((indices + key).c_str(), value, rule);
  };
  const auto position = [&](const char* key, const Json& value, const char* rule) {
    with((positions + key).c_str(), value, rule);
  };
  index("mode", "STRIPS", "a.gltf: bufferView 0: meshopt: its mode is unknown");
  index("mode", 1, "its mode is unknown");
  index("filter", "SPHERE", "its filter is unknown");
  index("filter", "EXPONENTIAL", "its filter does not go with");
  position("filter", "OCTAHEDRAL", "bufferView 1: meshopt: its filter does not go with");
  position("filter", "QUATERNION", "its filter does not go with");
  for (const int stride : {0, 1, 3, 8, 12})
    index("byteStride", stride, "its byteStride does not go with its mode");
  index("byteStride", 4, "its elements do not fill it");
  for (const int stride : {0, 2, 13, 260})
    position("byteStride", stride, "its byteStride does not go with its mode");
  position("byteStride", 8, "its elements do not fill it");
  index("count", 3 * kTriangles - 1, "it has a part of a triangle");
  index("count", 3 * kTriangles - 3, "its elements do not fill it");
  index("count", std::uint64_t{3} << 61, "it has more elements than bytes for them");
  position("count", std::uint64_t{1} << 62, "it has more elements than bytes for them");
  position("buffer", 1, "buffer 1 has only 0 bytes");
  position("buffer", 2, "buffers has no entry 2");
  position("byteOffset", 1 << 20, "bufferView 1 reaches past its buffer");
  with("/bufferViews/1/byteLength", 1, "its elements do not fill it");
  with("/bufferViews/1/byteStride", 16, "its elements do not fill it");
  with("/accessors/1/count", kPoints + 1, "accessor 1 reaches past its bufferView");

  // More bytes than a stream can hold, though the view would
  Sheet sheet;
  sheet.stream(1)["count"] = 1'000'002;
  sheet.json["bufferViews"][1]["byteLength"] = 12'000'024;
  CHECK_THAT(sheet.fault(), Contains("it has more elements than bytes for them"));
}

TEST_CASE("meshopt: views that take more memory than there is name the cap",
          "[io][gltf][meshopt]") {
  Sheet sheet;
  const auto path = sheet.write();
  const std::uint64_t json_bytes = GltfDocument(path, 1 << 20).json_bytes();
  GltfDocument document(path, 1 << 20);
  const std::uint64_t bytes = document.view_bytes();
  CHECK(bytes >= 12 * kPoints + 6 * kTriangles);
  CHECK(bytes < 12 * kPoints + 6 * kTriangles + sheet.bytes.size());
  MeshRoom room;
  room.temp_directory = sheet.scratch.path();
  room.memory_bytes = std::max(json_bytes + std::filesystem::file_size(path), json_bytes + bytes);
  CHECK_NOTHROW(GltfDocument(path, room.memory_bytes).view_bytes());
  GltfDocument little(path, room.memory_bytes);
  for (int i = 0; i < 4; ++i) {  // the decompressed views are counted once
    static_cast<void>(little.view(0));
    static_cast<void>(little.view(1));
  }
  CHECK(little.view_bytes() == 12 * kPoints + 6 * kTriangles);
  for (int i = 0; i < 2000; ++i) sheet.json["bufferViews"].push_back(sheet.json["bufferViews"][1]);
  const auto many = sheet.write();
  room.memory_bytes =
      GltfDocument(many, 1 << 30).json_bytes() + std::filesystem::file_size(many) + 400'000;
  CHECK_THROWS_WITH(read_mesh(many, room),
                    Contains("meshoptimizer compressed do not fit in `run.memory_bytes`"));
  GltfDocument piecewise(many, room.memory_bytes);
  const auto decompress_all = [&] {
    for (std::uint64_t i = 0; i < 2002; ++i) static_cast<void>(piecewise.view(i));
  };
  CHECK_THROWS_AS(decompress_all(), LimitError);
}

TEST_CASE("meshopt: every truncation and every flipped byte is read or refused",
          "[io][gltf][meshopt]") {
  for (const char* mode : {"TRIANGLES", "INDICES"}) {
    Sheet sheet(mode);
    const std::string whole = sheet.bytes;
    for (std::size_t view = 0; view < 2; ++view) {
      Json& length = sheet.stream(view)["byteLength"];
      const std::size_t bytes = length;
      for (std::size_t size = 0; size < bytes; ++size) {
        length = size;
        CHECK_FALSE(sheet.fault().empty());
      }
      length = bytes;
    }
    for (std::size_t i = 0; i < whole.size(); ++i) {
      for (const int flip : {1, 2, 0x10, 0x80}) {
        sheet.bytes = whole;
        sheet.bytes[i] = static_cast<char>(sheet.bytes[i] ^ flip);
        static_cast<void>(sheet.fault());
      }
    }
  }
}
