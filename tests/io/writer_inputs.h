// Points for the tests of the writers, and numbers in the files that they write.
#pragma once

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/point_writer.h"

namespace ptc::test {

/// Returns the number that lies at an offset of a file.
template <typename T>
T number_at(std::string_view bytes, std::size_t offset) {
  T value{};
  if (offset + sizeof value > bytes.size()) throw std::out_of_range("behind the end of the file");
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

/// Returns the number of the other byte order that lies at an offset of a file.
template <typename T>
T big_at(std::string_view bytes, std::size_t offset) {
  std::string turned(bytes.substr(offset, sizeof(T)));
  std::reverse(turned.begin(), turned.end());
  return number_at<T>(turned, 0);
}

/// Returns a surfel in whose every number `i` can be seen.
inline Surfel surfel_of(int i) {
  const auto f = static_cast<float>(i);
  return {.position = {10.0 + i, 20.5 - i, 0.25 * i},
          .normal = i % 2 == 0 ? glm::vec3(0, 0, 1) : glm::vec3(0.6F, -0.8F, 0),
          .radius = 0.5F + f,
          .radiance = {f, 2 * f, 0.125F},
          .albedo = {0.25F, 1, 0},
          .emission = {0, f, 3}};
}

/// Returns surfels 0, 1, ...
inline std::vector<Surfel> surfels_of(int count) {
  std::vector<Surfel> surfels;
  for (int i = 0; i < count; ++i) surfels.push_back(surfel_of(i));
  return surfels;
}

/// Returns what a file of these surfels holds when they have nothing but positions.
inline PointWriteInfo plain_info(const std::vector<Surfel>& surfels) {
  PointWriteInfo info{.count = surfels.size()};
  for (const Surfel& surfel : surfels) info.bounds.add(surfel.position);
  return info;
}

/// Returns what a file of these surfels holds when all of their numbers are worth writing.
inline PointWriteInfo full_info(const std::vector<Surfel>& surfels) {
  PointWriteInfo info = plain_info(surfels);
  info.has_normals = info.has_radius = info.has_radiance = info.has_albedo = info.emits = true;
  return info;
}

/// Returns a channel of colours as scanners store them.
inline Channel stored_colour(ChannelType type, double scale = 1) {
  Channel channel{.name = "rgb", .type = type, .components = 3, .role = ChannelRole::colour};
  channel.colour_space = ColourSpace::srgb;
  channel.scale = scale;
  return channel;
}

/// Writes a whole file in two calls.
inline void write_points(const std::filesystem::path& path, OutputFormat format,
                         const PointWriteInfo& info, std::span<const Surfel> surfels,
                         const std::vector<std::byte>& rows = {}) {
  const auto writer = create_points(path, format, info);
  const std::size_t half = surfels.size() / 2;
  const std::size_t row_bytes = surfels.empty() ? 0 : rows.size() / surfels.size();
  writer->write(surfels.first(half), std::span(rows).first(half * row_bytes));
  writer->write(surfels.subspan(half), std::span(rows).subspan(half * row_bytes));
  writer->finish();
}

}  // namespace ptc::test
