// The core of a point of formats 6 to 10.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "engine/io/laz/arithmetic.h"
#include "engine/io/laz/fields.h"
#include "engine/io/laz/integer.h"
#include "engine/io/laz/median.h"

namespace ptc::laz {

/// The first 30 bytes of a point of formats 6 to 10. The members before `time` lie as in the
/// record, where the time follows at byte 22.
struct Point14 {
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t z = 0;
  std::uint16_t intensity = 0;
  std::uint8_t returns = 0;  ///< return number, 4 bits; number of returns, 4
  std::uint8_t flags = 0;    ///< classification flags, 4 bits; channel, 2; direction; edge
  std::uint8_t classification = 0;
  std::uint8_t user_data = 0;
  std::int16_t scan_angle = 0;
  std::uint16_t source = 0;
  std::uint64_t time = 0;  ///< bits of a double

  /// Returns the number of the scanner channel, 0 to 3.
  [[nodiscard]] unsigned channel() const noexcept { return flags >> 4 & 3U; }
};
static_assert(offsetof(Point14, source) == 20);

/// A stream of its own for some fields of all points of a chunk. A layer without bytes says that
/// these fields never change.
struct Layer {
  ArithmeticDecoder in;
  bool present = false;
};

/// The scanner channels of a point format; each has models and last values of its own.
inline constexpr unsigned kChannels = 4;

/// Decodes points by their difference from the last point of the same scanner channel.
class Point14Decoder {
 public:
  /// The layers in the order of the file: returns, channel and x y; z; classification; flags;
  /// intensity; scan angle; user data; source; GPS time.
  static constexpr std::size_t kLayers = 9;
  using Layers = std::array<Layer, kLayers>;

  Point14Decoder();
  ~Point14Decoder();
  /// Begins with the first point.
  void start(const Point14& first);
  /// Decodes the next point.
  const Point14& decode(Layers& layers);
  /// Says whether the point that was decoded last is of another channel than the one before.
  [[nodiscard]] bool channel_changed() const noexcept { return channel_changed_; }

 private:
  struct Channel;

  Channel& begin_channel(unsigned number, const Point14& last);

  std::array<std::unique_ptr<Channel>, kChannels> channels_;  // made at their first use
  std::array<bool, kChannels> begun_{};                       // in this chunk
  unsigned current_ = 0;
  bool channel_changed_ = false;
};

}  // namespace ptc::laz
