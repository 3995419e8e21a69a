// Names of channels, and the usual attributes of scans by the names that programs give them.
#include "engine/io/cloud/channel_names.h"

#include <algorithm>
#include <array>
#include <utility>

#include "engine/io/cloud/formats.h"

namespace ptc {
namespace {

constexpr std::size_t kMaxNameBytes = 31;  // spec/points.md#schema

// An attribute that many programs write, each with a spelling of its own.
struct Usual {
  std::string_view bare;  // as bare_name() gives it
  std::string_view name;  // of the channel; empty when the name stays as the file has it
  ChannelRole role = ChannelRole::value;
  std::string_view unit = {};
};

constexpr std::array kUsual = std::to_array<Usual>({
    {"returnnumber", "return_number"},
    {"returnnum", "return_number"},
    {"numberofreturns", "number_of_returns"},
    {"numreturns", "number_of_returns"},
    {"scandirectionflag", "scan_direction"},
    {"edgeofflightline", "edge_of_flight_line"},
    {"edgeofflightlineflag", "edge_of_flight_line"},
    {"scanangle", "scan_angle"},
    {"scananglerank", "scan_angle"},
    {"userdata", "user_data"},
    {"pointsourceid", "point_source_id", ChannelRole::label},
    {"ptsrcid", "point_source_id", ChannelRole::label},
    {"gpstime", "gps_time", ChannelRole::time, "s"},
    {"classification", {}, ChannelRole::label},
    {"class", {}, ChannelRole::label},
    {"label", {}, ChannelRole::label},
    {"labels", {}, ChannelRole::label},
    {"segment", {}, ChannelRole::label},
    {"segmentid", {}, ChannelRole::label},
    {"segmentindex", {}, ChannelRole::label},
    {"objectid", {}, ChannelRole::label},
});

// Numbers of the surfel, by their names as bare_name() gives them and as PointLayout has them.
constexpr std::array kSurfel = std::to_array<std::pair<std::string_view, std::string_view>>({
    {"nx", "nx"},
    {"ny", "ny"},
    {"nz", "nz"},
    {"normalx", "nx"},
    {"normaly", "ny"},
    {"normalz", "nz"},
    {"radius", "radius"},
    {"radiancer", "radiance_r"},
    {"radianceg", "radiance_g"},
    {"radianceb", "radiance_b"},
    {"emissionr", "emission_r"},
    {"emissiong", "emission_g"},
    {"emissionb", "emission_b"},
    {"albedor", "albedo_r"},
    {"albedog", "albedo_g"},
    {"albedob", "albedo_b"},
});

bool is_letter_or_digit(char c) {
  return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
}

char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

}  // namespace

std::string bare_name(std::string_view name) {
  std::string bare;
  for (const char c : name) {
    if (is_letter_or_digit(lower(c))) bare += lower(c);
  }
  return bare;
}

std::string channel_name(std::string_view text, std::span<const Channel> others) {
  // Replace what a name may not have.
  std::string name;
  bool replaced = false;  // the last character of `name` stands for a run of others
  for (const char c : text) {
    const bool keep = is_letter_or_digit(lower(c)) || c == '_' || c == '.';
    if (keep || !replaced) name += keep ? lower(c) : '_';
    replaced = !keep;
  }
  if (name.empty()) name = "channel";
  name.resize(std::min(name.size(), kMaxNameBytes));

  // Number it when the name is taken.
  const auto taken = [&](const std::string& candidate) {
    return std::ranges::find(others, candidate, &Channel::name) != others.end();
  };
  std::string unique = name;
  for (std::size_t number = 2; taken(unique); ++number) {
    const std::string end = std::to_string(number);
    unique = name.substr(0, kMaxNameBytes - 1 - end.size());
    unique.append("_").append(end);
  }
  return unique;
}

std::optional<std::string_view> surfel_name(std::string_view name) {
  const std::string bare = bare_name(name);
  for (const auto& [spelling, known] : kSurfel) {
    if (bare == spelling) return known;
  }
  return std::nullopt;
}

void name_channel(Channel& channel, std::span<const Channel> others) {
  constexpr std::string_view kPrefix = "scalar_";
  std::string_view name = channel.name;
  if (name.starts_with(kPrefix) && name.size() > kPrefix.size()) name.remove_prefix(kPrefix.size());
  const auto* const usual = std::ranges::find(kUsual, bare_name(name), &Usual::bare);
  if (usual != kUsual.end()) {
    if (!usual->name.empty()) name = usual->name;
    if (channel.role == ChannelRole::value) channel.role = usual->role;
    if (channel.unit.empty()) channel.unit = usual->unit;
  }
  channel.name = channel_name(name, others);
}

}  // namespace ptc
