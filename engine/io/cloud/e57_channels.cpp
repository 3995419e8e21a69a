// Finds the channels of an E57 file. Each name of a field is looked up in the list of channels that
// the scans before it needed; its type there is widened until it holds the values of both:
//
//   integers of equal scale  -->  the smallest integer type of both ranges
//   single and single        -->  f32
//   anything else            -->  f64 of the numbers that the values stand for
#include "engine/io/cloud/e57_channels.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <string_view>

#include "engine/io/cloud/formats.h"

namespace ptc {
namespace {

// The value that stands for "not known" in channels of floats: a quiet NaN.
constexpr std::uint64_t kUnknownSingle = 0x7fc00000;
constexpr std::uint64_t kUnknownDouble = 0x7ff8000000000000;

// Fields whose validity another field states.
struct Flag {
  const char* field;
  const char* invalid;
};
constexpr std::array<Flag, 2> kFlags = {
    {{"intensity", "isIntensityInvalid"}, {"timeStamp", "isTimeStampInvalid"}}};

std::optional<std::size_t> find_number(const E57Scan& scan, const char* name) {
  const auto index = scan.find(name);
  if (!index || scan.fields[*index].type == E57Type::text) return std::nullopt;
  return index;
}

std::optional<E57Triple> find_triple(const E57Scan& scan, const std::array<const char*, 3>& names) {
  E57Triple triple{};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto index = find_number(scan, names[i]);
    if (!index) return std::nullopt;
    triple[i] = *index;
  }
  return triple;
}

// Returns the field that says where another one is invalid.
std::optional<std::size_t> find_flag(const E57Scan& scan, std::string_view field) {
  for (const Flag& flag : kFlags) {
    if (field == flag.field) return find_number(scan, flag.invalid);
  }
  return std::nullopt;
}

// Says whether a field is used up: it is part of the surfel, or states the validity of another.
bool is_taken(const E57Scan& scan, const E57Roles& roles, std::size_t field) {
  const auto in = [&](const E57Triple& triple) {
    return std::ranges::find(triple, field) != triple.end();
  };
  if (in(roles.position) || roles.invalid == field) return true;
  if ((roles.normal && in(*roles.normal)) || (roles.colour && in(*roles.colour))) return true;
  return std::ranges::any_of(kFlags, [&](const Flag& flag) {
    return scan.fields[field].name == flag.invalid && find_number(scan, flag.field);
  });
}

// Returns words of small letters that underscores separate: "isColorInvalid" is "is_color_invalid".
std::string snake_case(std::string_view name) {
  std::string words;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const bool capital = name[i] >= 'A' && name[i] <= 'Z';
    if (capital && i > 0 && name[i - 1] >= 'a' && name[i - 1] <= 'z') words += '_';
    words += name[i];
  }
  return words;
}

// Sets name, role and unit of the channel of a field.
void name_after_field(const std::string& field, Channel& channel, std::span<const Channel> others) {
  // Fields that other formats have too, under their common names. Returns are counted from 0 in E57
  // and from 1 elsewhere.
  struct Common {
    std::string_view field;
    std::string_view name;
    ChannelRole role;
    std::string_view unit;
    double add;
  };
  constexpr std::array<Common, 9> kCommon = {{
      {"rowIndex", "row", ChannelRole::label, "", 0},
      {"columnIndex", "column", ChannelRole::label, "", 0},
      {"returnIndex", "return_number", ChannelRole::label, "", 1},
      {"returnCount", "number_of_returns", ChannelRole::label, "", 0},
      {"timeStamp", "time_stamp", ChannelRole::time, "s", 0},
      {"classification", "classification", ChannelRole::label, "", 0},
      {"isColorInvalid", "is_color_invalid", ChannelRole::label, "", 0},
      {"cartesianInvalidState", "cartesian_invalid_state", ChannelRole::label, "", 0},
      {"sphericalInvalidState", "spherical_invalid_state", ChannelRole::label, "", 0},
  }};
  const auto* const common = std::ranges::find(kCommon, field, &Common::field);
  if (common == kCommon.end()) {
    channel.name = channel_name(snake_case(field), others);
    return;
  }
  channel.name = channel_name(common->name, others);
  channel.role = common->role;
  channel.unit = common->unit;
  channel.offset += common->add;
}

// Sets the smallest integer type that holds [low, high] and, for `unknown`, one value more.
void choose_integer(std::int64_t low, std::int64_t high, bool unknown, Channel& channel) {
  using Type = ChannelType;
  constexpr std::array<std::array<Type, 2>, 4> kTypes = {{{Type::u8, Type::i8},
                                                          {Type::u16, Type::i16},
                                                          {Type::u32, Type::i32},
                                                          {Type::u64, Type::i64}}};
  for (std::size_t i = 0; i < kTypes.size(); ++i) {
    const unsigned bits = 8U << i;
    const std::uint64_t ones = ~std::uint64_t{0} >> (64 - bits);
    const auto most = static_cast<std::int64_t>(ones >> 1);
    std::uint64_t none = ones;
    if (low >= 0) {
      channel.type = kTypes[i][0];
      if (static_cast<std::uint64_t>(high) > ones - (unknown ? 1 : 0)) continue;
    } else {
      channel.type = kTypes[i][1];
      none = (ones >> 1) + 1;  // -2^(bits - 1)
      // The widest type is taken for any range: nothing could be wider.
      if (bits < 64 && (high > most || low < -most - (unknown ? 0 : 1))) continue;
    }
    if (unknown) channel.no_value = none;
    return;
  }
}

// Returns the value of full colour for a field without limits.
double assumed_full(const E57Field& field) {
  double most = 1;
  if (field.is_integer()) {
    // A field without a stated maximum has this one.
    if (field.maximum == std::numeric_limits<std::int64_t>::max()) return 255;
    most = std::max(field.real(static_cast<std::uint64_t>(field.minimum)),
                    field.real(static_cast<std::uint64_t>(field.maximum)));
    if (field.type == E57Type::integer && most > 255 &&
        std::has_single_bit(static_cast<std::uint64_t>(field.maximum) + 1)) {
      return most;
    }
  } else if (field.range) {
    most = (*field.range)[1];
    if (most > 65535) return 1;  // the range of the type, which says nothing
  }
  if (most <= 1 && field.type != E57Type::integer) return 1;
  return most <= 255 ? 255 : std::max(most, 65535.0);
}

}  // namespace

std::optional<E57Roles> find_e57_roles(const E57Scan& scan) {
  E57Roles roles;
  if (const auto xyz = find_triple(scan, {"cartesianX", "cartesianY", "cartesianZ"})) {
    roles.position = *xyz;
    roles.invalid = find_number(scan, "cartesianInvalidState");
  } else if (const auto polar =
                 find_triple(scan, {"sphericalRange", "sphericalAzimuth", "sphericalElevation"})) {
    roles.position = *polar;
    roles.spherical = true;
    roles.invalid = find_number(scan, "sphericalInvalidState");
  } else {
    return std::nullopt;
  }
  roles.normal = find_triple(scan, {"nor:normalX", "nor:normalY", "nor:normalZ"});
  roles.colour = find_triple(scan, {"colorRed", "colorGreen", "colorBlue"});
  if (roles.colour) roles.no_colour = find_number(scan, "isColorInvalid");
  return roles;
}

std::array<E57Limits, 3> e57_colour_limits(const E57Scan& scan, const E57Triple& colour) {
  if (scan.colour_limits) return *scan.colour_limits;
  double full = 0;
  for (const std::size_t field : colour) full = std::max(full, assumed_full(scan.fields[field]));
  return {{{0, full}, {0, full}, {0, full}}};
}

void E57Channels::Union::add(const E57Field& field) {
  // The kind of the field alone.
  const Kind own = field.is_integer()               ? Kind::integer
                   : field.type == E57Type::float32 ? Kind::single
                                                    : Kind::real;
  // The kind of both.
  if (kind == Kind::none) {
    kind = own;
    low = field.minimum;
    high = field.maximum;
    scale = field.scale;
    offset = field.offset;
  } else if (kind != own || scale != field.scale || offset != field.offset) {
    kind = Kind::real;
  }
  low = std::min(low, field.minimum);
  high = std::max(high, field.maximum);
}

void E57Channels::Union::describe(Channel& channel, bool unknown) const {
  switch (kind) {
    case Kind::integer:
      choose_integer(low, high, unknown, channel);
      channel.scale = scale;
      channel.offset = offset;
      return;
    case Kind::single:
      channel.type = ChannelType::f32;
      if (unknown) channel.no_value = kUnknownSingle;
      return;
    case Kind::none:
    case Kind::real:
      break;
  }
  channel.type = ChannelType::f64;
  if (unknown) channel.no_value = kUnknownDouble;
}

E57Channels::E57Channels(const E57Document& document, const E57Pages& pages) {
  several_ = document.scans.size() > 1;
  if (several_) {
    Channel scan;
    scan.name = "scan";
    scan.type = ChannelType::u16;
    scan.role = ChannelRole::label;
    channels_.push_back(scan);
  }
  gather(document, pages);
  if (colours_.scans > 0) add_colours(document);
  add_fields();
  if (text_) notes_.emplace_back("Fields of points that hold text are not read.");
}

void E57Channels::gather(const E57Document& document, const E57Pages& pages) {
  for (std::size_t i = 0; i < document.scans.size(); ++i) {
    const E57Scan& scan = document.scans[i];
    if (scan.records == 0) continue;
    const auto roles = find_e57_roles(scan);
    if (!roles) {
      pages.fail_at(pages.xml_offset(), "scan " + std::to_string(i) +
                                            " has neither Cartesian nor spherical coordinates");
    }
    ++scans_;
    if (roles->colour) {
      for (const std::size_t field : *roles->colour) colours_.add(scan.fields[field]);
      ++colours_.scans;
    }
    gather_scan(scan, *roles, pages);
  }
}

void E57Channels::gather_scan(const E57Scan& scan, const E57Roles& roles, const E57Pages& pages) {
  for (std::size_t i = 0; i < scan.fields.size(); ++i) {
    const E57Field& field = scan.fields[i];
    if (field.type == E57Type::text) {
      text_ = true;
      continue;
    }
    if (is_taken(scan, roles, i)) continue;
    auto named = std::ranges::find(fields_, field.name, &Named::field);
    if (named == fields_.end()) {
      if (fields_.size() == kMaxChannels - 2) {  // beside scan and rgb
        pages.fail_at(pages.xml_offset(), "the scans have more than 254 different fields");
      }
      named = fields_.insert(fields_.end(), {field.name, {}});
    }
    named->type.add(field);
    ++named->type.scans;
    if (find_flag(scan, field.name)) named->type.flagged = true;
  }
}

void E57Channels::add_colours(const E57Document& document) {
  Channel numbers{.name = "rgb", .components = 3};
  colours_.describe(numbers, false);

  // Find the limits of colours that hold for all scans.
  std::optional<E57Limits> common;  // at least one scan has colours
  bool differ = false;
  bool assumed = false;
  for (const E57Scan& scan : document.scans) {
    const auto roles = scan.records > 0 ? find_e57_roles(scan) : std::nullopt;
    if (!roles || !roles->colour) continue;
    assumed = assumed || !scan.colour_limits;
    for (const E57Limits& limits : e57_colour_limits(scan, *roles->colour)) {
      if (!common) common = limits;
      differ = differ || limits.low != common->low || limits.high != common->high;
    }
  }

  // Let the limits mean 0 and 1. Numbers of 8 and 16 bits that end at the most of their type need
  // no scale, and all others of unsigned types do: without one they would mean just that.
  Channel colour = numbers;
  colour.role = ChannelRole::colour;
  colour.colour_space = ColourSpace::srgb;
  const double most = numbers.type == ChannelType::u8    ? 255
                      : numbers.type == ChannelType::u16 ? 65535
                                                         : 0;
  const bool is_plain = numbers.scale == 1 && numbers.offset == 0;
  const bool fills_type = is_plain && common->low == 0 && common->high == most;
  if (!fills_type) {
    const double range = common->high - common->low;
    colour.scale = numbers.scale / range;
    colour.offset = (numbers.offset - common->low) / range;
    const bool is_unsigned = colours_.kind == Union::Kind::integer && colours_.low >= 0;
    differ = differ || (is_unsigned && colour.scale == 1 && colour.offset == 0) ||
             colour.scale == 0 || !std::isfinite(colour.scale) || !std::isfinite(colour.offset);
  }
  if (differ) notes_.emplace_back("Channel rgb has the numbers of the file without their limits.");
  if (assumed) {
    notes_.emplace_back(
        "Colours without limits are taken to begin at 0 and to end at 1 or 2^n - 1.");
  }
  if (colours_.scans < scans_) {
    notes_.emplace_back("Channel rgb is 0 where a scan has no colours.");
  }
  channels_.push_back(differ ? std::move(numbers) : std::move(colour));
}

void E57Channels::add_fields() {
  for (Named& named : fields_) {
    Channel channel;
    const bool missing = named.type.scans < scans_;
    if (named.field == "timeStamp" && named.type.kind == Union::Kind::single) {
      named.type.kind = Union::Kind::real;
    }
    named.type.describe(channel, missing || named.type.flagged);
    name_after_field(named.field, channel, channels_);
    if (missing) {
      notes_.push_back("Channel " + channel.name + " is not known where a scan has no " +
                       named.field.substr(0, 64) + ".");
    }
    if (named.field == "timeStamp" && scans_ > 1) {
      notes_.push_back("Channel " + channel.name + " counts from the start of each scan.");
    }
    channels_.push_back(std::move(channel));
  }
}

std::vector<E57Cell> E57Channels::cells(const E57Document& document, std::size_t scan_index) const {
  const E57Scan& scan = document.scans[scan_index];
  std::vector<E57Cell> cells;
  const auto add = [&](const Channel& channel, std::optional<std::size_t> field, bool as_real) {
    E57Cell& cell = cells.emplace_back();
    cell.field = field;
    cell.otherwise = channel.no_value.value_or(0);
    cell.as_real = as_real;
    cell.bytes = static_cast<std::uint8_t>(channel_bytes(channel.type));
  };
  const Channel* channel = channels_.data();
  if (several_) {
    add(*channel++, std::nullopt, false);
    cells.back().otherwise = scan_index;
  }
  if (colours_.scans > 0) {
    const auto colour = find_triple(scan, {"colorRed", "colorGreen", "colorBlue"});
    for (std::size_t i = 0; i < 3; ++i) {
      add(*channel, colour ? std::optional((*colour)[i]) : std::nullopt,
          colours_.kind == Union::Kind::real);
    }
    ++channel;
  }
  for (const Named& named : fields_) {
    add(*channel++, find_number(scan, named.field.c_str()), named.type.kind == Union::Kind::real);
    cells.back().invalid = find_flag(scan, named.field);
  }
  return cells;
}

}  // namespace ptc
