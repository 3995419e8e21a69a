// Decoding of the core of points of formats 0 to 5 (item POINT10, version 2).
//
// A symbol of six bits says which of returns, intensity, classification, scan angle, user data and
// source differ from those of the last point. x, y and z follow for every point: x and y by the
// median of recent steps, z by the last height. Returns of one pulse alternate between canopy and
// ground, so the predictions are kept apart for each kind of return, that is, for return r of n.
#include "engine/io/laz/point10.h"

#include <cstdlib>

namespace ptc::laz {
namespace {

// The kind of return r of n, [n][r]. Returns that the format does not allow have kinds as well.
constexpr std::uint8_t kKindOf7Returns[8][8] = {
    {15, 14, 13, 12, 11, 10, 9, 8},  {14, 0, 1, 3, 6, 10, 10, 9},
    {13, 1, 2, 4, 7, 11, 11, 10},    {12, 3, 4, 5, 8, 12, 12, 11},
    {11, 6, 7, 8, 9, 13, 13, 12},    {10, 10, 11, 12, 13, 14, 14, 13},
    {9, 10, 11, 12, 13, 14, 15, 14}, {8, 9, 10, 11, 12, 13, 14, 15},
};

unsigned return_number(const Point10& point) noexcept {
  return point.returns & 7U;
}
unsigned return_count(const Point10& point) noexcept {
  return point.returns >> 3 & 7U;
}

}  // namespace

Point10Decoder::Point10Decoder()
    : returns_(256, SymbolModel(256)),
      classification_(256, SymbolModel(256)),
      user_data_(256, SymbolModel(256)) {}

void Point10Decoder::start(const Point10& first) noexcept {
  last_ = first;
  last_.intensity = 0;
  steps_x_ = {};
  steps_y_ = {};
  heights_ = {};
  intensities_ = {};
  changed_.reset();
  for (IntegerDecoder* field : {&x_, &y_, &z_, &intensity_, &source_}) field->reset();
  for (SymbolModel& model : scan_angle_) model.reset();
  for (auto* models : {&returns_, &classification_, &user_data_}) {
    for (SymbolModel& model : *models) model.reset();
  }
}

const Point10& Point10Decoder::decode(ArithmeticDecoder& in) {
  const unsigned changed = in.symbol(changed_);
  if (changed != 0) decode_attributes(in, changed);
  const unsigned number = return_number(last_);
  const unsigned count = return_count(last_);
  const std::size_t kind = kKindOf7Returns[count][number];
  const auto level = static_cast<std::size_t>(std::abs(static_cast<int>(count - number)));
  const unsigned single = count == 1 ? 1 : 0;

  // The magnitude of the step in x is a context for y, and the mean of both is one for z.
  const auto even_up_to = [](unsigned value, unsigned most) {
    return value < most ? value & ~1U : most;
  };
  const auto add = [](std::int32_t a, std::int32_t b) {
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) + static_cast<std::uint32_t>(b));
  };
  const std::int32_t dx = x_.decode(in, steps_x_[kind].median(), single);
  steps_x_[kind].add(dx);
  last_.x = add(last_.x, dx);
  const std::int32_t dy =
      y_.decode(in, steps_y_[kind].median(), single + even_up_to(x_.magnitude(), 20));
  steps_y_[kind].add(dy);
  last_.y = add(last_.y, dy);
  const unsigned mean = (x_.magnitude() + y_.magnitude()) / 2;
  last_.z = z_.decode(in, heights_[level], single + even_up_to(mean, 18));
  heights_[level] = last_.z;
  return last_;
}

void Point10Decoder::decode_attributes(ArithmeticDecoder& in, unsigned changed) {
  if ((changed & 32) != 0)
    last_.returns = static_cast<std::uint8_t>(in.symbol(returns_[last_.returns]));
  const std::size_t kind = kKindOf7Returns[return_count(last_)][return_number(last_)];
  if ((changed & 16) != 0) {
    intensities_[kind] = static_cast<std::uint16_t>(
        intensity_.decode(in, intensities_[kind], std::min(static_cast<unsigned>(kind), 3U)));
  }
  last_.intensity = intensities_[kind];
  if ((changed & 8) != 0) {
    last_.classification =
        static_cast<std::uint8_t>(in.symbol(classification_[last_.classification]));
  }
  if ((changed & 4) != 0) {
    const unsigned direction = last_.returns >> 6 & 1U;
    last_.scan_angle = static_cast<std::int8_t>(static_cast<unsigned>(last_.scan_angle) +
                                                in.symbol(scan_angle_[direction]));
  }
  if ((changed & 2) != 0)
    last_.user_data = static_cast<std::uint8_t>(in.symbol(user_data_[last_.user_data]));
  if ((changed & 1) != 0)
    last_.source = static_cast<std::uint16_t>(source_.decode(in, last_.source));
}

}  // namespace ptc::laz
