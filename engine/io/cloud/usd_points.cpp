// Turns points into the columns of a UsdGeomPoints prim.
//
// Source: OpenUSD, schemas UsdGeomPoints and UsdGeomPrimvarsAPI. Channels become primvars of the
// nearest type that USD has for them:
//
//   half f32     float, float2, float3, float4; color3f, normal3f or vector3f by their role
//   f64          the same as double
//   u8 to i32    int, int2, int3, int4              u32 u64 i64   uint uint64 int64
//
// Other numbers of components, and several integers that are no int, become one primvar each.
#include "engine/io/cloud/usd_points.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <set>

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/rounding.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 16;  // of each column

ChannelType usd_number(ChannelType type) {
  using enum ChannelType;
  switch (type) {
    case half:
      return f32;
    case u8:
    case i8:
    case u16:
    case i16:
      return i32;
    default:
      return type;
  }
}

const char* scalar_name(ChannelType number) {
  using enum ChannelType;
  switch (number) {
    case f32:
      return "float";
    case f64:
      return "double";
    case u32:
      return "uint";
    case u64:
      return "uint64";
    case i64:
      return "int64";
    default:
      return "int";
  }
}

// Returns the type of a channel's values, or nothing when its components need a column each.
std::optional<std::string> value_type(const Channel& channel) {
  const ChannelType number = usd_number(channel.type);
  const bool is_float = number == ChannelType::f32 || number == ChannelType::f64;
  const std::string scalar = scalar_name(number);
  if (channel.components == 1) return scalar;
  if (channel.components > 4 || (!is_float && number != ChannelType::i32)) return std::nullopt;
  if (channel.components == 3 && is_float) {
    const std::string ending = number == ChannelType::f32 ? "3f" : "3d";
    if (channel.role == ChannelRole::direction) return "normal" + ending;
    if (channel.role == ChannelRole::vector) return "vector" + ending;
    if (channel.role == ChannelRole::colour && channel.colour_space == ColourSpace::rec709)
      return "color" + ending;
  }
  return scalar + std::to_string(channel.components);
}

Bounds moved(const Bounds& bounds, const glm::dvec3& by) {
  return bounds.empty() ? bounds : Bounds{bounds.low - by, bounds.high - by};
}

// Returns the most by which a coordinate moves when it is rounded to float about the middle of the
// bounds. Where all coordinates are multiples of 2^b, the middle is one of 2^(b - 1).
double error_about(const PointWriteInfo& info, const glm::dvec3& middle) {
  const glm::dvec3 sides = info.bounds.high - info.bounds.low;
  const double side = std::max({sides.x, sides.y, sides.z});
  if (info.rounding && side <= std::ldexp(1.0, info.rounding->last_bit + 24)) return 0;
  return float_error(moved(info.bounds, middle));
}

}  // namespace

UsdStage usd_stage(const PointWriteInfo& info) {
  UsdStage stage;
  const auto up = info.text.find("up"), metres = info.text.find("metres_per_unit");
  if (up != info.text.end() && up->second == "z") stage.up = 'Z';
  if (metres != info.text.end()) stage.metres_per_unit = parse_number(metres->second);
  if (float_error(info) > kMostMove * least_spacing(info)) {
    const glm::dvec3 middle = info.bounds.low + (info.bounds.high - info.bounds.low) / 2.0;
    if (float_error(moved(info.bounds, middle)) < float_error(info.bounds)) {
      stage.translation = middle;
    }
  }
  return stage;
}

UsdWriter::UsdWriter(const PointWriteInfo& info, std::uint64_t begin, std::uint64_t lead)
    : CheckedWriter(info.count, row_bytes(info.channels)),
      stage_(usd_stage(info)),
      colour_(info),
      end_(begin),
      lead_(lead) {
  add_columns(info);
  buffers_.resize(columns_.size());
  stored_.resize(columns_.size());
}

void UsdWriter::add_columns(const PointWriteInfo& info) {
  // The attributes that the schema knows
  add({.name = "points", .type = "point3f", .source = UsdSource::position, .numbers = 3});
  if (info.has_normals)
    add({.name = "normals", .type = "normal3f", .source = UsdSource::normal, .numbers = 3});
  if (info.has_radius) add({.name = "widths", .type = "float", .source = UsdSource::width});

  // The colours of a surfel
  const auto add_colour = [this](bool wanted, const char* name, UsdSource source) {
    if (wanted) add({.name = name, .type = "color3f", .source = source, .numbers = 3});
  };
  add_colour(colour_.exists(), "primvars:displayColor", UsdSource::colour);
  add_colour(info.has_albedo && colour_.hides_albedo(), "primvars:albedo", UsdSource::albedo);
  add_colour(info.has_radiance, "primvars:radiance", UsdSource::radiance);
  add_colour(info.emits, "primvars:emission", UsdSource::emission);

  // The channels
  const std::set<std::string> taken{"displayColor", "displayOpacity", "albedo", "radiance",
                                    "emission"};
  for (const RowChannel& row : row_channels(info.channels, taken)) add_channel(row);
}

void UsdWriter::add_channel(const RowChannel& row) {
  const Channel& channel = row.channel;
  UsdColumn column{.name = row.name,
                   .type = scalar_name(usd_number(channel.type)),
                   .source = UsdSource::channel,
                   .number = usd_number(channel.type),
                   .from = channel.type,
                   .row_offset = row.offset};
  if (const std::optional<std::string> type = value_type(channel)) {
    column.type = *type;
    column.numbers = channel.components;
    column.name = "primvars:" + row.name;
    add(std::move(column));
    return;
  }
  for (std::size_t i = 0; i < channel.components; ++i) {
    column.name = "primvars:" + row.parts[i];
    column.row_offset = row.offset + i * channel.component_bytes();
    add(column);
  }
}

// Gives a column its place. A name of USD must not begin with a digit.
void UsdWriter::add(UsdColumn column) {
  const std::size_t first = column.name.rfind(':') + 1;  // 0 where there is no colon
  if (std::isdigit(static_cast<unsigned char>(column.name[first])) != 0)
    column.name.insert(first, 1, '_');
  while (std::ranges::find(columns_, column.name, &UsdColumn::name) != columns_.end())
    column.name += '_';
  column.begin = (end_ + lead_ + 7) / 8 * 8;
  end_ = column.begin + announced() * column.value_bytes();
  columns_.push_back(std::move(column));
}

void UsdWriter::put(const Surfel& surfel, const std::byte* row) {
  box_.add(glm::dvec3(relative(surfel)));
  most_radius_ = std::max(most_radius_, surfel.radius);
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    append(columns_[i], surfel, row, buffers_[i]);
    if (buffers_[i].size() >= kBufferBytes) flush(i);
  }
}

void UsdWriter::append(const UsdColumn& column, const Surfel& surfel, const std::byte* row,
                       std::vector<std::byte>& out) const {
  if (column.source == UsdSource::width) return append_value(out, 2 * surfel.radius);
  if (column.source != UsdSource::channel) {
    const glm::vec3 v = triple(column.source, surfel, row);
    for (int i = 0; i < 3; ++i) append_value(out, v[i]);
    return;
  }
  for (std::size_t i = 0; i < column.numbers; ++i) {
    std::byte number[8];
    const std::byte* const from = row + column.row_offset + i * channel_bytes(column.from);
    const std::byte* const end = store_number(column.from, from, column.number, number);
    out.insert(out.end(), static_cast<const std::byte*>(number), end);
  }
}

glm::vec3 UsdWriter::triple(UsdSource source, const Surfel& surfel, const std::byte* row) const {
  switch (source) {
    case UsdSource::normal:
      return surfel.normal;
    case UsdSource::colour:
      return colour_.linear(surfel, row);
    case UsdSource::radiance:
      return surfel.radiance;
    case UsdSource::emission:
      return surfel.emission;
    case UsdSource::albedo:
      return surfel.albedo;
    default:
      return relative(surfel);
  }
}

glm::vec3 UsdWriter::relative(const Surfel& surfel) const {
  return glm::vec3(surfel.position - stage_.translation.value_or(glm::dvec3(0)));
}

void UsdWriter::flush(std::size_t column) {
  if (buffers_[column].empty()) return;
  store(columns_[column].begin + stored_[column], buffers_[column]);
  stored_[column] += buffers_[column].size();
  buffers_[column].clear();
}

void UsdWriter::flush() {
  for (std::size_t i = 0; i < columns_.size(); ++i) flush(i);
}

std::vector<glm::vec3> UsdWriter::extent() const {
  if (box_.empty()) return {glm::vec3(0), glm::vec3(0)};
  const glm::dvec3 radius(static_cast<double>(most_radius_));
  return {glm::vec3(box_.low - radius), glm::vec3(box_.high + radius)};
}

std::vector<std::string> usd_losses(const PointWriteInfo& info) {
  std::vector<std::string> sentences;
  const UsdStage stage = usd_stage(info);
  add_float_positions(
      sentences, stage.translation ? error_about(info, *stage.translation) : float_error(info));
  const auto up = info.text.find("up");
  if (up != info.text.end() && up->second == "x") {
    sentences.push_back("USD has no upward x axis: the stage names y instead.");
  }
  add_unscaled_channels(sentences, info);
  add_lost_crs(sentences, info);
  return sentences;
}

}  // namespace ptc
