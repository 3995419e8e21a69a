#include "engine/io/cloud/point_survey.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "engine/io/cloud/packed_number.h"

namespace ptc {

PointSurvey::PointSurvey(OutputFormat format, std::span<const Channel> channels)
    : row_bytes_(row_bytes(channels)) {
  const std::vector<std::string> names = measured_channels(format, channels);
  for (RowChannel& row : row_channels(channels, {})) {
    if (std::ranges::find(names, row.channel.name) != names.end())
      measured_.push_back({std::move(row), {}});
  }
}

void PointSurvey::add(std::span<const std::byte> rows) noexcept {
  for (auto& [row, range] : measured_) {
    const Channel& channel = row.channel;
    for (std::size_t at = 0; at < rows.size(); at += row_bytes_) {
      const std::byte* const stored = row.at(rows.data() + at, 0);
      const std::size_t bytes = channel.component_bytes();
      if (channel.no_value && std::memcmp(stored, &*channel.no_value, bytes) == 0) continue;
      const double value = load_number(stored, channel.type) * channel.scale + channel.offset;
      if (!std::isfinite(value)) continue;
      range.low = std::min(range.low, value);
      range.high = std::max(range.high, value);
      range.whole = range.whole && value == std::trunc(value);
    }
  }
}

void PointSurvey::finish(PointWriteInfo& info) const {
  for (const Measured& measured : measured_)
    info.ranges[measured.channel.channel.name] = measured.range;
}

}  // namespace ptc
