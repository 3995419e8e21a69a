// The standard places of a LAS point record, and the channels that fill them.
//
// A channel whose every value fits its place by the type alone needs no look at the values. Others
// are measured first: a classification that came as floats fits when all of them are integers up to
// 255. Intensities have no unit that formats agree on, so they are scaled by what was measured:
//
//   integers in [0, 65535]      as they are
//   [0, 1]                      65535 v            PTX, E57
//   [-2048, 2047]               16 (v + 2048)      PTS
//   other numbers to 65535      rounded
//   anything else               65535 (v - low) / (high - low)
#include "engine/io/cloud/las_places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "engine/io/cloud/packed_number.h"

namespace ptc::las {
namespace {

constexpr double kDegreesOfStep = 0.006;  // of scan angles
constexpr double kMostWord = 65535;

struct Place {
  std::string_view name;
  Field field;
  std::vector<ChannelType> types;  // those whose values fit; all fit a time
  double low;
  double high;
};

const std::vector<Place>& places() {
  using enum ChannelType;
  constexpr double kEndless = std::numeric_limits<double>::infinity();
  static const std::vector<Place> kPlaces{
      {"intensity", Field::intensity, {u8, u16}, 0, kMostWord},
      {"return_number", Field::return_number, {u8}, 0, 15},
      {"number_of_returns", Field::number_of_returns, {u8}, 0, 15},
      {"class_flags", Field::class_flags, {u8}, 0, 15},
      {"scanner_channel", Field::scanner_channel, {u8}, 0, 3},
      {"scan_direction", Field::scan_direction, {u8}, 0, 1},
      {"edge_of_flight_line", Field::edge_of_flight_line, {u8}, 0, 1},
      {"classification", Field::classification, {u8}, 0, 255},
      {"user_data", Field::user_data, {u8}, 0, 255},
      {"scan_angle", Field::scan_angle, {i8, i16}, -32768, 32767},
      {"point_source_id", Field::point_source_id, {u8, u16}, 0, kMostWord},
      {"gps_time", Field::gps_time, {}, -kEndless, kEndless},
      {"nir", Field::nir, {u8, u16}, 0, kMostWord},
  };
  return kPlaces;
}

const Place* find_place(const Channel& channel) {
  const auto found = std::ranges::find(places(), channel.name, &Place::name);
  const bool known = channel.components == 1 && channel_bytes(channel.type) != 0;
  return known && found != places().end() ? &*found : nullptr;
}

// Says whether 16 bits hold an angle as LAS does: in steps, which some formats cannot say.
bool holds_steps(const Channel& channel) {
  return channel.type == ChannelType::i16 && channel.offset == 0 &&
         (channel.scale == kDegreesOfStep || channel.scale == 1);
}

// Says whether every value of a channel's type fits a place.
bool fits_by_type(const Place& place, const Channel& channel) {
  if (place.field == Field::gps_time) return true;
  if (std::ranges::find(place.types, channel.type) == place.types.end()) return false;
  if (place.field == Field::scan_angle && channel.type == ChannelType::i16)
    return holds_steps(channel);
  // Returns that are counted from 0, as in E57, have an offset of 1.
  const bool counts_returns = place.field == Field::return_number && channel.offset == 1;
  return channel.scale == 1 && (channel.offset == 0 || counts_returns);
}

// Applies v -> v factor + shift after what the placed channel does already.
void append(PlacedChannel& placed, double factor, double shift) {
  placed.factor *= factor;
  placed.shift = placed.shift * factor + shift;
}

void scale_intensity(PlacedChannel& placed, const ValueRange& range) {
  const std::string subject = fmt::format("Values of the channel {}, from {:.6g} to {:.6g},",
                                          placed.channel.channel.name, range.low, range.high);
  const std::string_view rounded = range.whole ? "" : " and are rounded";
  if (range.low >= 0 && range.high <= kMostWord && range.whole) return;
  if (range.low >= 0 && range.high <= 1) {
    append(placed, kMostWord, 0);
    placed.loss = subject + " are multiplied by 65535 and are rounded.";
  } else if (range.low >= 0 && range.high <= kMostWord) {
    placed.loss = subject + " are rounded to integers.";
  } else if (range.low >= -2048 && range.high <= 2047) {
    append(placed, 16, 16 * 2048);
    placed.loss = fmt::format("{} become 16 (v + 2048){}.", subject, rounded);
    placed.by_values = true;
  } else {
    const double side = range.high - range.low;
    const double factor = side > 0 && std::isfinite(side) ? kMostWord / side : 0;
    append(placed, factor, factor == 0 ? 0 : -range.low * factor);
    placed.loss = subject + " are spread over 0 to 65535 and are rounded.";
    placed.by_values = true;
  }
}

// Fits a channel by its measured values. @return false when they do not fit
bool fit_range(PlacedChannel& placed, const ValueRange& range) {
  if (range.low > range.high) return true;  // no point has a value
  if (placed.field == Field::intensity) {
    scale_intensity(placed, range);
    return true;
  }
  if (placed.field != Field::scan_angle)
    return range.whole && range.low >= placed.low && range.high <= placed.high;
  if (range.low < -180 || range.high > 180) return false;
  append(placed, 1 / kDegreesOfStep, 0);
  placed.loss = "Values of the channel " + placed.channel.channel.name +
                " are rounded to steps of 0.006 degrees.";
  return true;
}

}  // namespace

double PlacedChannel::value(const std::byte* row) const noexcept {
  const Channel& of = channel.channel;
  const std::byte* const at = channel.at(row, 0);
  const double value = load_number(at, of.type) * factor + shift;
  if (field == Field::gps_time) return value;
  return std::isnan(value) ? 0 : std::clamp(std::round(value), low, high);
}

std::vector<std::string_view> place_names() {
  std::vector<std::string_view> names;
  for (const Place& place : places()) names.push_back(place.name);
  return names;
}

bool needs_range(const Channel& channel) {
  const Place* const place = find_place(channel);
  return place != nullptr && !fits_by_type(*place, channel);
}

std::optional<double> cut_above(const Channel& channel) {
  const Place* const place = find_place(channel);
  const bool cuts = place != nullptr && place->high <= 15 && fits_by_type(*place, channel);
  return cuts ? std::optional(place->high) : std::nullopt;
}

std::optional<PlacedChannel> place_channel(const RowChannel& row,
                                           const std::map<std::string, ValueRange>& ranges) {
  const Channel& channel = row.channel;
  const Place* const place = find_place(channel);
  if (place == nullptr) return std::nullopt;
  PlacedChannel placed{.field = place->field,
                       .channel = row,
                       .factor = channel.scale,
                       .shift = channel.offset,
                       .low = place->low,
                       .high = place->high,
                       .loss = {}};
  if (!fits_by_type(*place, channel)) {
    const auto range = ranges.find(channel.name);
    if (range == ranges.end() || !fit_range(placed, range->second)) return std::nullopt;
    return placed;
  }
  if (place->field == Field::scan_angle && channel.type == ChannelType::i16) {
    placed.factor = 1;
    if (channel.scale == 1)
      placed.loss = "Integers of the channel scan_angle are taken as steps of 0.006 degrees.";
  } else if (place->field == Field::scan_angle) {
    append(placed, 1 / kDegreesOfStep, 0);
  } else if (place->field == Field::nir && channel.type == ChannelType::u8) {
    append(placed, 257, 0);
  } else if (place->field == Field::gps_time &&
             (channel.type == ChannelType::u64 || channel.type == ChannelType::i64)) {
    placed.loss = "Integers of the channel gps_time are rounded from 2^53 on.";
  }
  return placed;
}

std::string misfit(const RowChannel& row, const std::map<std::string, ValueRange>& ranges) {
  const Place* const place = find_place(row.channel);
  if (place == nullptr || !ranges.contains(row.channel.name)) return {};
  const std::string held = place->field == Field::scan_angle
                               ? "degrees from -180 to 180"
                               : fmt::format("integers from {} to {}", place->low, place->high);
  return fmt::format(
      "The channel {} goes to the extra bytes {}, because the field of LAS holds {} alone.",
      row.channel.name, row.name, held);
}

}  // namespace ptc::las
