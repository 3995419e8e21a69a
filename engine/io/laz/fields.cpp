// Decoding of GPS times, colours and wave packets.
//
// A GPS time is coded as a multiple of the last step of its sequence, plus a correction that has a
// context for each range of multiples:
//
//   code                      meaning                                   context of the correction
//   0                         no multiple fits: the difference itself   7
//   1                         one step                                  1
//   2 ... 9, 10 ... 499, 500  so many steps                             2, 3, 4
//   501 ... 509, 510          -1 ... -9, -10 steps                      5, 6
//   511                       a new sequence, by the time's bits        8 (upper half)
//   512, 513, 514             one, two, three sequences on
//
// While a sequence has no step, there are five codes: a difference (context 0), a new sequence, and
// one, two, three sequences on. Where every point has a code, one more says that the time stays:
// 511, or the first of the short list, and codes from there on are one higher.
//
// Colours and wave packets are coded in the differences of their bytes or integers.
#include "engine/io/laz/fields.h"

#include <algorithm>
#include <cstring>

#include "format/bytes.h"

namespace ptc::laz {
namespace {

constexpr unsigned kMostSteps = 500;
constexpr unsigned kNewSequence = 511;
constexpr unsigned kMaxMisfits = 3;   // one more, and the difference becomes the step
constexpr unsigned kMaxSwitches = 4;  // in a row; encoders write one

std::uint8_t low_byte(std::uint16_t value) noexcept {
  return static_cast<std::uint8_t>(value & 255);
}

std::uint8_t high_byte(std::uint16_t value) noexcept {
  return static_cast<std::uint8_t>(value >> 8);
}

std::uint16_t join(std::uint8_t low, std::uint8_t high) noexcept {
  return static_cast<std::uint16_t>(low | high << 8);
}

// Decodes a byte as difference modulo 256 from a prediction.
std::uint8_t byte_near(ArithmeticDecoder& in, SymbolModel& model, int predicted) {
  return static_cast<std::uint8_t>(static_cast<unsigned>(predicted) + in.symbol(model));
}

}  // namespace

GpsTimeDecoder::GpsTimeDecoder(bool every_point)
    : unchanged_codes_(every_point ? 1 : 0),
      multiple_(kNewSequence + 4 + unchanged_codes_),
      first_step_(5 + unchanged_codes_),
      difference_(32, 9) {}

void GpsTimeDecoder::start(std::uint64_t time) noexcept {
  sequences_ = {};
  sequences_[0].time = time;
  current_ = 0;
  newest_ = 0;
  multiple_.reset();
  first_step_.reset();
  difference_.reset();
}

std::uint64_t GpsTimeDecoder::decode(ArithmeticDecoder& in) {
  for (unsigned switches = 0; switches <= kMaxSwitches; ++switches) {
    // Decode what happened, as a code without that of unchanged times.
    const bool has_step = sequences_[current_].step != 0;
    const unsigned first_of_others = has_step ? kNewSequence : 1;
    unsigned code = in.symbol(has_step ? multiple_ : first_step_);
    const unsigned unchanged = has_step ? kNewSequence : 0;
    if (unchanged_codes_ != 0 && code == unchanged) return sequences_[current_].time;
    if (unchanged_codes_ != 0 && code > unchanged) --code;

    // Move within the sequence, begin a new one, or decode on in another one.
    if (code <= first_of_others) {
      if (code == first_of_others) {
        begin_sequence(in);
      } else if (has_step) {
        decode_multiple(in, code);
      } else {
        decode_first_step(in);
      }
      return sequences_[current_].time;
    }
    current_ = (current_ + code - first_of_others) % 4;
  }
  in.mark_damaged();
  return 0;
}

void GpsTimeDecoder::decode_first_step(ArithmeticDecoder& in) {
  Sequence& sequence = sequences_[current_];
  sequence.step = difference_.decode(in, 0, 0);
  sequence.time += static_cast<std::uint64_t>(std::int64_t{sequence.step});
  sequence.misfit_count = 0;
}

void GpsTimeDecoder::decode_multiple(ArithmeticDecoder& in, unsigned code) {
  Sequence& sequence = sequences_[current_];
  // Find the number of steps and the context.
  const int steps = code <= kMostSteps ? static_cast<int>(code)
                                       : static_cast<int>(kMostSteps) - static_cast<int>(code);
  unsigned context = 1;
  if (code == 0) {
    context = 7;
  } else if (code > kMostSteps) {
    context = steps > -10 ? 5 : 6;
  } else if (code > 1) {
    context = code < 10 ? 2 : code < kMostSteps ? 3 : 4;
  }

  // Decode the difference. After several that do not fit, it becomes the step.
  const std::uint32_t predicted =
      static_cast<std::uint32_t>(steps) * static_cast<std::uint32_t>(sequence.step);
  const std::int32_t difference =
      difference_.decode(in, static_cast<std::int32_t>(predicted), context);
  sequence.time += static_cast<std::uint64_t>(std::int64_t{difference});
  if (code == 1) {
    sequence.misfit_count = 0;
  } else if (context == 4 || context == 6 || context == 7) {
    if (++sequence.misfit_count <= kMaxMisfits) return;
    sequence.step = difference;
    sequence.misfit_count = 0;
  }
}

void GpsTimeDecoder::begin_sequence(ArithmeticDecoder& in) {
  const auto upper = static_cast<std::int32_t>(sequences_[current_].time >> 32);
  newest_ = (newest_ + 1) % 4;
  const auto time_upper = static_cast<std::uint32_t>(difference_.decode(in, upper, 8));
  sequences_[newest_] = {std::uint64_t{time_upper} << 32 | in.bits(32)};
  current_ = newest_;
}

void RgbDecoder::reset() noexcept {
  changed_.reset();
  for (SymbolModel& model : difference_) model.reset();
}

Rgb RgbDecoder::decode(ArithmeticDecoder& in, const Rgb& last) {
  // Decode red. Bits 0 and 1 say whether its low and its high byte changed.
  const unsigned changed = in.symbol(changed_);
  const std::array<std::uint8_t, 3> last_low = {low_byte(last[0]), low_byte(last[1]),
                                                low_byte(last[2])};
  const std::array<std::uint8_t, 3> last_high = {high_byte(last[0]), high_byte(last[1]),
                                                 high_byte(last[2])};
  const auto near = [&](unsigned bit, std::uint8_t unchanged, int predicted) {
    if ((changed >> bit & 1) == 0) return unchanged;
    return byte_near(in, difference_[bit], std::clamp(predicted, 0, 255));
  };
  const std::uint8_t red_low = near(0, last_low[0], last_low[0]);
  const std::uint8_t red_high = near(1, last_high[0], last_high[0]);
  const std::uint16_t red = join(red_low, red_high);
  if ((changed >> 6 & 1) == 0) return {red, red, red};  // bit 6: the colour is not grey

  // Predict green by the change of red, and blue by the mean of both changes.
  int change = red_low - last_low[0];
  const std::uint8_t green_low = near(2, last_low[1], change + last_low[1]);
  change = (change + green_low - last_low[1]) / 2;
  const std::uint8_t blue_low = near(4, last_low[2], change + last_low[2]);
  change = red_high - last_high[0];
  const std::uint8_t green_high = near(3, last_high[1], change + last_high[1]);
  change = (change + green_high - last_high[1]) / 2;
  const std::uint8_t blue_high = near(5, last_high[2], change + last_high[2]);
  return {red, join(green_low, green_high), join(blue_low, blue_high)};
}

void NirDecoder::reset() noexcept {
  changed_.reset();
  for (SymbolModel& model : difference_) model.reset();
}

std::uint16_t NirDecoder::decode(ArithmeticDecoder& in, std::uint16_t last) {
  const unsigned changed = in.symbol(changed_);
  std::uint8_t low = low_byte(last);
  std::uint8_t high = high_byte(last);
  if ((changed & 1) != 0) low = byte_near(in, difference_[0], low);
  if ((changed & 2) != 0) high = byte_near(in, difference_[1], high);
  return join(low, high);
}

void WavePacketDecoder::reset() noexcept {
  offset_step_ = 0;
  offset_code_ = 0;
  descriptor_.reset();
  for (SymbolModel& model : code_) model.reset();
  for (IntegerDecoder* field : {&offset_, &size_, &location_, &direction_}) field->reset();
}

WavePacket WavePacketDecoder::decode(ArithmeticDecoder& in, const WavePacket& last) {
  WavePacket packet;
  const auto put = [&packet](std::size_t at, auto value) {
    std::memcpy(packet.data() + at, &value, sizeof value);
  };
  put(0, static_cast<std::uint8_t>(in.symbol(descriptor_)));

  // Decode the offset: unchanged, right behind the last packet, by a step, or in full.
  auto offset = load<std::uint64_t>(last.data(), 1);
  const auto last_size = load<std::int32_t>(last.data(), 9);
  offset_code_ = in.symbol(code_[offset_code_]);
  if (offset_code_ == 1) {
    offset += static_cast<std::uint32_t>(last_size);
  } else if (offset_code_ == 2) {
    offset_step_ = offset_.decode(in, offset_step_);
    offset += static_cast<std::uint64_t>(std::int64_t{offset_step_});
  } else if (offset_code_ == 3) {
    const std::uint64_t low = in.bits(32);
    offset = low | std::uint64_t{in.bits(32)} << 32;
  }
  put(1, offset);

  // Decode the other fields by the bits of their numbers.
  put(9, size_.decode(in, last_size));
  put(13, location_.decode(in, load<std::int32_t>(last.data(), 13)));
  for (unsigned axis = 0; axis < 3; ++axis) {
    const std::size_t at = 17 + std::size_t{4} * axis;
    put(at, direction_.decode(in, load<std::int32_t>(last.data(), at), axis));
  }
  return packet;
}

}  // namespace ptc::laz
