// The choice of the fields that make a surfel, and the conversion of records.
//
// Names are looked up once. What is left for each record is to load some numbers whose places and
// types are known, to check them (convert_surfel()), and to copy ranges of bytes into its row.
#include "engine/io/cloud/point_layout.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/cloud/channel_names.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/srgb_curve.h"
#include "engine/io/cloud/surfel_check.h"
#include "engine/io/image/srgb.h"

namespace ptc {
namespace {

using Names = std::array<std::string_view, 3>;

constexpr Names kPosition = {"x", "y", "z"};
constexpr std::array<Names, 2> kNormal = {
    {{"nx", "ny", "nz"}, {"normal_x", "normal_y", "normal_z"}}};
constexpr Names kRadiance = {"radiance_r", "radiance_g", "radiance_b"};
constexpr Names kEmission = {"emission_r", "emission_g", "emission_b"};
constexpr Names kAlbedo = {"albedo_r", "albedo_g", "albedo_b"};
constexpr std::array<Names, 2> kColour = {
    {{"red", "green", "blue"}, {"diffuse_red", "diffuse_green", "diffuse_blue"}}};
constexpr Names kShortColour = {"r", "g", "b"};
constexpr Names kStoredColour = {"rgb_r", "rgb_g", "rgb_b"};  // the channel `rgb` of our writers
constexpr std::array<std::string_view, 2> kRadius = {"radius", "scalar_radius"};

bool is_float(ChannelType type) {
  return type == ChannelType::f32 || type == ChannelType::f64;
}

double look_up(std::span<const float> curve, double stored) {
  if (!(stored >= 0 && stored < static_cast<double>(curve.size()))) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  return static_cast<double>(curve[static_cast<std::size_t>(stored)]);
}

}  // namespace

void refuse_file(const std::filesystem::path& path, const std::string& rule) {
  throw DataError(path.string() + ": " + rule);
}

RecordField make_field(std::string_view name, ChannelType type, std::size_t offset) {
  RecordField field;
  field.channel.name.assign(name);
  field.channel.type = type;
  field.offset = offset;
  return field;
}

bool is_surfel_name(std::string_view name) {
  const auto in = [&](const auto& names) { return std::ranges::find(names, name) != names.end(); };
  return in(kPosition) || in(kNormal[0]) || in(kNormal[1]) || in(kRadius) || in(kRadiance) ||
         in(kEmission) || in(kAlbedo) || in(kColour[0]) || in(kColour[1]);
}

PointLayout::PointLayout(const std::filesystem::path& path, std::span<const RecordField> fields,
                         const LayoutRules& rules)
    : path_(path),
      fields_(fields),
      used_(fields.size()),
      owner_(rules.owner),
      whole_triples_(rules.whole_triples),
      nan_is_no_normal_(rules.nan_is_no_normal) {
  // Find the parts of the surfel.
  const auto position = numbers(find_triple(kPosition));
  if (!position) refuse_file(path, owner_ + " have no x, y and z");
  position_ = *position;
  normal_ = numbers(find_triple(kNormal[0]));
  if (!normal_) normal_ = numbers(find_triple(kNormal[1]));
  for (const std::string_view name : kRadius) {
    const auto index = radius_ ? std::nullopt : find(name);
    if (!index) continue;
    radius_ = {fields[*index].offset, fields[*index].channel.type};
    used_[*index] = true;
  }
  radiance_ = numbers(find_triple(kRadiance));
  emission_ = numbers(find_triple(kEmission));
  find_colours(rules);

  // Everything else becomes a channel.
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (used_[i]) continue;
    Channel channel = fields[i].channel;
    name_channel(channel, channels_);
    add_copy({fields[i].offset, channel.type}, channel.bytes());
    channels_.push_back(std::move(channel));
  }
  fields_ = {};
}

std::optional<std::size_t> PointLayout::find(std::string_view name) const {
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    const RecordField& field = fields_[i];
    if (!field.plain && !used_[i] && field.channel.components == 1 && field.channel.name == name)
      return i;
  }
  return std::nullopt;
}

// Finds three fields and marks them as used. Returns their indices.
std::optional<PointLayout::Indices> PointLayout::find_triple(const Names& names) {
  std::array<std::optional<std::size_t>, 3> at;
  std::ranges::transform(names, at.begin(), [&](std::string_view name) { return find(name); });
  const auto found = std::ranges::count_if(at, [](const auto& index) { return index.has_value(); });
  if (found == 0) return std::nullopt;
  if (found < 3) {
    if (!whole_triples_ && names != kPosition) return std::nullopt;
    refuse_file(path_, owner_ + " do not have all of " + std::string(names[0]) + ", " +
                           std::string(names[1]) + " and " + std::string(names[2]));
  }
  Indices indices{};
  for (std::size_t i = 0; i < 3; ++i) {
    indices[i] = *at[i];
    used_[indices[i]] = true;
  }
  return indices;
}

std::optional<PointLayout::Triple> PointLayout::numbers(
    const std::optional<Indices>& indices) const {
  if (!indices) return std::nullopt;
  Triple triple;
  for (std::size_t i = 0; i < 3; ++i) {
    const RecordField& field = fields_[(*indices)[i]];
    triple[i] = {field.offset, field.channel.type};
  }
  return triple;
}

// Finds the colours and chooses the curve of each. Integers, and floats that albedo cannot hold,
// are kept in a channel, too. Floats that are named as the albedo are taken as they are, whatever
// other colours there are.
void PointLayout::find_colours(const LayoutRules& rules) {
  // Find them. The names r, g and b may stand for anything, so they count only where the types are
  // those of colours.
  std::optional<Indices> indices = find_triple(kColour[0]);
  if (!indices) indices = find_triple(kColour[1]);
  const auto are_colours = [&](const Names& names) {
    return std::ranges::all_of(names, [&](std::string_view name) {
      const auto index = find(name);
      if (!index) return false;
      const ChannelType type = fields_[*index].channel.type;
      return type == ChannelType::u8 || type == ChannelType::u16;
    });
  };
  if (!indices && are_colours(kShortColour)) indices = find_triple(kShortColour);
  const auto is_byte = [&](std::size_t index) {
    return fields_[index].channel.type == ChannelType::u8;
  };
  if (are_colours(kStoredColour) && (!indices || std::ranges::all_of(*indices, is_byte)))
    indices = find_triple(kStoredColour);
  const auto is_number = [&](std::string_view name) {
    const auto index = find(name);
    return index && is_float(fields_[*index].channel.type);
  };
  if (std::ranges::all_of(kAlbedo, is_number)) {
    albedo_ = numbers(find_triple(kAlbedo));
    const bool linear = rules.float_colours == FloatColours::unbounded;
    if (linear) curves_.fill(Curve::clamped);
    if (indices) keep_colours(*indices, linear ? ColourSpace::rec709 : ColourSpace::srgb);
    return;
  }
  if (!indices) return;
  albedo_ = numbers(indices);

  // Choose the curves.
  for (std::size_t i = 0; i < 3; ++i) {
    const ChannelType type = (*albedo_)[i].type;
    if (is_float(type)) {
      curves_[i] = rules.float_colours == FloatColours::linear ? Curve::linear
                   : rules.float_colours == FloatColours::srgb ? Curve::srgb
                                                               : Curve::clamped;
    } else {
      const bool wide = type == ChannelType::u16 || type == ChannelType::i16;
      curves_[i] = wide ? Curve::srgb16 : Curve::srgb8;
    }
  }

  if (curves_[0] == Curve::linear) return;
  keep_colours(*indices, curves_[0] == Curve::clamped ? ColourSpace::rec709 : ColourSpace::srgb);
}

// Keeps three fields as one channel when they have one type, else each as a channel of its own.
void PointLayout::keep_colours(const Indices& fields, ColourSpace space) {
  const auto type = [&](std::size_t i) { return fields_[fields[i]].channel.type; };
  if (type(0) == type(1) && type(0) == type(2)) return add_rgb(fields, space);
  for (const std::size_t index : fields) used_[index] = false;
}

void PointLayout::add_rgb(const Indices& fields, ColourSpace space) {
  Channel rgb;
  rgb.name = "rgb";
  rgb.type = fields_[fields[0]].channel.type;
  rgb.components = 3;
  rgb.role = ChannelRole::colour;
  rgb.colour_space = space;
  for (const std::size_t index : fields) {
    add_copy({fields_[index].offset, rgb.type}, rgb.component_bytes());
  }
  channels_.push_back(std::move(rgb));
}

void PointLayout::take_bytes_as_colours() noexcept {
  std::ranges::replace(curves_, Curve::srgb16, Curve::srgb8);
}

// Appends bytes to the row, as part of the range before them where that continues.
void PointLayout::add_copy(const Number& from, std::size_t bytes) {
  if (!copies_.empty() && copies_.back().from + copies_.back().bytes == from.offset) {
    copies_.back().bytes += bytes;
  } else {
    copies_.push_back({from.offset, row_bytes_, bytes});
  }
  row_bytes_ += bytes;
}

void PointLayout::describe(PointFileInfo& info) const {
  info.has_normals = normal_.has_value();
  info.has_radius = radius_.has_value();
  info.has_radiance = radiance_.has_value();
  info.has_emission = emission_.has_value();
  info.has_albedo = albedo_.has_value();
  info.channels = channels_;
}

glm::dvec3 PointLayout::load(const std::byte* record, const Triple& at) noexcept {
  return {load_number(record + at[0].offset, at[0].type),
          load_number(record + at[1].offset, at[1].type),
          load_number(record + at[2].offset, at[2].type)};
}

// Returns the linear albedo of a stored value. A value out of range gives one that the check of
// the surfel refuses.
double PointLayout::albedo_of(double stored, Curve curve) {
  switch (curve) {
    case Curve::clamped:
      return std::clamp(stored, 0.0, 1.0);
    case Curve::srgb:
      return stored >= 0 && stored <= 1 ? srgb_to_linear(stored) : stored;
    case Curve::srgb8:
      return look_up(srgb_curve<255>(), stored);
    case Curve::srgb16:
      return look_up(srgb_curve<65535>(), stored);
    case Curve::linear:
      break;
  }
  return stored;
}

PointLayout::Outcome PointLayout::convert(const std::byte* record, Surfel& surfel, std::byte* row,
                                          std::string& rule) const {
  RawSurfel raw;
  raw.position = load(record, position_);
  if (has_nan(raw.position)) return Outcome::left_out;
  bool has_normal = normal_.has_value();
  if (has_normal) {
    raw.normal = load(record, *normal_);
    if (raw.normal == glm::dvec3(0) || (nan_is_no_normal_ && has_nan(raw.normal)))
      has_normal = false;
  }
  if (radius_) raw.radius = load_number(record + radius_->offset, radius_->type);
  if (radiance_) raw.radiance = load(record, *radiance_);
  if (emission_) raw.emission = load(record, *emission_);
  if (albedo_) {
    const glm::dvec3 stored = load(record, *albedo_);
    for (int i = 0; i < 3; ++i) {
      raw.albedo[i] = albedo_of(stored[i], curves_[static_cast<std::size_t>(i)]);
    }
  }
  rule = convert_surfel(raw, has_normal, surfel);
  if (!rule.empty()) return Outcome::refused;
  for (const Copy& copy : copies_) std::memcpy(row + copy.to, record + copy.from, copy.bytes);
  return Outcome::point;
}

}  // namespace ptc
