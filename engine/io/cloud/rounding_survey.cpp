// A sentence about rounding is for the user to act on, so it must be true of the points at hand,
// not only of the types. Each kind of number is checked against what the file will hold of it:
//
//   position   float        |p - float(p)|
//              LAS, known   how far (p - offset) / scale is from an integer
//              LAS, chosen  digits behind the point: steps are powers of ten
//   normal     PTC          does it survive two numbers of 16 bits
//   albedo     LAS          does it survive 16 bits on the sRGB curve
//   channel    narrower     does each number survive its type in the file
//
// Checks that can only fail once stop when they have failed, so that most points cost little.
#include "engine/io/cloud/rounding_survey.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include <glm/common.hpp>

#include "engine/io/cloud/las_plan.h"
#include "engine/io/cloud/packed_normal.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/image/srgb.h"

namespace ptc {
namespace {

constexpr double kDoubleNoise = 0x1p-50;  // of a coordinate, relative
constexpr float kFloatNoise = 0x1p-21F;   // of the components of a unit vector or a colour

// Powers of ten that doubles hold exactly, as far as Rounding::decimals goes.
constexpr std::array<double, kMostDecimals + 1> kTens{1,   1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                                      1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};

// Says whether a number is a decimal with so many digits behind the point, but for the last bits
// that a scale, such as that of an E57, leaves wrong.
bool is_decimal(double value, unsigned digits) {
  const double decimal = std::round(value * kTens[digits]) / kTens[digits];
  return std::abs(decimal - value) <= kDoubleNoise * std::abs(value);
}

// Returns the greatest e for which a finite number other than 0 is a multiple of 2^e.
int last_bit_of(double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value);
  const auto exponent = static_cast<int>(bits >> 52 & 0x7ff);
  const std::uint64_t fraction = bits & ((std::uint64_t{1} << 52) - 1);
  if (exponent == 0) return std::countr_zero(fraction) - 1074;
  return std::countr_zero(fraction | std::uint64_t{1} << 52) + exponent - 1075;
}

bool is_near(const glm::vec3& a, const glm::vec3& b) {
  for (int i = 0; i < 3; ++i) {
    if (!(std::abs(a[i] - b[i]) <= kFloatNoise)) return false;
  }
  return true;
}

// Says whether 16 bits on the sRGB curve hold a colour.
bool fits_words(const glm::vec3& albedo) {
  glm::vec3 back;
  for (int i = 0; i < 3; ++i) {
    const double stored = linear_to_srgb(std::clamp(static_cast<double>(albedo[i]), 0.0, 1.0));
    back[i] = static_cast<float>(srgb_to_linear(std::round(65535 * stored) / 65535));
  }
  return is_near(albedo, back);
}

// Says whether a floating-point type with fractions of `digits` bits holds an integer.
bool holds_integer(ChannelType type, const std::byte* at, int digits) {
  std::uint64_t magnitude = 0;
  if (type == ChannelType::u64) {
    magnitude = load<std::uint64_t>(at, 0);
  } else {
    const std::int64_t value = load_integer(type, at);
    magnitude =
        value < 0 ? 0 - static_cast<std::uint64_t>(value) : static_cast<std::uint64_t>(value);
  }
  return magnitude >> std::countr_zero(magnitude | 1ULL << 63) < std::uint64_t{1} << digits;
}

// Says whether a number survives.
bool survives(const Channel& channel, const std::byte* at, const Narrowing& into) {
  if (is_unknown(channel, at) && !into.type) return true;
  if (!into.type) return !(std::abs(meaning_of(channel, at).value_or(0)) > into.most);
  if (is_integer(*into.type)) {
    const double value = load_number(at, channel.type);
    return value >= std::numeric_limits<std::int32_t>::min() &&
           value <= std::numeric_limits<std::int32_t>::max();
  }
  if (is_integer(channel.type))
    return holds_integer(channel.type, at, *into.type == ChannelType::f32 ? 24 : 53);
  const double value = load_number(at, channel.type);
  return std::isnan(value) || static_cast<double>(static_cast<float>(value)) == value;
}

}  // namespace

RoundingSurvey::RoundingSurvey(OutputFormat format, const PointWriteInfo& info)
    : floats_(format != OutputFormat::las && format != OutputFormat::ply &&
              format != OutputFormat::xyz),
      decimals_(format == OutputFormat::las),
      normals_(format == OutputFormat::ptc && info.has_normals),
      albedos_(format == OutputFormat::las && info.has_albedo),
      colour_(info),
      row_bytes_(row_bytes(info.channels)) {
  if (format == OutputFormat::las) {
    const las::Head head = las::plan_head({.channels = {}, .text = info.text, .bounds = {}});
    if (!head.own_steps) steps_ = {head.scale, head.offset};
  }
  for (RowChannel& row : row_channels(info.channels, {})) {
    if (const std::optional<Narrowing> into = narrowing_of(format, row.channel))
      watched_.push_back({std::move(row), *into});
  }
}

void RoundingSurvey::add(std::span<const Surfel> surfels, std::span<const std::byte> rows) {
  const std::byte* row = rows.data();
  for (const Surfel& surfel : surfels) {
    add_position(surfel.position);
    rounding_.recoloured = rounding_.recoloured || colour_.is_recoloured(surfel, row);
    row += row_bytes_;
    if (normals_ && !rounding_.normals)
      rounding_.normals = !is_near(surfel.normal, unpack_normal(pack_normal(surfel.normal)));
    if (albedos_ && !rounding_.albedos) rounding_.albedos = !fits_words(surfel.albedo);
  }
  if (!watched_.empty()) add_rows(rows);
}

void RoundingSurvey::add_position(const glm::dvec3& position) {
  for (int i = 0; i < 3; ++i) {
    const double value = position[i];
    if (floats_) {
      const double moved = std::abs(value - static_cast<double>(static_cast<float>(value)));
      rounding_.float_error = std::max(rounding_.float_error, moved);
      if (value != 0) rounding_.last_bit = std::min(rounding_.last_bit, last_bit_of(value));
    }
    if (!decimals_) continue;
    while (rounding_.decimals <= kMostDecimals && !is_decimal(value, rounding_.decimals))
      ++rounding_.decimals;
    if (steps_) {
      const double steps = (value - steps_->offset[i]) / steps_->scale[i];
      rounding_.step_error = std::max(rounding_.step_error, std::abs(steps - std::round(steps)));
    }
  }
}

void RoundingSurvey::add_rows(std::span<const std::byte> rows) {
  std::erase_if(watched_, [&](const Watched& watched) {
    const Channel& channel = watched.row.channel;
    for (std::size_t at = 0; at < rows.size(); at += row_bytes_) {
      for (std::size_t i = 0; i < channel.components; ++i) {
        if (survives(channel, watched.row.at(rows.data() + at, i), watched.into)) continue;
        rounding_.channels.insert(channel.name);
        return true;
      }
    }
    return false;
  });
}

}  // namespace ptc
