// Writes clouds as text: a comment with the names of the columns, then a line for each point.
// Numbers without a scale read back to the same bits.
//
// Text cannot name a scale, so scaled values are written as what they mean. They have 15 digits,
// one or two fewer than a double: integers in steps of 0.1 are 66.6, not 66.60000000000001.
#include <cmath>
#include <iterator>
#include <string>

#include <fmt/format.h>

#include "engine/io/cloud/checked_writer.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/rounding.h"
#include "engine/io/file/buffered_output.h"

namespace ptc {
namespace {

class XyzWriter : public CheckedWriter {
 public:
  XyzWriter(const std::filesystem::path& target, const PointWriteInfo& info)
      : CheckedWriter(info.count, row_bytes(info.channels)), info_(info), out_(target) {
    std::string names = "# x y z";
    if (info.has_normals) names += " nx ny nz";
    if (info.has_radius) names += " radius";
    if (info.has_radiance) names += " radiance_r radiance_g radiance_b";
    if (info.has_albedo) names += " albedo_r albedo_g albedo_b";
    if (info.emits) names += " emission_r emission_g emission_b";
    channels_ = row_channels(
        info.channels, {"x", "y", "z", "nx", "ny", "nz", "radius", "radiance", "radiance_r",
                        "radiance_g", "radiance_b", "albedo", "albedo_r", "albedo_g", "albedo_b",
                        "emission", "emission_r", "emission_g", "emission_b"});
    for (const RowChannel& channel : channels_) {
      for (const std::string& name : channel.parts) names += " " + name;
    }
    names += '\n';
    out_.put(names.data(), names.size());
  }

 private:
  void put(const Surfel& surfel, const std::byte* row) override {
    line_.clear();
    add(surfel.position);
    if (info_.has_normals) add(surfel.normal);
    if (info_.has_radius) add(surfel.radius);
    if (info_.has_radiance) add(surfel.radiance);
    if (info_.has_albedo) add(surfel.albedo);
    if (info_.emits) add(surfel.emission);
    for (const RowChannel& channel : channels_) {
      for (std::size_t i = 0; i < channel.channel.components; ++i)
        add_value(channel.channel, channel.at(row, i));
    }
    line_.back() = '\n';
    out_.put(line_.data(), line_.size());
  }
  void end() override { out_.publish(); }

  // Appends a number and a blank.
  template <typename T>
  void add(T value) {
    fmt::format_to(std::back_inserter(line_), "{} ", value);
  }
  void add(const glm::vec3& v) {
    for (int i = 0; i < 3; ++i) add(v[i]);
  }
  void add(const glm::dvec3& v) {
    for (int i = 0; i < 3; ++i) add(v[i]);
  }
  void add_value(const Channel& channel, const std::byte* at) {
    const ChannelType type = channel.type;
    if (is_scaled(channel)) {
      add_scaled(channel, at);
    } else if (type == ChannelType::u64) {
      std::uint64_t value = 0;
      store_number(type, at, type, reinterpret_cast<std::byte*>(&value));
      add(value);
    } else if (is_integer(type)) {
      add(load_integer(type, at));
    } else if (type == ChannelType::f64) {
      add(load_number(at, type));
    } else {
      add(static_cast<float>(load_number(at, type)));
    }
  }

  // Appends what a stored value means; NaN where it is not known.
  void add_scaled(const Channel& channel, const std::byte* at) {
    const double value = meaning_of(channel, at).value_or(std::nan(""));
    fmt::format_to(std::back_inserter(line_), "{:.15g} ", value);
  }

  PointWriteInfo info_;
  std::vector<RowChannel> channels_;
  std::string line_;
  BufferedOutput out_;
};

}  // namespace

std::unique_ptr<PointWriter> create_xyz(const std::filesystem::path& target,
                                        const PointWriteInfo& info) {
  return std::make_unique<XyzWriter>(target, info);
}

std::vector<std::string> xyz_losses(const PointWriteInfo& info) {
  std::vector<std::string> sentences;
  for (const Channel& channel : info.channels) {
    const bool wide = channel.type == ChannelType::f64 || channel.type == ChannelType::u64 ||
                      channel.type == ChannelType::i64;
    if (!wide || !is_scaled(channel)) continue;
    if (channel.type != ChannelType::f64 && !may_round(info, channel)) continue;
    sentences.push_back("Values of the channel " + channel.name +
                        ", which has a scale, are rounded to 15 digits.");
  }
  add_lost_crs(sentences, info);
  return sentences;
}

}  // namespace ptc
