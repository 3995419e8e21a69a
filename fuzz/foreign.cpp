// Property, for any bytes as a mesh, cloud or picture, plain or compressed: the reader returns what
// its header promises, or throws DataError, or std::system_error when a file that the bytes name is
// missing.
//
// The first byte picks the reader. What follows the first zero byte of an OBJ becomes the MTL file
// "a.mtl" in the same directory; what follows that of a glTF becomes the buffer "a.bin".
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string_view>
#include <system_error>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/io/image/image.h"
#include "engine/io/mesh/mesh.h"
#include "fuzz/memory_file.h"
#include "fuzz/require.h"

namespace {

using namespace ptc;
using fuzz::require;
using Path = std::filesystem::path;

bool is_finite(const glm::dvec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool is_unit(const glm::vec3& v) {
  return std::abs(v.x * v.x + v.y * v.y + v.z * v.z - 1) < 1e-4F;
}

void check(const Image& image) {
  require(image.width > 0 && image.height > 0);
  require(image.pixels.size() == std::size_t{image.width} * image.height);
  for (const glm::vec3& p : image.pixels) require(is_finite(p) && p.x >= 0 && p.y >= 0 && p.z >= 0);
}

void check(const Texture& texture) {
  require(texture.width() > 0 && texture.height() > 0);
  texture.visit_rows([](std::span<const glm::vec3> row) {
    for (const glm::vec3& p : row) require(is_finite(p) && p.x >= 0 && p.y >= 0 && p.z >= 0);
  });
}

void read_picture(const Path& path) {
  check(read_image(path));
}

void check(const Mesh& mesh) {
  const std::size_t vertices = mesh.positions.size();
  require(!mesh.triangles.empty() && mesh.material_of.size() == mesh.triangles.size() &&
          !mesh.materials.empty());
  require(mesh.normals.empty() || mesh.normals.size() == vertices);
  require(mesh.uvs.empty() || mesh.uvs.size() == vertices);
  require(is_finite(mesh.origin) && std::ranges::all_of(mesh.positions, is_finite));
  require(std::ranges::all_of(mesh.normals, is_unit));
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) require(vertex < vertices);
  }
  for (const std::uint16_t material : mesh.material_of) require(material < mesh.materials.size());
  for (const Material& material : mesh.materials) {
    require(is_finite(material.albedo) && is_finite(material.emission));
    if (material.texture) check(*material.texture);
  }
}

void check(const MeshCamera& camera) {
  require(is_finite(camera.position) && is_unit(camera.forward) && is_unit(camera.up));
  require(camera.horizontal_fov > 0 && camera.horizontal_fov < 3.1416F);
}

void read_mesh_file(const Path& path) {
  const MeshFile file = read_mesh(path);
  if (file.placed.empty() || !file.mesh.triangles.empty()) check(file.mesh);
  for (const PlacedMesh& placed : file.placed) {
    check(*placed.mesh);  // there is memory for it
    require(placed.places.size() >= 2 && std::ranges::all_of(placed.places, is_placement));
  }
  for (const MeshLight& light : file.lights) {
    require(is_finite(light.position) && is_unit(light.direction) && is_finite(light.intensity));
    require(std::min({light.intensity.x, light.intensity.y, light.intensity.z}) >= 0);
    require(light.inner_angle >= 0 && light.inner_angle <= light.outer_angle &&
            light.outer_angle > 0 && light.outer_angle < 1.5708F);
  }
  for (const MeshCamera& camera : file.cameras) check(camera);
  const std::uint64_t memory = std::uint64_t{1} << 30;
  for (const MeshCamera& camera : read_cameras(path, 0.5, memory).cameras) check(camera);
}

void read_cloud(const Path& path) {
  static_cast<void>(is_point_file(path));
  PointFile file = open_points(path);
  std::vector<Surfel> block(64);
  std::uint64_t points = 0;
  std::size_t row_bytes = 0;
  for (const Channel& channel : file.info.channels) {
    require(!channel.name.empty() && channel.name.size() <= 31 && channel.components >= 1 &&
            channel.components <= 16);
    row_bytes += channel.components * channel.component_bytes();
  }
  while (const std::size_t count = file.source->next(block)) {
    points += count;
    require(file.source->attributes().size() == count * row_bytes);
    for (std::size_t i = 0; i < count; ++i) {
      const Surfel& s = block[i];
      require(is_finite(s.position) && std::isfinite(s.radius) && s.radius >= 0 &&
              is_finite(s.radiance) && is_finite(s.emission));
      require(std::min({s.emission.x, s.emission.y, s.emission.z}) >= 0 &&
              (file.info.has_emission || s.emission == glm::vec3(0)));
      require((file.info.has_normals && is_unit(s.normal)) || s.normal == glm::vec3(0));
      require(is_finite(s.albedo) && std::min({s.albedo.x, s.albedo.y, s.albedo.z}) >= 0);
    }
  }
  require(!file.info.count || *file.info.count == points + file.source->left_out());
}

// A reader under test.
struct Reader {
  const char* name;              // of the file, whose ending says what it is
  void (*read)(const Path&);     // reads the file and checks the result
  const char* beside = nullptr;  // name of the second file, which follows behind a zero byte
};
constexpr std::array<Reader, 16> kReaders{{{"a.obj", read_mesh_file, "a.mtl"},
                                           {"a.ply", read_mesh_file},
                                           {"a.off", read_mesh_file},
                                           {"a.stl", read_mesh_file},
                                           {"a.gltf", read_mesh_file, "a.bin"},
                                           {"a.glb", read_mesh_file},
                                           {"a.obj.gz", read_mesh_file},
                                           {"a.ply.gz", read_mesh_file},
                                           {"a.off.gz", read_mesh_file},
                                           {"a.ply", read_cloud},
                                           {"a.xyz", read_cloud},
                                           {"a.ply.gz", read_cloud},
                                           {"a.exr", read_picture},
                                           {"a.png", read_picture},
                                           {"a.tga", read_picture},
                                           {"a.cloud", read_cloud}}};  // of any format

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const Reader& reader = kReaders[data[0] % kReaders.size()];
  std::span bytes(reinterpret_cast<const std::byte*>(data) + 1, size - 1);

  // Split off the second file.
  std::optional<fuzz::MemoryFile> beside;
  const auto zero =
      static_cast<std::size_t>(std::ranges::find(bytes, std::byte{0}) - bytes.begin());
  if (reader.beside != nullptr && zero < bytes.size()) {
    beside.emplace(bytes.subspan(zero + 1), reader.beside);
    bytes = bytes.first(zero);
  }

  // Read the file.
  const fuzz::MemoryFile file(bytes, reader.name);
  try {
    reader.read(file.path());
  } catch (const DataError&) {
  } catch (const std::system_error&) {
  }
  return 0;
}
