// The fields that several versions of a point share: GPS time, colour, near infrared, wave packet,
// extra bytes. Each class holds the models of one field and, if it says so, its last values.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/io/laz/arithmetic.h"
#include "engine/io/laz/integer.h"

namespace ptc::laz {

/// Decodes GPS times, the bits of doubles. Points come from up to four sequences of times, such as
/// overlapping scans; a time is predicted from the last step of its sequence.
class GpsTimeDecoder {
 public:
  /// Makes a decoder of the times of every point, or only of those that differ from the one before.
  explicit GpsTimeDecoder(bool every_point);
  /// Begins with the time of the first point.
  void start(std::uint64_t time) noexcept;
  /// Decodes the time of the next point.
  std::uint64_t decode(ArithmeticDecoder& in);

 private:
  struct Sequence {
    std::uint64_t time = 0;
    std::int32_t step = 0;      // last difference of times; 0 when it is not known
    unsigned misfit_count = 0;  // differences that no small multiple of the step explains
  };

  void decode_first_step(ArithmeticDecoder& in);
  void decode_multiple(ArithmeticDecoder& in, unsigned code);
  void begin_sequence(ArithmeticDecoder& in);

  std::uint32_t unchanged_codes_;  // 1 when a code says that the time stays, else 0
  std::array<Sequence, 4> sequences_;
  unsigned current_ = 0;
  unsigned newest_ = 0;
  SymbolModel multiple_;
  SymbolModel first_step_;
  IntegerDecoder difference_;
};

/// Red, green and blue of 16 bits.
using Rgb = std::array<std::uint16_t, 3>;

/// Decodes colours by their difference from the last one.
class RgbDecoder {
 public:
  /// Forgets all colours that were decoded.
  void reset() noexcept;
  /// Decodes the colour that follows `last`.
  Rgb decode(ArithmeticDecoder& in, const Rgb& last);

 private:
  SymbolModel changed_{128};
  std::array<SymbolModel, 6> difference_ = {SymbolModel(256), SymbolModel(256), SymbolModel(256),
                                            SymbolModel(256), SymbolModel(256), SymbolModel(256)};
};

/// Decodes near infrared by its difference from the last value.
class NirDecoder {
 public:
  /// Forgets all values that were decoded.
  void reset() noexcept;
  /// Decodes the value that follows `last`.
  std::uint16_t decode(ArithmeticDecoder& in, std::uint16_t last);

 private:
  SymbolModel changed_{4};
  std::array<SymbolModel, 2> difference_ = {SymbolModel(256), SymbolModel(256)};
};

/// The wave packet of a point, as the record has it: descriptor (u8), offset (u64), size (u32),
/// location of the return, and dx, dy, dz (f32 each).
using WavePacket = std::array<std::byte, 29>;

/// Decodes wave packets by their difference from the last one.
class WavePacketDecoder {
 public:
  /// Forgets all packets that were decoded.
  void reset() noexcept;
  /// Decodes the packet that follows `last`.
  WavePacket decode(ArithmeticDecoder& in, const WavePacket& last);

 private:
  std::int32_t offset_step_ = 0;  // last difference of offsets that is in the stream
  unsigned offset_code_ = 0;      // how the last offset was coded
  SymbolModel descriptor_{256};
  std::array<SymbolModel, 4> code_ = {SymbolModel(4), SymbolModel(4), SymbolModel(4),
                                      SymbolModel(4)};
  IntegerDecoder offset_{32, 1};
  IntegerDecoder size_{32, 1};
  IntegerDecoder location_{32, 1};
  IntegerDecoder direction_{32, 3};
};

}  // namespace ptc::laz
