// Writes the same points in all formats, for writers_peer.py: write_samples DIRECTORY. The values
// follow from the number of the point, so that a program in another language can tell them.
//
//   near.*    within 200 units of the origin        far.*    in a national grid
#include <iostream>

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/las_vlrs.h"
#include "engine/io/cloud/point_writer.h"
#include "format/scalar.h"

namespace {

using namespace ptc;

constexpr int kPoints = 5000;

// Returns an extended record of LAS that is longer than any plain one.
std::vector<std::byte> long_record() {
  constexpr std::uint64_t kBytes = 70'000;
  std::vector<std::byte> record(2);
  for (const char c : {'p', 'e', 'e', 'r'}) append_value(record, c);
  record.resize(18);
  append_value(record, std::uint16_t{7});
  append_value(record, kBytes);
  record.resize(kEvlrHeaderBytes);
  for (std::uint64_t i = 0; i < kBytes; ++i)
    append_value(record, static_cast<std::uint8_t>(i * i >> 3 & 255));
  return record;
}

PointWriteInfo info_of() {
  using enum ChannelType;
  PointWriteInfo info{.count = kPoints};
  info.channels = {{.name = "intensity", .type = u16},
                   {.name = "return_number", .type = u8},
                   {.name = "number_of_returns", .type = u8},
                   {.name = "classification", .type = u8, .role = ChannelRole::label},
                   {.name = "scan_angle", .type = i16, .scale = 0.006},
                   {.name = "gps_time", .type = f64, .role = ChannelRole::time, .unit = "s"},
                   {.name = "rgb",
                    .type = u16,
                    .components = 3,
                    .role = ChannelRole::colour,
                    .colour_space = ColourSpace::srgb},
                   {.name = "nir", .type = u16},
                   {.name = "occlusion", .type = half},
                   {.name = "bent_normal", .components = 3, .role = ChannelRole::direction},
                   {.name = "sky",
                    .type = f32,
                    .components = 3,
                    .role = ChannelRole::colour,
                    .colour_space = ColourSpace::rec709},
                   {.name = "id", .type = u64},
                   {.name = "tilt", .type = i32, .unit = "deg", .scale = 0.5, .offset = 3},
                   {.name = "pair", .type = i8, .components = 2}};
  info.text = {{"up", "z"},
               {"metres_per_unit", "0.3048"},
               {"crs", "LOCAL_CS[\"peer\",UNIT[\"foot\",0.3048]]"},
               {kLasRecordsKey, encode_vlrs({}, long_record())}};
  info.has_normals = info.has_radius = info.has_radiance = info.has_albedo = info.emits = true;
  return info;
}

Surfel surfel_of(int i, const glm::dvec3& origin) {
  const float f = static_cast<float>(i);
  return {.position = origin + glm::dvec3(i % 100 + 0.25, i / 100 * 0.5, i % 64 * 0.125),
          .normal = i % 2 == 0 ? glm::vec3(0, 0, 1) : glm::vec3(0.6F, -0.8F, 0),
          .radius = 0.5F + f / 8192,
          .radiance = {f, 2 * f, 0.125F},
          .albedo = {static_cast<float>(i % 9) / 8, 1, 0},
          .emission = {0, f, 3}};
}

void append_row(std::vector<std::byte>& rows, int i) {
  const auto n = static_cast<unsigned>(i);
  const auto half_of = [](double v) { return encode_half(static_cast<float>(v)); };
  append_value(rows, static_cast<std::uint16_t>(7 * n));
  append_value(rows, static_cast<std::uint8_t>(1 + n % 3));
  append_value(rows, std::uint8_t{3});
  append_value(rows, static_cast<std::uint8_t>(n % 200));
  append_value(rows, static_cast<std::int16_t>(i - 2500));
  append_value(rows, 1e8 + i / 8.0);
  for (const unsigned v : {3 * n, 65535 - n, 257 * (n % 256)})
    append_value(rows, static_cast<std::uint16_t>(v));
  append_value(rows, static_cast<std::uint16_t>(5 * n));
  append_value(rows, half_of(i % 65 / 64.0));
  for (const double v : {0.0, 0.5, -1.0}) append_value(rows, half_of(v));
  for (const int v : {i, -i, 0}) append_value(rows, static_cast<float>(v) / 16);
  append_value(rows, std::uint64_t{n} << 33);
  append_value(rows, -3 * i);
  for (const int v : {i % 100, -(i % 100)}) append_value(rows, static_cast<std::int8_t>(v));
}

void write(const std::filesystem::path& stem, const glm::dvec3& origin) {
  PointWriteInfo info = info_of();
  std::vector<Surfel> surfels;
  std::vector<std::byte> rows;
  for (int i = 0; i < kPoints; ++i) {
    surfels.push_back(surfel_of(i, origin));
    info.bounds.add(surfels.back().position);
    append_row(rows, i);
  }
  for (const char* ending : {".bgeo", ".las", ".pcd", ".ply", ".ptc", ".usda", ".usdc", ".xyz"}) {
    std::filesystem::path target = stem;
    target += ending;
    const auto writer = create_points(target, output_format(target).value(), info);
    writer->write(surfels, rows);
    writer->finish();
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: write_samples DIRECTORY\n";
    return 2;
  }
  try {
    const std::filesystem::path directory = argv[1];
    std::filesystem::create_directories(directory);
    write(directory / "near", glm::dvec3(0));
    write(directory / "far", glm::dvec3(637'000, 848'000, 400));
  } catch (const std::exception& error) {
    std::cerr << "write_samples: " << error.what() << "\n";
    return 1;
  }
  return 0;
}
