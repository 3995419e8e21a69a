// The core of a point of formats 0 to 5.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/io/laz/arithmetic.h"
#include "engine/io/laz/integer.h"
#include "engine/io/laz/median.h"

namespace ptc::laz {

/// The first 20 bytes of a point of formats 0 to 5, as the record has them.
struct Point10 {
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t z = 0;
  std::uint16_t intensity = 0;
  std::uint8_t returns = 0;  ///< return number, 3 bits; number of returns, 3; direction; edge
  std::uint8_t classification = 0;
  std::int8_t scan_angle = 0;
  std::uint8_t user_data = 0;
  std::uint16_t source = 0;
};
static_assert(sizeof(Point10) == 20);

/// Decodes points by their difference from earlier points of the same kind of return.
class Point10Decoder {
 public:
  Point10Decoder();
  /// Begins with the first point.
  void start(const Point10& first) noexcept;
  /// Decodes the next point.
  const Point10& decode(ArithmeticDecoder& in);

 private:
  void decode_attributes(ArithmeticDecoder& in, unsigned changed);

  static constexpr std::size_t kKinds = 16;  // kinds of returns
  static constexpr std::size_t kLevels = 8;  // of heights

  Point10 last_;
  std::array<RecentValues, kKinds> steps_x_;
  std::array<RecentValues, kKinds> steps_y_;
  std::array<std::int32_t, kLevels> heights_{};
  std::array<std::uint16_t, kKinds> intensities_{};
  SymbolModel changed_{64};
  IntegerDecoder x_{32, 2};
  IntegerDecoder y_{32, 22};
  IntegerDecoder z_{32, 20};
  IntegerDecoder intensity_{16, 4};
  IntegerDecoder source_{16, 1};
  std::array<SymbolModel, 2> scan_angle_ = {SymbolModel(256), SymbolModel(256)};
  std::vector<SymbolModel> returns_;         // for each last value
  std::vector<SymbolModel> classification_;  // for each last value
  std::vector<SymbolModel> user_data_;       // for each last value
};

}  // namespace ptc::laz
