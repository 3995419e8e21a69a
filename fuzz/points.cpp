// Property, for any bytes as a point cloud of any format: the reader returns as many surfels as it
// promises, each within its limits, and a row of attributes for each, or throws DataError, or
// std::system_error when the system refuses.
//
// The first byte picks the reader, which does not look at the name of the file.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <system_error>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/cloud/formats.h"
#include "format/text.h"
#include "fuzz/memory_file.h"
#include "fuzz/require.h"

namespace {

using namespace ptc;
using fuzz::require;

// A reader under test. New ones go to the end, so that the corpus keeps its meaning.
struct Reader {
  const char* name;  // of the file
  PointFile (*open)(const std::filesystem::path&);
};
constexpr std::array<Reader, 11> kReaders{{{"a.las", open_las},
                                           {"a.laz", open_las},
                                           {"a.e57", open_e57},
                                           {"a.ply", open_ply},
                                           {"a.pcd", open_pcd},
                                           {"a.xyz", open_xyz},
                                           {"a.pts", open_pts},
                                           {"a.ptx", open_ptx},
                                           {"a.ptc", open_ptc},
                                           {"a.bgeo", open_bgeo},
                                           {"a.pdb", open_pdb}}};

bool is_finite(const glm::dvec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// Checks the facts about a file and returns the bytes of a row of attributes.
std::size_t check(const PointFileInfo& info) {
  std::size_t row_bytes = 0;
  for (const Channel& channel : info.channels) {
    require(is_name(channel.name));
    require(std::ranges::count(info.channels, channel.name, &Channel::name) == 1);
    require(channel.components >= 1 && channel.components <= 16);
    require(std::isfinite(channel.scale) && channel.scale != 0 && std::isfinite(channel.offset));
    row_bytes += channel.component_bytes() * channel.components;
  }
  for (const auto& [key, value] : info.text) require(is_name(key) && is_utf8(value));
  return row_bytes;
}

void check(const PointFileInfo& info, const Surfel& s) {
  require(is_finite(s.position) && fits_coordinates(s.position));
  require(std::isfinite(s.radius) && s.radius >= 0 && (info.has_radius || s.radius == 0));
  const glm::vec3& n = s.normal;
  const bool is_unit = std::abs(n.x * n.x + n.y * n.y + n.z * n.z - 1) < 1e-4F;
  require(n == glm::vec3(0) || (info.has_normals && is_unit));
  for (const glm::vec3& colour : {s.radiance, s.emission, s.albedo})
    require(is_finite(colour) && std::min({colour.x, colour.y, colour.z}) >= 0);
  require(std::max({s.albedo.x, s.albedo.y, s.albedo.z}) <= 1);
}

void read(const Reader& reader, const std::filesystem::path& path) {
  PointFile file = reader.open(path);
  const std::size_t row_bytes = check(file.info);
  if (const auto extent = file.source->extent()) {
    for (int axis = 0; axis < 3; ++axis)
      require(extent->bounds.low[axis] <= extent->bounds.high[axis]);
    for (const glm::dvec3& place : extent->sample) require(is_finite(place));
  }
  std::vector<Surfel> block(64);
  std::uint64_t points = 0;
  while (const std::size_t count = file.source->next(block)) {
    points += count;
    for (std::size_t i = 0; i < count; ++i) check(file.info, block[i]);
    require(file.source->attributes().size() == count * row_bytes);
  }
  require(!file.info.count || *file.info.count == points + file.source->left_out());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const Reader& reader = kReaders[data[0] % kReaders.size()];
  const std::span bytes(reinterpret_cast<const std::byte*>(data) + 1, size - 1);
  const fuzz::MemoryFile file(bytes, reader.name);
  try {
    read(reader, file.path());
  } catch (const DataError&) {
  } catch (const std::system_error&) {
  }
  return 0;
}
