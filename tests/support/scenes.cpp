#include "tests/support/scenes.h"

#include <fstream>
#include <iterator>

#include "engine/io/cloud/point_writer.h"
#include "engine/io/cloud/record.h"
#include "engine/store/container_points.h"
#include "engine/store/reader.h"

namespace ptc::test {

std::vector<char> bytes_of(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<Surfel> points_of(const std::filesystem::path& path) {
  const ContainerReader scene(path);
  ContainerPoints points(scene);
  std::vector<PointRecord> block(4096);
  std::vector<Surfel> surfels;
  while (const std::size_t count = points.next(block)) {
    for (const PointRecord& r : std::span(block).first(count))
      surfels.push_back(to_surfel(r, scene.header().frame));
  }
  return surfels;
}

void write_ply(const std::filesystem::path& path, const std::vector<Surfel>& surfels, bool emits) {
  const auto writer = create_points(path, OutputFormat::ply,
                                    {.count = surfels.size(),
                                     .has_normals = true,
                                     .has_radius = true,
                                     .has_radiance = true,
                                     .has_albedo = true,
                                     .emits = emits});
  writer->write(surfels, {});
  writer->finish();
}

}  // namespace ptc::test
