// Reads point clouds of RenderMan (.ptc), in the layout that Partio writes and reads. All numbers
// are little-endian.
//
//   0    4   "pptc"
//   4    4   u32 version, 0
//   8    8   f64 number of points
//   16   24  f32[6] box: minimum, maximum
//   40   64  f32[16] world to eye
//   104  64  f32[16] world to NDC
//   168  12  f32[3] format of the picture: width, height, pixel aspect
//   180  4   u32 number of channels
//   184  4   u32 numbers of all channels in a point
//   188      a line "TYPE NAME" for each channel
//            points: f32[3] position, u16[2] normal, f32 radius, f32 of all channels
//
// packed_normal.h says what the two numbers of a normal mean. Where a file has `_emission`, as PTCX
// writes it, it is part of `_radiosity`, and the rest is what a disc reflects.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/packed_normal.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/particle_names.h"
#include "engine/io/cloud/record_source.h"
#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"
#include "format/bytes.h"

namespace ptc {
namespace {

constexpr std::size_t kCoreBytes = 20;  // position, normal and radius as the file has them
constexpr std::size_t kNormalOffset = 12;
constexpr std::size_t kPackedCore = 28;   // with the normal as three floats at its end
constexpr std::size_t kMaxFloats = 4096;  // of a point

// Returns the numbers that a channel of this type has; 0 for an unknown type.
std::size_t components_of(std::string_view type) {
  if (type == "float") return 1;
  if (type == "color" || type == "point" || type == "vector" || type == "normal") return 3;
  if (type == "matrix") return 16;
  return 0;
}

class PtcSource : public RecordSource {
 public:
  explicit PtcSource(const std::filesystem::path& path) : stream_(path) {
    read_header();
    read_channels();
    const std::uint64_t left = stream_.max_left();
    if (count_ > left / record_bytes()) {
      stream_.fail_at(8, "the PTC header counts " + std::to_string(count_) +
                             " points, more than the file can hold");
    }
    packed_.resize(kPackedCore + floats_ * sizeof(float));
    set_layout(PointLayout(path, fields_,
                           {.owner = "the PTC points", .float_colours = FloatColours::unbounded}));
  }

  [[nodiscard]] PointFileInfo info() const {
    PointFileInfo info;
    layout().describe(info);
    info.count = count_;
    info.notes = notes_;
    info.zeros_mean_none = true;
    return info;
  }

 private:
  [[nodiscard]] std::size_t record_bytes() const { return kCoreBytes + floats_ * sizeof(float); }

  void read_header() {
    constexpr std::string_view kMagic = "pptc";
    constexpr std::size_t kUnused = 24 + 64 + 64 + 12;  // box, matrices, format of the picture
    constexpr double kMaxCount = 0x1p53;                // beyond it, a double skips integers
    const std::string_view begin = stream_.peek(kMagic.size());
    if (begin != kMagic) stream_.fail_at(0, "not a PTC file");
    stream_.skip(kMagic.size());
    if (load<std::uint32_t>(stream_.take(4).data(), 0) != 0)
      stream_.fail_at(4, "the PTC version is not 0");
    const auto count = load<double>(stream_.take(8).data(), 0);
    if (!(count >= 0 && count <= kMaxCount && count == std::trunc(count)))
      stream_.fail_at(8, "the number of points is not a count");
    count_ = static_cast<std::uint64_t>(count);
    stream_.skip(kUnused);
    channels_ = load<std::uint32_t>(stream_.take(4).data(), 0);
    floats_ = load<std::uint32_t>(stream_.take(4).data(), 0);
    if (floats_ > kMaxFloats || channels_ > floats_)
      stream_.fail_at(180, "the PTC channels have no or more than 4096 numbers in a point");
  }

  // Reads the names of the channels and lists the fields of a packed record.
  void read_channels() {
    const auto core = [&](const char* name, std::uint8_t components, std::size_t offset) {
      Channel channel;
      channel.name = name;
      channel.type = ChannelType::f32;
      channel.components = components;
      add_attribute(channel, offset, fields_);
    };
    core("position", 3, 0);
    core("radius", 1, kNormalOffset);
    core("normal", 3, kNormalOffset + sizeof(float));
    std::size_t found = 0;
    for (std::uint32_t i = 0; i < channels_; ++i) {
      std::string_view line;
      const std::uint64_t place = stream_.offset();
      if (!stream_.next_line(line)) stream_.fail_at(place, "the names of the channels are missing");
      Words words(line);
      const std::string_view type = words.next();
      Channel channel;
      channel.name = words.next();
      channel.type = ChannelType::f32;
      const std::size_t components = components_of(type);
      if (components == 0 || channel.name.empty())
        stream_.fail_at(place, "a channel is not a known type and a name");
      channel.components = static_cast<std::uint8_t>(components);
      if (type == "color") {
        channel.role = ChannelRole::colour;
        channel.colour_space = ColourSpace::rec709;
      }
      if (type == "vector") channel.role = ChannelRole::vector;
      if (type == "normal") channel.role = ChannelRole::direction;
      const std::size_t before = fields_.size(), offset = kPackedCore + found * sizeof(float);
      add_attribute(channel, offset, fields_);
      if (!fields_[before].plain) {
        if (channel.name == "_radiosity") radiosity_ = offset;
        if (channel.name == "_emission") emission_ = offset;
        notes_.push_back("The channel '" + channel.name +
                         "' is taken as radiance, emission or albedo.");
      }
      found += components;
    }
    if (found != floats_)
      stream_.fail_at(184, "the channels have another number of floats than the header says");
  }

  const std::byte* next_record() override {
    if (done_ == count_) return nullptr;
    ++done_;
    place_ = stream_.offset();
    const std::byte* const from = stream_.take(record_bytes()).data();
    std::memcpy(packed_.data(), from, kNormalOffset);
    std::memcpy(packed_.data() + kNormalOffset, from + kNormalOffset + 4, sizeof(float));
    const glm::vec3 normal = unpack_normal({.phi = load<std::uint16_t>(from, kNormalOffset),
                                            .z = load<std::uint16_t>(from, kNormalOffset + 2)});
    std::memcpy(packed_.data() + kNormalOffset + sizeof(float), &normal, sizeof normal);
    std::memcpy(packed_.data() + kPackedCore, from + kCoreBytes, floats_ * sizeof(float));
    if (radiosity_ && emission_) take_emission();
    return packed_.data();
  }

  // Leaves in `_radiosity` what is reflected.
  void take_emission() {
    for (std::size_t i = 0; i < 3 * sizeof(float); i += sizeof(float)) {
      std::byte* const at = packed_.data() + *radiosity_ + i;
      const float rest = load<float>(at, 0) - load<float>(packed_.data(), *emission_ + i);
      const float reflected = std::max(rest, 0.0F);
      if (std::isfinite(rest)) std::memcpy(at, &reflected, sizeof reflected);
    }
  }

  void finish_block() override {
    if (done_ == count_ && !stream_.at_end())
      stream_.fail_at(stream_.offset(), "the file has more data than its header says");
  }

  void fail_record(const std::string& rule) const override { stream_.fail_at(place_, rule); }

  ByteStream stream_;
  std::uint64_t count_ = 0;
  std::uint32_t channels_ = 0;
  std::size_t floats_ = 0;                           // of all channels in a point
  std::vector<RecordField> fields_;                  // of a packed record
  std::optional<std::size_t> radiosity_, emission_;  // their offsets in it
  std::vector<std::string> notes_;
  std::vector<std::byte> packed_;  // the point that was read last
  std::uint64_t place_ = 0;        // its offset
  std::uint64_t done_ = 0;         // points that were read
};

}  // namespace

PointFile open_ptc(const std::filesystem::path& path) {
  return open_source<PtcSource>(path);
}

}  // namespace ptc
