// dump_e57 FILE writes what the reader makes of an E57 file, for e57_peer.py: a line of JSON, then
// for each point three f64 of its position, three f32 of its normal, three f32 of its albedo, and
// its row.
#include <cstdio>
#include <exception>

#include <nlohmann/json.hpp>

#include "tests/io/e57_file.h"

namespace {

void write(std::span<const std::byte> bytes) {
  std::fwrite(bytes.data(), 1, bytes.size(), stdout);
}

template <typename T>
void write_value(const T& value) {
  write(std::as_bytes(std::span(&value, 1)));
}

void dump(const ptc::test::Cloud& cloud) {
  // The facts.
  nlohmann::json facts = {{"points", cloud.surfels.size()},
                          {"left_out", cloud.left_out},
                          {"has_normals", cloud.info.has_normals},
                          {"has_albedo", cloud.info.has_albedo},
                          {"text", cloud.info.text},
                          {"notes", cloud.info.notes},
                          {"channels", nlohmann::json::array()},
                          {"scanners", nlohmann::json::array()}};
  std::size_t row = 0;
  for (const ptc::Channel& channel : cloud.info.channels) {
    facts["channels"].push_back({{"name", channel.name},
                                 {"type", static_cast<int>(channel.type)},
                                 {"components", channel.components},
                                 {"scale", channel.scale},
                                 {"offset", channel.offset}});
    row += ptc::channel_bytes(channel.type) * channel.components;
  }
  for (const glm::dvec3& place : cloud.info.scanners) {
    facts["scanners"].push_back({place.x, place.y, place.z});
  }
  std::printf("%s\n", facts.dump().c_str());

  // The points.
  for (std::size_t i = 0; i < cloud.surfels.size(); ++i) {
    const ptc::Surfel& surfel = cloud.surfels[i];
    write_value(surfel.position);
    write_value(surfel.normal);
    write_value(surfel.albedo);
    write(std::span(cloud.rows).subspan(i * row, row));
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    dump(ptc::test::read_e57(argv[1], 4096));
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
