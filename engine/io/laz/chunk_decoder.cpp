// Decoding of chunks of both kinds.
//
//   pointwise   record | one stream: point, time, colour, wave packet, extra bytes of record 1,
//               then of record 2, ...
//   layered     record | number of points u32 | bytes of each layer u32 | layer | layer | ...
//
// The first record of a chunk lies in it as it is. The layers are those of the point (point14.h),
// then one for the colour, one for near infrared, one for the wave packet and one for each extra
// byte.
#include "engine/io/laz/chunk_decoder.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "engine/io/laz/error.h"
#include "engine/io/laz/fields.h"
#include "engine/io/laz/point10.h"
#include "engine/io/laz/point14.h"

namespace ptc::laz {
namespace {

constexpr std::size_t kPoint14TimeAt = 22;
constexpr std::size_t kPoint14Bytes = 30;

// Where the fields of a record lie; 0 for one that it does not have.
struct Places {
  explicit Places(const Layout& layout) : extra(format_bytes(layout.format)) {
    const bool layered = layout.format >= 6;
    std::size_t at = layered ? kPoint14Bytes : sizeof(Point10);
    const auto place = [&at](bool has, std::size_t bytes) {
      const std::size_t here = has ? at : 0;
      if (has) at += bytes;
      return here;
    };
    time = place(!layered && has_time(layout.format), 8);
    rgb = place(has_rgb(layout.format), sizeof(Rgb));
    nir = place(has_nir(layout.format), 2);
    wave_packet = place(has_wave_packet(layout.format), sizeof(WavePacket));
    extra_bytes = layout.record_bytes - extra;
  }

  std::size_t time = 0;  // of formats 0 to 5; in others it belongs to the point
  std::size_t rgb = 0;
  std::size_t nir = 0;
  std::size_t wave_packet = 0;
  std::size_t extra = 0;
  std::size_t extra_bytes = 0;
};

template <typename T>
T read_at(const std::byte* at) noexcept {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

template <typename T>
void write_at(std::byte* at, const T& value) noexcept {
  std::memcpy(at, &value, sizeof value);
}

Point14 load_point14(const std::byte* at) noexcept {
  Point14 point;
  std::memcpy(static_cast<void*>(&point), at, kPoint14TimeAt);
  point.time = read_at<std::uint64_t>(at + kPoint14TimeAt);
  return point;
}

void store_point14(std::byte* at, const Point14& point) noexcept {
  std::memcpy(at, &point, kPoint14TimeAt);
  write_at(at + kPoint14TimeAt, point.time);
}

[[noreturn]] void refuse_damage() {
  throw LazError("the compressed points are damaged or end too early");
}

void require_record(std::span<const std::byte> chunk, std::size_t record_bytes) {
  if (chunk.size() < record_bytes) throw LazError("the chunk is too short for its first point");
}

class PointwiseDecoder : public ChunkDecoder {
 public:
  explicit PointwiseDecoder(const Layout& layout)
      : record_bytes_(layout.record_bytes),
        places_(layout),
        time_(true),
        extra_(places_.extra_bytes, SymbolModel(256)) {}

  void start(std::span<const std::byte> padded, std::uint64_t points) override {
    const auto chunk = padded.first(padded.size() - kSlackBytes);
    require_record(chunk, record_bytes_);
    const std::byte* const first = chunk.data();
    last_.assign(first, first + record_bytes_);
    is_first_ = true;
    has_stream_ = points > 1;  // a chunk of one point may have bytes that mean nothing
    if (!has_stream_) return;
    in_.start(chunk.subspan(record_bytes_));
    point_.start(read_at<Point10>(first));
    if (places_.time != 0) time_.start(read_at<std::uint64_t>(first + places_.time));
    rgb_.reset();
    wave_packet_.reset();
    for (SymbolModel& model : extra_) model.reset();
  }

  void decode(std::span<std::byte> out) override {
    std::byte* at = out.data();
    std::byte* const end = at + out.size();
    if (is_first_ && at != end) {
      std::ranges::copy(last_, at);
      at += record_bytes_;
      is_first_ = false;
    }
    const std::byte* last = last_.data();
    for (; at != end; at += record_bytes_) {
      decode_record(last, at);
      if (!in_.ok()) refuse_damage();
      last = at;
    }
    if (last != last_.data()) last_.assign(last, last + record_bytes_);
  }

  void finish() const override {
    if (has_stream_ && !in_.at_end())
      throw LazError("the chunk has more bytes than its points take");
  }

 private:
  // Decodes the record that follows `last`.
  void decode_record(const std::byte* last, std::byte* out) {
    write_at(out, point_.decode(in_));
    if (places_.time != 0) write_at(out + places_.time, time_.decode(in_));
    if (places_.rgb != 0)
      write_at(out + places_.rgb, rgb_.decode(in_, read_at<Rgb>(last + places_.rgb)));
    if (places_.wave_packet != 0) {
      write_at(out + places_.wave_packet,
               wave_packet_.decode(in_, read_at<WavePacket>(last + places_.wave_packet)));
    }
    for (std::size_t i = places_.extra; i < record_bytes_; ++i) {
      SymbolModel& model = extra_[i - places_.extra];
      out[i] = static_cast<std::byte>(std::to_integer<unsigned>(last[i]) + in_.symbol(model));
    }
  }

  std::size_t record_bytes_;
  Places places_;
  ArithmeticDecoder in_;
  bool has_stream_ = false;
  bool is_first_ = false;        // last_ is the first record and was not returned yet
  std::vector<std::byte> last_;  // record
  Point10Decoder point_;
  GpsTimeDecoder time_;
  RgbDecoder rgb_;
  WavePacketDecoder wave_packet_;
  std::vector<SymbolModel> extra_;  // for each extra byte
};

// The models and the last values of one field in each scanner channel. A channel begins with the
// value of the point before its first one.
template <class Models, class Value>
class ChannelField {
 public:
  explicit ChannelField(bool own_channel) : own_channel_(own_channel) {}

  // Begins with the value of the first point.
  void start(unsigned channel, const Value& first) {
    begun_ = {};
    current_ = channel;
    begin(channel, first);
  }

  // Calls decode(models, last) for the next point, which sets `last` to its value.
  template <class Decode>
  const Value& next(unsigned channel, const Decode& decode) {
    Value* last = &last_[current_];
    if (channel != current_) {
      const bool is_new = !begun_[channel];
      if (is_new) begin(channel, *last);
      if (is_new || own_channel_) last = &last_[channel];
      current_ = channel;
    }
    decode(*models_[channel], *last);
    return *last;
  }

 private:
  void begin(unsigned channel, const Value& first) {
    if (models_[channel] == nullptr) models_[channel] = std::make_unique<Models>();
    models_[channel]->reset();
    last_[channel] = first;
    begun_[channel] = true;
  }

  bool own_channel_;
  unsigned current_ = 0;
  std::array<bool, kChannels> begun_{};                    // in this chunk
  std::array<std::unique_ptr<Models>, kChannels> models_;  // made at their first use
  std::array<Value, kChannels> last_{};
};

// The models of one extra byte.
struct ByteModels {
  SymbolModel difference{256};
  void reset() noexcept { difference.reset(); }
};

class LayeredDecoder : public ChunkDecoder {
 public:
  explicit LayeredDecoder(const Layout& layout)
      : record_bytes_(layout.record_bytes),
        places_(layout),
        own_channel_(layout.own_channel),
        rgb_(layout.own_channel),
        nir_(layout.own_channel),
        wave_packet_(layout.own_channel),
        extra_layers_(places_.extra_bytes) {
    extra_.reserve(places_.extra_bytes);
    for (std::size_t i = 0; i < places_.extra_bytes; ++i) extra_.emplace_back(layout.own_channel);
  }

  void start(std::span<const std::byte> padded, std::uint64_t points) override {
    const auto chunk = padded.first(padded.size() - kSlackBytes);
    require_record(chunk, record_bytes_);
    first_.assign(chunk.data(), chunk.data() + record_bytes_);
    is_first_ = true;
    points_ = points;
    start_layers(chunk);

    // Begin all fields with the first record.
    const std::byte* const first = first_.data();
    const Point14 point = load_point14(first);
    point_.start(point);
    const unsigned channel = point.channel();
    if (places_.rgb != 0) rgb_.start(channel, read_at<Rgb>(first + places_.rgb));
    if (places_.nir != 0) nir_.start(channel, read_at<std::uint16_t>(first + places_.nir));
    if (places_.wave_packet != 0)
      wave_packet_.start(channel, read_at<WavePacket>(first + places_.wave_packet));
    for (std::size_t i = 0; i < extra_.size(); ++i)
      extra_[i].start(channel, first[places_.extra + i]);
  }

  void decode(std::span<std::byte> out) override {
    std::byte* at = out.data();
    std::byte* const end = at + out.size();
    if (is_first_ && at != end) {
      std::ranges::copy(first_, at);
      at += record_bytes_;
      is_first_ = false;
    }
    for (; at != end; at += record_bytes_) {
      decode_record(at);
      if (!point_layers_[0].in.ok()) refuse_damage();
    }
    if (!all_layers([](const Layer& layer) { return layer.in.ok(); })) refuse_damage();
  }

  void finish() const override {
    if (points_ > 1 && !all_layers([](const Layer& layer) { return layer.in.at_end(); }))
      throw LazError("a layer has more bytes than its points take");
  }

 private:
  // Finds the layers and begins to decode them.
  void start_layers(std::span<const std::byte> chunk) {
    // Check the sizes that stand before the layers.
    std::size_t layers = Point14Decoder::kLayers + extra_.size();
    for (const std::size_t field : {places_.rgb, places_.nir, places_.wave_packet})
      layers += field != 0 ? 1 : 0;
    const std::size_t fixed = record_bytes_ + 4 + 4 * layers;
    if (chunk.size() < fixed) throw LazError("the chunk is too short for the sizes of its layers");
    if (read_at<std::uint32_t>(chunk.data() + record_bytes_) != points_)
      throw LazError("the chunk and the chunk table have different numbers of points");

    // Cut the rest into layers.
    const std::byte* size_at = chunk.data() + record_bytes_ + 4;
    auto rest = chunk.subspan(fixed);
    const auto start_layer = [&](Layer& layer) {
      const auto bytes = read_at<std::uint32_t>(size_at);
      size_at += 4;
      if (bytes > rest.size()) throw LazError("a layer is longer than its chunk");
      layer.present = bytes > 0;
      layer.in.start(rest.first(bytes));
      rest = rest.subspan(bytes);
    };
    for (Layer& layer : point_layers_) start_layer(layer);
    if (places_.rgb != 0) start_layer(rgb_layer_);
    if (places_.nir != 0) start_layer(nir_layer_);
    if (places_.wave_packet != 0) start_layer(wave_packet_layer_);
    for (Layer& layer : extra_layers_) start_layer(layer);
    if (!rest.empty()) throw LazError("the chunk has more bytes than its layers");
  }

  template <class Predicate>
  [[nodiscard]] bool all_layers(const Predicate& holds) const {
    const auto fits = [&holds](const Layer& layer) { return !layer.present || holds(layer); };
    return std::ranges::all_of(point_layers_, fits) && std::ranges::all_of(extra_layers_, fits) &&
           fits(rgb_layer_) && fits(nir_layer_) && fits(wave_packet_layer_);
  }

  void decode_record(std::byte* out) {
    // Decode the point.
    const Point14& point = point_.decode(point_layers_);
    store_point14(out, point);

    // Decode what else the format has, in the channel that counts for it.
    const unsigned channel = own_channel_ || point_.channel_changed() ? point.channel() : 0;
    if (places_.rgb != 0) {
      write_at(out + places_.rgb, rgb_.next(channel, [this](RgbDecoder& models, Rgb& last) {
        if (rgb_layer_.present) last = models.decode(rgb_layer_.in, last);
      }));
    }
    if (places_.nir != 0) {
      write_at(out + places_.nir,
               nir_.next(channel, [this](NirDecoder& models, std::uint16_t& last) {
                 if (nir_layer_.present) last = models.decode(nir_layer_.in, last);
               }));
    }
    if (places_.wave_packet != 0) {
      write_at(out + places_.wave_packet,
               wave_packet_.next(channel, [this](WavePacketDecoder& models, WavePacket& last) {
                 if (wave_packet_layer_.present) last = models.decode(wave_packet_layer_.in, last);
               }));
    }
    for (std::size_t i = 0; i < extra_.size(); ++i) {
      Layer& layer = extra_layers_[i];
      out[places_.extra + i] =
          extra_[i].next(channel, [&layer](ByteModels& models, std::byte& last) {
            if (!layer.present) return;
            last = static_cast<std::byte>(std::to_integer<unsigned>(last) +
                                          layer.in.symbol(models.difference));
          });
    }
  }

  std::size_t record_bytes_;
  Places places_;
  bool own_channel_;              // see Layout
  bool is_first_ = false;         // the first record was not returned yet
  std::uint64_t points_ = 0;      // of the chunk
  std::vector<std::byte> first_;  // record
  Point14Decoder::Layers point_layers_;
  Layer rgb_layer_;
  Layer nir_layer_;
  Layer wave_packet_layer_;
  Point14Decoder point_;
  ChannelField<RgbDecoder, Rgb> rgb_;
  ChannelField<NirDecoder, std::uint16_t> nir_;
  ChannelField<WavePacketDecoder, WavePacket> wave_packet_;
  std::vector<Layer> extra_layers_;                         // for each extra byte
  std::vector<ChannelField<ByteModels, std::byte>> extra_;  // for each extra byte
};

}  // namespace

std::unique_ptr<ChunkDecoder> make_chunk_decoder(const Layout& layout) {
  if (layout.compressor == Compressor::layered) return std::make_unique<LayeredDecoder>(layout);
  return std::make_unique<PointwiseDecoder>(layout);
}

}  // namespace ptc::laz
