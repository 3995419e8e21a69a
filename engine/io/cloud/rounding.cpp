#include "engine/io/cloud/rounding.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/io/cloud/las_places.h"
#include "engine/io/cloud/point_rows.h"

namespace ptc {

int digits_of(ChannelType type) noexcept {
  switch (type) {
    case ChannelType::u32:
    case ChannelType::i32:
      return 32;
    case ChannelType::u64:
    case ChannelType::i64:
      return 64;
    case ChannelType::f64:
      return 53;
    default:
      return 24;  // every value is a float
  }
}

std::optional<Narrowing> narrowing_of(OutputFormat format, const Channel& channel) {
  using enum ChannelType;
  const ChannelType type = channel.type;
  const bool is_long = type == u64 || type == i64;
  switch (format) {
    case OutputFormat::ptc:
      if (digits_of(type) > 24) return Narrowing{.type = f32};
      break;
    case OutputFormat::bgeo:
      if (type == f64) return Narrowing{.type = f32};
      if (type == u32 || is_long) return Narrowing{.type = i32};
      break;
    case OutputFormat::pcd:
    case OutputFormat::ply:
      if (is_long) return Narrowing{.type = f64};
      break;
    case OutputFormat::xyz:
      // A step of an integer is more than one of the 15th digit
      if (is_long && is_scaled(channel)) return Narrowing{.most = 4e14 * std::abs(channel.scale)};
      break;
    case OutputFormat::las:
      if (const auto most = las::cut_above(channel)) return Narrowing{.most = *most};
      if (is_long && channel.name == "gps_time" && channel.components == 1)
        return Narrowing{.type = f64};
      break;
    default:
      break;
  }
  return std::nullopt;
}

bool may_round(const PointWriteInfo& info, const Channel& channel) {
  return !info.rounding || info.rounding->channels.contains(channel.name);
}

double float_error(const Bounds& bounds) noexcept {
  if (bounds.empty()) return 0;
  double most = 0;
  for (int i = 0; i < 3; ++i) {
    most = std::max({most, std::abs(bounds.low[i]), std::abs(bounds.high[i])});
  }
  if (most == 0) return 0;
  if (most > static_cast<double>(std::numeric_limits<float>::max())) return most;
  return std::ldexp(0.5, std::ilogb(most) - 23);  // half of the last place
}

double float_error(const PointWriteInfo& info) noexcept {
  return info.rounding ? info.rounding->float_error : float_error(info.bounds);
}

double least_spacing(const PointWriteInfo& info) noexcept {
  if (info.bounds.empty() || info.count == 0) return 0;
  const glm::dvec3 sides = info.bounds.high - info.bounds.low;
  return std::max({sides.x, sides.y, sides.z}) / std::sqrt(static_cast<double>(info.count));
}

}  // namespace ptc
