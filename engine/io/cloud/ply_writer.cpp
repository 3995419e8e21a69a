// Writes clouds to PLY, and finds names for their columns.
#include <algorithm>
#include <cctype>
#include <set>
#include <stdexcept>
#include <utility>

#include "engine/io/cloud/points.h"
#include "engine/io/file/buffered_output.h"

namespace ptc {
namespace {

// Returns what each component of a column appends to its name.
std::vector<std::string> suffixes(const PointColumn& column) {
  if (column.components == 1) return {""};
  if (column.components == 3) {
    return column.vector ? std::vector<std::string>{"_x", "_y", "_z"}
                         : std::vector<std::string>{"_r", "_g", "_b"};
  }
  std::vector<std::string> numbers;
  for (unsigned i = 0; i < column.components; ++i)
    numbers.push_back(std::string(1, '_').append(std::to_string(i)));
  return numbers;
}

std::vector<std::string> names_of(const PointColumn& column) {
  std::vector<std::string> names;
  for (const std::string& suffix : suffixes(column)) names.push_back(column.name + suffix);
  return names;
}

bool is_property_name(const std::string& name) {
  return !name.empty() && std::ranges::all_of(name, [](unsigned char c) {
    return c < 128 && (std::isalnum(c) != 0 || c == '_');
  });
}

// Returns the header, or throws when a name cannot be a property or occurs twice.
std::string make_header(std::uint64_t count, bool emits, const std::vector<PointColumn>& columns) {
  std::string text =
      "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(count) + "\n";
  std::set<std::string> seen;
  const auto add = [&](const char* type, const std::string& name) {
    if (!is_property_name(name))
      throw std::invalid_argument("PlyWriter: not a property name: " + name);
    if (!seen.insert(name).second)
      throw std::invalid_argument("PlyWriter: two properties have the name " + name);
    text += std::string("property ") + type + " " + name + "\n";
  };
  for (const char* name : {"x", "y", "z"}) add("double", name);
  for (const char* name : {"nx", "ny", "nz", "radius", "radiance_r", "radiance_g", "radiance_b",
                           "red", "green", "blue"}) {
    add("float", name);
  }
  for (const char* name : {"emission_r", "emission_g", "emission_b"}) {
    if (emits) add("float", name);
  }
  for (const PointColumn& column : columns) {
    for (const std::string& name : names_of(column)) add("float", name);
  }
  return text + "end_header\n";
}

}  // namespace

std::vector<PointColumn> ply_columns(std::span<const Channel> channels) {
  std::set<std::string> taken{"x",          "y",          "z",          "nx",         "ny",
                              "nz",         "radius",     "red",        "green",      "blue",
                              "radiance",   "radiance_r", "radiance_g", "radiance_b", "emission",
                              "emission_r", "emission_g", "emission_b"};
  std::vector<PointColumn> columns;
  for (const Channel& channel : channels) {
    PointColumn column{.name = channel.name,
                       .components = channel.components,
                       .vector = channel.name.find("normal") != std::string::npos};
    std::ranges::replace(column.name, '.', '_');
    const auto is_taken = [&] {
      return taken.contains(column.name) ||
             std::ranges::any_of(names_of(column),
                                 [&](const std::string& name) { return taken.contains(name); });
    };
    while (is_taken()) column.name += '_';
    taken.insert(column.name);
    for (const std::string& name : names_of(column)) taken.insert(name);
    columns.push_back(column);
  }
  return columns;
}

PlyWriter::PlyWriter(const std::filesystem::path& target, std::uint64_t count, bool emits,
                     std::vector<PointColumn> columns)
    : columns_(std::move(columns)),
      header_(make_header(count, emits, columns_)),
      emits_(emits),
      announced_(count),
      out_(target) {
  for (const PointColumn& column : columns_) values_per_point_ += column.components;
  out_.put(header_.data(), header_.size());
}

void PlyWriter::write(std::span<const Surfel> surfels, std::span<const float> values) {
  if (values.size() != surfels.size() * values_per_point_) {
    throw std::invalid_argument("PlyWriter: " + std::to_string(values.size()) + " values for " +
                                std::to_string(surfels.size()) + " points");
  }
  written_ += surfels.size();
  if (written_ > announced_) return;  // finish() will refuse the file
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const Surfel& surfel = surfels[i];
    out_.put(&surfel.position, sizeof surfel.position);
    out_.put(&surfel.normal, sizeof surfel.normal);
    out_.put(&surfel.radius, sizeof surfel.radius);
    out_.put(&surfel.radiance, sizeof surfel.radiance);
    out_.put(&surfel.albedo, sizeof surfel.albedo);
    if (emits_) out_.put(&surfel.emission, sizeof surfel.emission);
    out_.put(values.data() + i * values_per_point_, values_per_point_ * sizeof(float));
  }
}

void PlyWriter::finish() {
  if (written_ != announced_) {
    throw std::invalid_argument("PlyWriter: " + std::to_string(written_) + " points instead of " +
                                std::to_string(announced_));
  }
  out_.publish();
}

}  // namespace ptc
