// Writes clouds as binary PCD, version 0.7.
//
// A header of text names the fields of a point, each with bytes and kind of a number, then the
// points follow as packed little-endian records. The colour is one field `rgb`, whose bits are
// 0x00RRGGBB but whose kind is float, which is how the Point Cloud Library looks for it.
//
// Points that lie in a grid, row by row, get its WIDTH and HEIGHT in place of the channels `row`
// and `column`. VIEWPOINT is that of the PCD that the points came from.
//
// That library takes x, y and z as floats only. So they are floats where that moves no point by
// more than 1e-4 of the spacing of the points, and doubles elsewhere, such as in a national grid.
#include <set>
#include <string>

#include <fmt/format.h>

#include "engine/io/cloud/checked_writer.h"
#include "engine/io/cloud/display_colour.h"
#include "engine/io/cloud/pcd_header.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/rounding.h"
#include "engine/io/file/buffered_output.h"

namespace ptc {
namespace {

bool has_float_positions(const PointWriteInfo& info) {
  return float_error(info) <= kMostMove * least_spacing(info);
}

// Returns the type in which a file holds the numbers of a channel. PCD has no integers of 64 bits.
ChannelType pcd_type(ChannelType type) {
  if (type == ChannelType::half) return ChannelType::f32;
  if (type == ChannelType::u64 || type == ChannelType::i64) return ChannelType::f64;
  return type;
}

char kind_of(ChannelType type) {
  switch (pcd_type(type)) {
    case ChannelType::u8:
    case ChannelType::u16:
    case ChannelType::u32:
      return 'U';
    case ChannelType::i8:
    case ChannelType::i16:
    case ChannelType::i32:
      return 'I';
    default:
      return 'F';
  }
}

// The four lines of a header that have a word for each field.
struct Fields {
  std::string names, sizes, kinds, counts;

  void add(const std::string& name, std::size_t bytes, char kind) {
    names.append(" ").append(name);
    sizes.append(" ").append(std::to_string(bytes));
    kinds.append(" ").append(1, kind);
    counts.append(" 1");
  }
  void add_floats(std::initializer_list<const char*> of) {
    for (const char* name : of) add(name, sizeof(float), 'F');
  }
};

class PcdWriter : public CheckedWriter {
 public:
  PcdWriter(const std::filesystem::path& target, const PointWriteInfo& info)
      : CheckedWriter(info.count, row_bytes(info.channels)),
        info_(info),
        colour_(info),
        float_positions_(has_float_positions(info)),
        out_(target) {
    find_channels();
    const std::string header = make_header();
    out_.put(header.data(), header.size());
  }

 private:
  // Finds the channels that become fields; bytes of a colour are in the field `rgb` already.
  void find_channels() {
    std::set<std::string> taken{
        "x",        "y",        "z",        "normal",     "normal_x",   "normal_y",   "normal_z",
        "radius",   "rgba",     "radiance", "radiance_r", "radiance_g", "radiance_b", "albedo",
        "albedo_r", "albedo_g", "albedo_b", "emission",   "emission_r", "emission_g", "emission_b"};
    for (const Channel& channel : info_.channels) {
      if (channel.name == "rgb" && channel.components == 1) taken.insert(channel.name);
    }
    channels_ = colour_.without_bytes(row_channels(info_.channels, taken));
    const auto is_cell = [](const RowChannel& row) {
      return row.channel.name == "row" || row.channel.name == "column";
    };
    if (info_.grid) std::erase_if(channels_, is_cell);  // WIDTH and HEIGHT say the same
  }

  // Says whether the albedo has fields of its own, beside a colour of 8 bits. It has none where
  // that colour is all that the points have.
  [[nodiscard]] bool has_albedo_fields() const {
    const bool is_colour = colour_.stored() != nullptr && colour_.stores_bytes();
    return info_.has_albedo && (colour_.hides_albedo() || !is_colour);
  }

  [[nodiscard]] std::string make_header() const {
    Fields fields;
    const std::size_t place_bytes = float_positions_ ? sizeof(float) : sizeof(double);
    for (const char* name : {"x", "y", "z"}) fields.add(name, place_bytes, 'F');
    if (info_.has_normals) fields.add_floats({"normal_x", "normal_y", "normal_z"});
    if (colour_.exists()) fields.add_floats({"rgb"});
    if (info_.has_radius) fields.add_floats({"radius"});
    if (info_.has_radiance) fields.add_floats({"radiance_r", "radiance_g", "radiance_b"});
    if (has_albedo_fields()) fields.add_floats({"albedo_r", "albedo_g", "albedo_b"});
    if (info_.emits) fields.add_floats({"emission_r", "emission_g", "emission_b"});
    for (const RowChannel& channel : channels_) {
      const ChannelType type = channel.channel.type;
      for (const std::string& name : channel.parts)
        fields.add(name, channel_bytes(pcd_type(type)), kind_of(type));
    }
    const PointGrid grid = info_.grid.value_or(PointGrid{.width = info_.count, .height = 1});
    return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS" + fields.names +
           "\nSIZE" + fields.sizes + "\nTYPE" + fields.kinds + "\nCOUNT" + fields.counts +
           "\nWIDTH " + std::to_string(grid.width) + "\nHEIGHT " + std::to_string(grid.height) +
           "\nVIEWPOINT " + viewpoint() + "\nPOINTS " + std::to_string(info_.count) +
           "\nDATA binary\n";
  }
  // Returns the viewpoint of the file that the points came from, or the default.
  [[nodiscard]] std::string viewpoint() const {
    const auto text = info_.text.find(kPcdViewpoint);
    const auto numbers =
        text == info_.text.end() ? std::nullopt : read_pcd_viewpoint(Words(text->second));
    return numbers ? fmt::format("{}", fmt::join(*numbers, " ")) : "0 0 0 1 0 0 0";
  }

  void put(const Surfel& surfel, const std::byte* row) override {
    if (float_positions_) {
      put_value(glm::vec3(surfel.position));
    } else {
      put_value(surfel.position);
    }
    if (info_.has_normals) put_value(surfel.normal);
    if (colour_.exists()) put_value(packed_colour(surfel, row));
    if (info_.has_radius) put_value(surfel.radius);
    if (info_.has_radiance) put_value(surfel.radiance);
    if (has_albedo_fields()) put_value(surfel.albedo);
    if (info_.emits) put_value(surfel.emission);
    for (const RowChannel& channel : channels_) put_channel(channel, row);
  }
  void end() override { out_.publish(); }

  [[nodiscard]] std::uint32_t packed_colour(const Surfel& surfel, const std::byte* row) const {
    std::uint32_t packed = 0;
    for (const std::uint8_t v : colour_.bytes(surfel, row)) packed = packed << 8 | v;
    return packed;
  }
  void put_channel(const RowChannel& channel, const std::byte* row) {
    const ChannelType from = channel.channel.type, to = pcd_type(from);
    for (std::size_t i = 0; i < channel.channel.components; ++i) {
      std::byte number[8];
      const std::byte* const end = store_number(from, channel.at(row, i), to, number);
      out_.put(number, static_cast<std::size_t>(end - number));
    }
  }
  template <typename T>
  void put_value(const T& value) {
    out_.put(&value, sizeof value);
  }

  PointWriteInfo info_;
  DisplayColour colour_;
  bool float_positions_;
  std::vector<RowChannel> channels_;
  BufferedOutput out_;
};

}  // namespace

std::unique_ptr<PointWriter> create_pcd(const std::filesystem::path& target,
                                        const PointWriteInfo& info) {
  return std::make_unique<PcdWriter>(target, info);
}

std::vector<std::string> pcd_losses(const PointWriteInfo& info) {
  std::vector<std::string> sentences;
  if (has_float_positions(info)) {
    add_float_positions(sentences, float_error(info));
  } else {
    sentences.push_back(
        fmt::format("Positions are doubles, since floats would move points by up to {:.2g} units: "
                    "programs that "
                    "know only floats, such as the Point Cloud Library, do not find them.",
                    float_error(info)));
  }
  add_rounded_channels(sentences, info, 53);
  add_unscaled_channels(sentences, info);
  add_lost_crs(sentences, info);
  return sentences;
}

}  // namespace ptc
