// Writes RenderMan point clouds (.ptc).
//
// The layout, all little-endian, as the public files of the format have it:
//
//   "pptc" | version u32 = 0 | points f64 | bounds f32 x 6: low, high
//   world to eye f32 x 16 | eye to screen f32 x 16 | width, height, aspect f32
//   variables u32 | floats of all variables u32 | "float NAME\n" or "color NAME\n" ...
//   points: x y z f32 | phi u16 | z u16 | radius f32 | variables f32 ...
//
// packed_normal.h says what phi and z of a normal mean. What a disc emits and reflects is
// `_radiosity`, and its `_area` is that of the square cell of a surfel: the names under which
// RenderMan looks for them. Points that came from a PTC keep the area that they had there.
#include <algorithm>
#include <string>

#include "engine/io/cloud/checked_writer.h"
#include "engine/io/cloud/display_colour.h"
#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/packed_normal.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/rounding.h"
#include "engine/io/file/buffered_output.h"

namespace ptc {
namespace {

const char* type_name(const Channel& channel) {
  if (channel.components != 3) return "float";
  if (channel.role == ChannelRole::direction) return "normal";
  return has_axes(channel) ? "vector" : "color";
}

constexpr const char* kArea = "_area";

bool is_area(const RowChannel& row) {
  return row.name == kArea && row.channel.components == 1;
}

class PtcWriter : public CheckedWriter {
 public:
  PtcWriter(const std::filesystem::path& target, const PointWriteInfo& info)
      : CheckedWriter(info.count, row_bytes(info.channels)),
        info_(info),
        colour_(info),
        channels_(colour_.without_stored(
            row_channels(info.channels, {"_radiosity", "_albedo", "_emission"}))),
        has_own_area_(std::ranges::any_of(channels_, &is_area)),
        out_(target) {
    declare_variables();
    const std::vector<std::byte> header = make_header();
    out_.put(header.data(), header.size());
    out_.put(variables_.data(), variables_.size());
  }

 private:
  // Lists the variables; a channel of three is one, the components of others are one each.
  void declare_variables() {
    if (makes_area()) declare("float", kArea, 1);
    if (info_.has_radiance || info_.emits) declare("color", "_radiosity", 3);
    if (colour_.exists()) declare("color", "_albedo", 3);
    if (info_.emits) declare("color", "_emission", 3);
    for (const RowChannel& channel : channels_) {
      if (channel.channel.components == 3) {
        declare(type_name(channel.channel), channel.name, 3);
        continue;
      }
      for (const std::string& name : channel.parts) declare("float", name, 1);
    }
  }
  void declare(const char* type, const std::string& name, std::uint32_t floats) {
    variables_ += std::string(type) + " " + name + "\n";
    ++variable_count_;
    float_count_ += floats;
  }

  [[nodiscard]] std::vector<std::byte> make_header() const {
    std::vector<std::byte> bytes;
    for (const char c : {'p', 'p', 't', 'c'}) append_value(bytes, c);
    append_value(bytes, std::uint32_t{0});
    append_value(bytes, static_cast<double>(info_.count));
    const Bounds box = info_.bounds.empty() ? Bounds{glm::dvec3(0), glm::dvec3(0)} : info_.bounds;
    for (const glm::dvec3& corner : {box.low, box.high}) {
      for (int i = 0; i < 3; ++i) append_value(bytes, static_cast<float>(corner[i]));
    }
    for (int matrix = 0; matrix < 2; ++matrix) {  // no camera: both are the identity
      for (int i = 0; i < 16; ++i) append_value(bytes, i % 5 == 0 ? 1.0F : 0.0F);
    }
    for (const float size : {640.0F, 480.0F, 1.0F}) append_value(bytes, size);
    append_value(bytes, variable_count_);
    append_value(bytes, float_count_);
    return bytes;
  }

  void put(const Surfel& surfel, const std::byte* row) override {
    const PackedNormal normal = pack_normal(info_.has_normals ? surfel.normal : glm::vec3(0));
    put_value(glm::vec3(surfel.position));
    put_value(normal);
    put_value(info_.has_radius ? surfel.radius : 0.0F);
    if (makes_area()) put_value(2 * surfel.radius * surfel.radius);
    if (info_.has_radiance || info_.emits) put_value(surfel.outgoing());
    if (colour_.exists()) put_value(colour_.linear(surfel, row));
    if (info_.emits) put_value(surfel.emission);
    for (const RowChannel& channel : channels_) {
      if (info_.has_radius && is_area(channel) && is_unknown(channel.channel, channel.at(row, 0))) {
        put_value(2 * surfel.radius * surfel.radius);
        continue;
      }
      for (std::size_t i = 0; i < channel.channel.components; ++i) {
        put_value(static_cast<float>(load_number(channel.at(row, i), channel.channel.type)));
      }
    }
  }
  void end() override { out_.publish(); }

  template <typename T>
  void put_value(const T& value) {
    out_.put(&value, sizeof value);
  }

  [[nodiscard]] bool makes_area() const noexcept { return info_.has_radius && !has_own_area_; }

  PointWriteInfo info_;
  DisplayColour colour_;
  std::vector<RowChannel> channels_;
  bool has_own_area_;      // among the channels
  std::string variables_;  // their declarations
  std::uint32_t variable_count_ = 0;
  std::uint32_t float_count_ = 0;
  BufferedOutput out_;
};

}  // namespace

std::unique_ptr<PointWriter> create_ptc(const std::filesystem::path& target,
                                        const PointWriteInfo& info) {
  return std::make_unique<PtcWriter>(target, info);
}

std::vector<std::string> ptc_losses(const PointWriteInfo& info) {
  std::vector<std::string> sentences;
  add_float_positions(sentences, float_error(info));
  if (info.has_normals && (!info.rounding || info.rounding->normals))
    sentences.push_back("Normals are rounded to 16 bits for each of two angles.");
  add_rounded_channels(sentences, info, 24);
  add_unscaled_channels(sentences, info);
  add_lost_crs(sentences, info);
  return sentences;
}

}  // namespace ptc
