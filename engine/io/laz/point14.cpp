// Decoding of the core of points of formats 6 to 10 (item POINT14, versions 3 and 4).
//
// Every field group has a stream of its own, a layer. The first layer has a symbol of seven bits
// for each point that says what changed:
//
//   bits 0 and 1   return number: same, one more, one less, other
//   bit 2          number of returns
//   bits 3 to 5    scan angle, GPS time, source
//   bit 6          scanner channel
//
// Whatever is predicted is predicted from the last point of the same scanner channel. Contexts are
// the place of a return in its pulse (first, last, single, between) and whether the time changed,
// that is, whether a new pulse began.
#include "engine/io/laz/point14.h"

#include <algorithm>
#include <cstdlib>

namespace ptc::laz {
namespace {

// The kind of return r of n, [n][r].
constexpr std::uint8_t kKindOf15Returns[16][16] = {
    {0, 1, 2, 3, 4, 5, 3, 4, 4, 5, 5, 5, 5, 5, 5, 5},
    {1, 0, 1, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3},
    {2, 1, 2, 4, 4, 4, 4, 4, 4, 4, 4, 3, 3, 3, 3, 3},
    {3, 3, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4},
    {4, 3, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4},
    {5, 3, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4},
    {3, 3, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4},
    {4, 3, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4},
    {4, 3, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4},
    {5, 3, 4, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4},
    {5, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4},
    {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 4, 4, 4},
    {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5, 4, 4},
    {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5, 4},
    {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5},
    {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5},
};

constexpr std::size_t kKinds = 6;  // of returns
constexpr unsigned kMaxLevel = 7;  // of heights

enum LayerIndex : std::size_t {
  kReturnsXy,
  kZ,
  kClassification,
  kFlags,
  kIntensity,
  kScanAngle,
  kUserData,
  kSource,
  kTime
};

unsigned return_number(const Point14& point) noexcept {
  return point.returns & 15U;
}
unsigned return_count(const Point14& point) noexcept {
  return point.returns >> 4;
}

std::int32_t add(std::int32_t a, std::int32_t b) noexcept {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) + static_cast<std::uint32_t>(b));
}

unsigned even_up_to(unsigned value, unsigned most) noexcept {
  return value < most ? value & ~1U : most;
}

}  // namespace

// Models and last values of a scanner channel.
struct Point14Decoder::Channel {
  Point14 last;
  bool time_changed = false;  // at the last point
  std::array<RecentValues, 2 * kKinds> steps_x;
  std::array<RecentValues, 2 * kKinds> steps_y;
  std::array<std::int32_t, kMaxLevel + 1> heights{};
  std::array<std::uint16_t, 8> intensities{};
  std::vector<SymbolModel> changed = std::vector<SymbolModel>(8, SymbolModel(128));
  SymbolModel channel_step{3};
  std::vector<SymbolModel> return_count = std::vector<SymbolModel>(16, SymbolModel(16));
  std::vector<SymbolModel> return_number = std::vector<SymbolModel>(16, SymbolModel(16));
  SymbolModel return_step{13};
  std::vector<SymbolModel> classification = std::vector<SymbolModel>(64, SymbolModel(256));
  std::vector<SymbolModel> flags = std::vector<SymbolModel>(64, SymbolModel(64));
  std::vector<SymbolModel> user_data = std::vector<SymbolModel>(64, SymbolModel(256));
  IntegerDecoder x{32, 2};
  IntegerDecoder y{32, 22};
  IntegerDecoder z{32, 20};
  IntegerDecoder intensity{16, 4};
  IntegerDecoder scan_angle{16, 2};
  IntegerDecoder source{16, 1};
  GpsTimeDecoder time{false};

  void start(const Point14& first) noexcept;
  void decode_returns(ArithmeticDecoder& in, unsigned what);
  void decode_place(Layers& layers, std::size_t time_bit);
  void decode_others(Layers& layers, unsigned what);
};

void Point14Decoder::Channel::start(const Point14& first) noexcept {
  last = first;
  time_changed = false;
  steps_x = {};
  steps_y = {};
  heights.fill(first.z);
  intensities.fill(first.intensity);
  for (auto* models :
       {&changed, &return_count, &return_number, &classification, &flags, &user_data}) {
    for (SymbolModel& model : *models) model.reset();
  }
  for (SymbolModel* model : {&channel_step, &return_step}) model->reset();
  for (IntegerDecoder* field : {&x, &y, &z, &intensity, &scan_angle, &source}) field->reset();
  time.start(first.time);
}

void Point14Decoder::Channel::decode_returns(ArithmeticDecoder& in, unsigned what) {
  unsigned count = laz::return_count(last);
  unsigned number = laz::return_number(last);
  if ((what >> 2 & 1) != 0) count = in.symbol(return_count[count]);
  switch (what & 3) {
    case 0:
      break;
    case 1:
      number = (number + 1) % 16;
      break;
    case 2:
      number = (number + 15) % 16;
      break;
    default:
      if ((what >> 4 & 1) != 0) {
        number = in.symbol(return_number[number]);
      } else {
        number = (number + in.symbol(return_step) + 2) % 16;
      }
  }
  last.returns = static_cast<std::uint8_t>(count << 4 | number);
}

void Point14Decoder::Channel::decode_place(Layers& layers, std::size_t time_bit) {
  const unsigned number = laz::return_number(last);
  const unsigned count = laz::return_count(last);
  const unsigned single = count == 1 ? 1 : 0;
  const std::size_t kind = std::size_t{2} * kKindOf15Returns[count][number] + time_bit;

  // Decode x and y by the median of recent steps.
  ArithmeticDecoder& in = layers[kReturnsXy].in;
  const std::int32_t dx = x.decode(in, steps_x[kind].median(), single);
  steps_x[kind].add(dx);
  last.x = add(last.x, dx);
  const std::int32_t dy =
      y.decode(in, steps_y[kind].median(), single + even_up_to(x.magnitude(), 20));
  steps_y[kind].add(dy);
  last.y = add(last.y, dy);

  // Decode z by the last height of its level.
  if (!layers[kZ].present) return;
  const auto level = static_cast<std::size_t>(
      std::min(std::abs(static_cast<int>(count - number)), static_cast<int>(kMaxLevel)));
  const unsigned mean = (x.magnitude() + y.magnitude()) / 2;
  last.z = z.decode(layers[kZ].in, heights[level], single + even_up_to(mean, 18));
  heights[level] = last.z;
}

void Point14Decoder::Channel::decode_others(Layers& layers, unsigned what) {
  const auto number = laz::return_number(last);
  const unsigned place =
      (number == 1 ? 2U : 0U) + (number >= laz::return_count(last) ? 1U : 0U);  // 3: single
  const unsigned new_time = what >> 4 & 1;

  // Decode the fields that have a symbol or a number for every point.
  if (layers[kClassification].present) {
    const unsigned context = (last.classification & 31U) << 1 | (place == 3 ? 1U : 0U);
    last.classification =
        static_cast<std::uint8_t>(layers[kClassification].in.symbol(classification[context]));
  }
  if (layers[kFlags].present) {  // bits 0 to 3, and direction and edge as bits 4 and 5
    const unsigned context = (last.flags & 15U) | (last.flags >> 2 & 48U);
    const unsigned decoded = layers[kFlags].in.symbol(flags[context]);
    last.flags =
        static_cast<std::uint8_t>((decoded & 15) | (decoded & 48) << 2 | (last.flags & 48U));
  }
  if (layers[kIntensity].present) {
    std::uint16_t& near = intensities[place << 1 | new_time];
    near = static_cast<std::uint16_t>(intensity.decode(layers[kIntensity].in, near, place));
    last.intensity = near;
  }
  if (layers[kUserData].present) {
    last.user_data =
        static_cast<std::uint8_t>(layers[kUserData].in.symbol(user_data[last.user_data / 4U]));
  }

  // Decode the fields that are coded only where they change.
  if (layers[kScanAngle].present && (what >> 3 & 1) != 0) {
    last.scan_angle = static_cast<std::int16_t>(
        scan_angle.decode(layers[kScanAngle].in, last.scan_angle, new_time));
  }
  if (layers[kSource].present && (what >> 5 & 1) != 0)
    last.source = static_cast<std::uint16_t>(source.decode(layers[kSource].in, last.source));
  if (layers[kTime].present && new_time != 0) last.time = time.decode(layers[kTime].in);
}

Point14Decoder::Point14Decoder() = default;
Point14Decoder::~Point14Decoder() = default;

Point14Decoder::Channel& Point14Decoder::begin_channel(unsigned number, const Point14& last) {
  if (channels_[number] == nullptr) channels_[number] = std::make_unique<Channel>();
  channels_[number]->start(last);
  begun_[number] = true;
  return *channels_[number];
}

void Point14Decoder::start(const Point14& first) {
  begun_ = {};
  current_ = first.channel();
  begin_channel(current_, first);
}

const Point14& Point14Decoder::decode(Layers& layers) {
  ArithmeticDecoder& in = layers[kReturnsXy].in;

  // Decode what changed, in the context of the last point of the last channel.
  Channel* channel = channels_[current_].get();
  const unsigned number = return_number(channel->last);
  const unsigned context = (number == 1 ? 1U : 0U) +
                           (number >= return_count(channel->last) ? 2U : 0U) +
                           (channel->time_changed ? 4U : 0U);
  const unsigned what = in.symbol(channel->changed[context]);

  // Change the channel.
  channel_changed_ = (what >> 6 & 1) != 0;
  if (channel_changed_) {
    current_ = (current_ + in.symbol(channel->channel_step) + 1) % kChannels;
    channel =
        begun_[current_] ? channels_[current_].get() : &begin_channel(current_, channel->last);
    channel->last.flags = static_cast<std::uint8_t>((channel->last.flags & 0xcfU) | current_ << 4);
  }

  // Decode the fields.
  const unsigned new_time = what >> 4 & 1;
  channel->decode_returns(in, what);
  channel->decode_place(layers, new_time);
  channel->decode_others(layers, what);
  channel->time_changed = new_time != 0;
  return channel->last;
}

}  // namespace ptc::laz
