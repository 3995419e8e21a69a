// Chooses the writer of a format, and says what a format does not keep.
//
// A loss is known before the first point: it follows from the types of the channels, the bounds
// and the facts about the file. What types and bounds leave open was measured (RoundingSurvey), or
// a sentence about integers that may not fit says from which number on they do not.
#include "engine/io/cloud/point_writer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/cloud/checked_writer.h"
#include "engine/io/cloud/display_colour.h"
#include "engine/io/cloud/las_places.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/points.h"
#include "engine/io/cloud/rounding.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

struct Format {
  OutputFormat format;
  std::unique_ptr<PointWriter> (*create)(const std::filesystem::path&, const PointWriteInfo&);
  std::vector<std::string> (*losses)(const PointWriteInfo&);
  bool shows_colour;  ///< PointWriteInfo::colour_from may be given
};

const Format& entry_of(OutputFormat format) {
  static const std::array<Format, 8> kFormats{{
      {OutputFormat::bgeo, create_bgeo, bgeo_losses, true},
      {OutputFormat::las, create_las, las_losses, true},
      {OutputFormat::pcd, create_pcd, pcd_losses, true},
      {OutputFormat::ply, create_ply, ply_losses, true},
      {OutputFormat::ptc, create_ptc, ptc_losses, false},
      {OutputFormat::usda, create_usda, usd_losses, true},
      {OutputFormat::usdc, create_usdc, usd_losses, true},
      {OutputFormat::xyz, create_xyz, xyz_losses, false},
  }};
  return kFormats.at(static_cast<std::size_t>(format));
}

void check_colour(const Format& format, const PointWriteInfo& info) {
  if (info.colour_from.empty()) return;
  if (!format.shows_colour) {
    throw RequestError("colour_from",
                       "`colour_from` does not go with this format, which has no colour to show");
  }
  const auto is_wanted = [&](const Channel& channel) {
    return channel.name == info.colour_from && channel_bytes(channel.type) != 0 &&
           (channel.components == 1 || channel.components == 3);
  };
  if (std::ranges::none_of(info.channels, is_wanted)) {
    throw RequestError(
        "colour_from",
        "`colour_from` names no channel of one or three components: " + info.colour_from);
  }
}

// Returns the number of a type that `bits` stand for; "nan" for any NaN.
std::string number_text(ChannelType type, std::uint64_t bits) {
  std::byte raw[sizeof bits];
  std::memcpy(raw, &bits, sizeof bits);
  if (type == ChannelType::u64) return fmt::format("{}", bits);
  if (is_integer(type)) return fmt::format("{}", load_integer(type, raw));
  const double number = load_number(raw, type);
  return std::isnan(number) ? "nan" : fmt::format("{}", number);
}

// Says whether the colour that viewers show takes the place of the channel that stores it: in PLY
// and PCD, one of bytes; in BGEO and PTC, where it is of floats, any.
bool packs(OutputFormat format, const DisplayColour& colour) {
  if (colour.stored() == nullptr) return false;
  const bool has_bytes = format == OutputFormat::ply || format == OutputFormat::pcd;
  const bool has_floats = format == OutputFormat::bgeo || format == OutputFormat::ptc;
  return has_floats || (has_bytes && colour.stores_bytes());
}

}  // namespace

void CheckedWriter::write(std::span<const Surfel> surfels, std::span<const std::byte> rows) {
  if (rows.size() != surfels.size() * row_bytes_) {
    throw std::invalid_argument(fmt::format("PointWriter: {} bytes of attributes for {} points",
                                            rows.size(), surfels.size()));
  }
  const std::uint64_t left = announced_ - std::min(written_, announced_);
  const std::size_t fitting =
      static_cast<std::size_t>(std::min<std::uint64_t>(left, surfels.size()));
  for (std::size_t i = 0; i < fitting; ++i) put(surfels[i], rows.data() + i * row_bytes_);
  written_ += surfels.size();  // with points beyond the announced ones, finish() refuses the file
}

void CheckedWriter::finish() {
  if (written_ != announced_) {
    throw std::invalid_argument(
        fmt::format("PointWriter: {} points instead of {}", written_, announced_));
  }
  end();
}

std::unique_ptr<PointWriter> create_points(const std::filesystem::path& target, OutputFormat format,
                                           const PointWriteInfo& info) {
  check_colour_from(format, info);
  return entry_of(format).create(target, info);
}

void check_colour_from(OutputFormat format, const PointWriteInfo& info) {
  check_colour(entry_of(format), info);
}

std::vector<std::string> measured_channels(OutputFormat format, std::span<const Channel> channels) {
  std::vector<std::string> names;
  if (format == OutputFormat::pcd) {
    const auto counts = [&](std::string_view name) {
      const auto found = std::ranges::find(channels, name, &Channel::name);
      return found != channels.end() && found->components == 1 && is_integer(found->type) &&
             channel_bytes(found->type) != 0 && !is_scaled(*found);
    };
    if (counts("row") && counts("column")) names = {"row", "column"};
  }
  if (format != OutputFormat::las) return names;
  for (const Channel& channel : channels) {
    if (las::needs_range(channel)) names.push_back(channel.name);
  }
  return names;
}

std::vector<std::string> losses(OutputFormat format, const PointWriteInfo& info) {
  std::vector<std::string> sentences = entry_of(format).losses(info);
  const std::vector<std::string> unknown = unknown_losses(format, info);
  sentences.insert(sentences.end(), unknown.begin(), unknown.end());
  const DisplayColour colour(info);
  const bool may_differ =
      info.has_albedo && !colour.hides_albedo() && (!info.rounding || info.rounding->recoloured);
  if (may_differ && packs(format, colour)) {
    sentences.push_back(
        "Points whose albedo is not their stored colour keep the albedo alone: "
        "the channel " +
        colour.stored()->channel.name + " is left out.");
  }
  for (const Channel& channel : info.channels) {
    if (channel_bytes(channel.type) != 0) continue;
    sentences.push_back("The channel " + channel.name +
                        " is left out: its type is one of a later version.");
  }
  return sentences;
}

std::vector<std::string> unknown_losses(OutputFormat format, const PointWriteInfo& info) {
  if (format == OutputFormat::las) return las_unknown_losses(info);
  const DisplayColour colour(info);
  const bool packs_colour = packs(format, colour);
  std::vector<std::string> values, sentences;
  for (const Channel& channel : info.channels) {
    if (!channel.no_value || channel_bytes(channel.type) == 0) continue;
    if (format == OutputFormat::xyz && is_scaled(channel)) continue;  // NaN says so
    const bool packed = packs_colour && colour.stored()->channel.name == channel.name;
    if (packed || (format == OutputFormat::bgeo && is_linear_colour(channel))) {
      sentences.emplace_back(kAlbedoAsColour);
    } else if (const std::string value = number_text(channel.type, *channel.no_value);
               value != "nan") {
      values.push_back(channel.name + " " + value);
    }
  }
  if (!values.empty()) {
    sentences.push_back(fmt::format("The file does not say that these stand for \"not known\": {}.",
                                    fmt::join(values, ", ")));
  }
  return sentences;
}

std::vector<std::string> scaling_notes(OutputFormat format, const PointWriteInfo& info) {
  return format == OutputFormat::las ? las_scaling_notes(info) : std::vector<std::string>();
}

std::optional<OutputFormat> output_format(const std::filesystem::path& path) {
  using enum OutputFormat;
  constexpr std::array<std::pair<std::string_view, OutputFormat>, 11> kEndings{{
      {".bgeo", bgeo},
      {".las", las},
      {".pcd", pcd},
      {".ply", ply},
      {".ptc", ptc},
      {".usd", usdc},
      {".usda", usda},
      {".usdc", usdc},
      {".asc", xyz},
      {".txt", xyz},
      {".xyz", xyz},
  }};
  const std::string ending = lower_extension(path);
  if (ending == ".laz") {
    throw RequestError("target", "LAZ is read but not written: name a .las, which holds the same");
  }
  const auto* const found =
      std::ranges::find(kEndings, ending, &std::pair<std::string_view, OutputFormat>::first);
  if (found == kEndings.end()) return std::nullopt;
  return found->second;
}

void add_float_positions(std::vector<std::string>& losses, double error) {
  if (error == 0) return;
  losses.push_back(fmt::format("Positions are rounded to float, by up to {:.2g} units.", error));
}

void add_rounded_channels(std::vector<std::string>& losses, const PointWriteInfo& info,
                          int digits) {
  for (const Channel& channel : info.channels) {
    if (digits_of(channel.type) <= digits || !may_round(info, channel)) continue;
    if (channel.type == ChannelType::f64) {
      losses.push_back("The channel " + channel.name + " is rounded from double to float.");
    } else {
      losses.push_back(fmt::format("Integers of the channel {} are rounded from 2^{} on.",
                                   channel.name, digits));
    }
  }
}

void add_unscaled_channels(std::vector<std::string>& losses, const PointWriteInfo& info) {
  for (const Channel& channel : info.channels) {
    if (!is_scaled(channel)) continue;
    losses.push_back(
        fmt::format("The file does not say that a value v of the channel {} means {} v + {}.",
                    channel.name, channel.scale, channel.offset));
  }
}

void add_lost_crs(std::vector<std::string>& losses, const PointWriteInfo& info) {
  if (!info.text.contains("crs")) return;
  losses.emplace_back(kLostCrs);
}

}  // namespace ptc
