// Decides where the values of a point go in its LAS record.
//
//   | X Y Z intensity returns ... GPS time | red green blue | NIR | extra bytes ...     |
//   |<------- point format 6 ------------->|                |     | what LAS does not know
//   |<------- point format 7 ------------------------------>|     |
//   |<------- point format 8 ------------------------------------>|
//
// A channel fills a standard place when it has the name and its values fit there (las_places.cpp).
// All other channels, and the quantities of a surfel, become extra bytes, of which one record for
// each number tells name, type and scale:
//
//   reserved u16 | type u8 | options u8 | name 32 | unused 4 | no data 3 x 8 | min 3 x 8 |
//   max 3 x 8 | scale f64 x 3 | offset f64 x 3 | description 32             192 bytes in all
#include <algorithm>
#include <bit>
#include <cstring>
#include <set>
#include <span>

#include "engine/io/cloud/channel_names.h"
#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/las_plan.h"
#include "engine/io/cloud/packed_number.h"

namespace ptc::las {
namespace {

constexpr std::size_t kMostNameBytes = 32;

// Names that readers have for the standard places; extra bytes of the same name would hide them.
std::set<std::string> standard_names() {
  std::set<std::string> names{"x",
                              "y",
                              "z",
                              "red",
                              "green",
                              "blue",
                              "synthetic",
                              "key_point",
                              "withheld",
                              "overlap",
                              "bit_fields",
                              "scan_direction_flag",
                              "scan_angle_rank",
                              "raw_classification",
                              "classification_flags"};
  for (const std::string_view name : place_names()) names.emplace(name);
  return names;
}

Extra surfel_extra(ExtraSource source, const char* name, std::uint8_t components, const char* unit,
                   std::set<std::string>& taken) {
  Extra extra{.source = source, .channel = {}};
  extra.channel.channel = {
      .name = name, .type = ChannelType::f32, .components = components, .unit = unit};
  extra.channel.name = name;
  extra.channel.parts = part_names(name, components, source == ExtraSource::normal);
  taken.insert(name);
  taken.insert(extra.channel.parts.begin(), extra.channel.parts.end());
  return extra;
}

// Returns the number that the standard has for a type of extra bytes.
std::uint8_t type_number(ChannelType type) {
  using enum ChannelType;
  constexpr ChannelType kTypes[] = {u8, i8, u16, i16, u32, i32, u64, i64, f32, f64};
  return static_cast<std::uint8_t>(1 + (std::ranges::find(kTypes, extra_type(type)) - kTypes));
}

// Returns the bits of "no data" as the standard widens them: integers to 64 bits with or without a
// sign, floats to double.
std::uint64_t widened(ChannelType type, std::uint64_t bits) {
  std::byte raw[8];
  std::memcpy(raw, &bits, sizeof raw);
  if (type == ChannelType::u64) return bits;
  if (!is_integer(type)) return std::bit_cast<std::uint64_t>(load_number(raw, type));
  return static_cast<std::uint64_t>(load_integer(type, raw));
}

void append_padded(std::vector<std::byte>& bytes, std::string_view text, std::size_t size) {
  const auto raw = std::as_bytes(std::span(text.substr(0, size)));
  bytes.insert(bytes.end(), raw.begin(), raw.end());
  bytes.resize(bytes.size() + size - raw.size());
}

void append_extra_record(std::vector<std::byte>& bytes, const Channel& channel,
                         const std::string& name, const std::string& description) {
  const bool scaled = channel.scale != 1 || channel.offset != 0;
  const unsigned options = (channel.no_value ? 1U : 0U) | (scaled ? 8U | 16U : 0U);
  append_value(bytes, std::uint16_t{0});
  append_value(bytes, type_number(channel.type));
  append_value(bytes, static_cast<std::uint8_t>(options));
  append_padded(bytes, name, kMostNameBytes);
  append_padded(bytes, "", 4);
  append_value(bytes,
               channel.no_value ? widened(channel.type, *channel.no_value) : std::uint64_t{0});
  append_padded(bytes, "", 16 + 24 + 24);
  append_value(bytes, scaled ? channel.scale : 0.0);
  append_padded(bytes, "", 16);
  append_value(bytes, channel.offset);
  append_padded(bytes, "", 16);
  append_padded(bytes, description.empty() ? channel.unit : description, 32);
}

// Returns the name that LasName has for a component of a quantity of the surfel.
std::string name_in_surfel(const Extra& extra, std::size_t component) {
  return std::string(surfel_name(extra.channel.parts[component]).value_or(""));
}

// Gives extra bytes the names and descriptions that they have in the LAS file that they came from,
// unless a name is taken.
class OriginalNames {
 public:
  OriginalNames(const PointWriteInfo& info, const std::vector<Extra>& extras)
      : names_(original_names(info)), taken_(standard_names()) {
    for (const Extra& extra : extras)
      taken_.insert(extra.channel.parts.begin(), extra.channel.parts.end());
  }

  void restore(Extra& extra) {
    std::vector<std::string>& parts = extra.channel.parts;
    extra.descriptions.resize(parts.size());
    if (extra.source != ExtraSource::channel) {
      for (std::size_t i = 0; i < parts.size(); ++i) {
        const LasName* const was = find(name_in_surfel(extra, i));
        if (was == nullptr) continue;
        extra.descriptions[i] = was->description;
        take({&parts[i], 1}, {was->name});
      }
      return;
    }
    const Channel& channel = extra.channel.channel;
    const LasName* const was = find(channel.name);
    if (was == nullptr) return;
    std::ranges::fill(extra.descriptions, was->description);
    take(parts, part_names(was->name, channel.components, has_axes(channel)));
  }

 private:
  [[nodiscard]] const LasName* find(const std::string& channel) const {
    const auto found = std::ranges::find(names_, channel, &LasName::channel);
    return found == names_.end() ? nullptr : &*found;
  }
  // Replaces names, if all others are free and short enough.
  void take(std::span<std::string> names, const std::vector<std::string>& by) {
    const auto is_free = [&](const std::string& name) {
      return name.size() <= kMostNameBytes && !taken_.contains(name);
    };
    if (!std::ranges::all_of(by, is_free)) return;
    std::ranges::copy(by, names.begin());
    taken_.insert(by.begin(), by.end());
  }

  std::vector<LasName> names_;
  std::set<std::string> taken_;
};

}  // namespace

ChannelType extra_type(ChannelType type) noexcept {
  return type == ChannelType::half ? ChannelType::f32 : type;
}

Layout::Layout(const PointWriteInfo& info) : colour(info) {
  // Make the quantities of a surfel extra bytes
  std::set<std::string> taken = standard_names();
  const auto add = [&](bool wanted, ExtraSource source, const char* name, std::uint8_t numbers,
                       const char* unit) {
    if (wanted) extras.push_back(surfel_extra(source, name, numbers, unit, taken));
  };
  add(info.has_normals, ExtraSource::normal, "normal", 3, "1");
  add(info.has_radius, ExtraSource::radius, "radius", 1, "");
  add(info.has_radiance, ExtraSource::radiance, "radiance", 3, "W/(m^2 sr)");
  add(info.emits, ExtraSource::emission, "emission", 3, "W/(m^2 sr)");
  add(info.has_albedo && colour.hides_albedo(), ExtraSource::albedo, "albedo", 3, "1");

  // Give the channels their places
  bool has_nir = false;
  for (const RowChannel& row : row_channels(info.channels, taken, kMostNameBytes)) {
    if (auto placed = place_channel(row, info.ranges)) {
      has_nir |= placed->field == Field::nir;
      fields.push_back(*std::move(placed));
    } else if (colour.stored() == nullptr || colour.stored()->offset != row.offset) {
      extras.push_back({ExtraSource::channel, row});
      if (std::string sentence = misfit(row, info.ranges); !sentence.empty())
        misfits.push_back(std::move(sentence));
    }
  }

  OriginalNames names(info, extras);
  for (Extra& extra : extras) names.restore(extra);

  // Choose the point format
  if (has_nir) {
    point_format = 8;
    standard_bytes = 38;
  } else if (colour.exists()) {
    point_format = 7;
    standard_bytes = 36;
  }
  record_bytes = standard_bytes;
  for (const Extra& extra : extras) {
    const Channel& channel = extra.channel.channel;
    extra_numbers += channel.components;
    record_bytes += channel.components * channel_bytes(extra_type(channel.type));
  }
}

std::string Layout::extra_records() const {
  std::vector<std::byte> bytes;
  for (const Extra& extra : extras) {
    for (std::size_t i = 0; i < extra.channel.parts.size(); ++i)
      append_extra_record(bytes, extra.channel.channel, extra.channel.parts[i],
                          extra.descriptions[i]);
  }
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace ptc::las
