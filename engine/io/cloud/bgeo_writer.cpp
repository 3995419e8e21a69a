// Writes Houdini's classic binary geometry (.bgeo), version 5: points without primitives.
//
// The layout, all big-endian:
//
//   "BgeoV" | version 5 | points | primitives | point groups | primitive groups
//           | attributes of points | of vertices | of primitives | of the whole: i32 each
//   attributes of points: name bytes u16 | name | numbers u16 | kind i32 | defaults, 4 bytes each
//   points: x y z w f32 | the numbers of all attributes, 4 bytes each
//   0x00 0xff
//
// Kinds are 0 float, 1 integer, 5 vector: three floats that turn with the object. The names N, Cd
// and pscale are those under which Houdini looks for normals, colours and sizes. Points that came
// from a BGEO keep the names that their attributes had there, and a channel `rgb` of linear floats,
// which is Cd as it was read, becomes Cd again.
#include <algorithm>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/checked_writer.h"
#include "engine/io/cloud/display_colour.h"
#include "engine/io/cloud/geo_header.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/rounding.h"
#include "engine/io/file/buffered_output.h"

namespace ptc {
namespace {

enum class Kind : std::uint32_t { number = 0, integer = 1, vector = 5 };

constexpr std::uint64_t kMostPoints = std::numeric_limits<std::int32_t>::max();

// Bytes in the order of the file, the highest first.
class BigEndian {
 public:
  void add(std::uint16_t v) { add_bytes(v, 2); }
  void add(std::uint32_t v) { add_bytes(v, 4); }
  void add(float v) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &v, sizeof bits);
    add(bits);
  }
  void add(const glm::vec3& v) {
    for (int i = 0; i < 3; ++i) add(v[i]);
  }
  void add(const std::string& text) { bytes_ += text; }
  void clear() noexcept { bytes_.clear(); }
  [[nodiscard]] const std::string& bytes() const noexcept { return bytes_; }

 private:
  void add_bytes(std::uint32_t v, int count) {
    while (count-- > 0) bytes_ += static_cast<char>(v >> 8 * count & 0xff);
  }
  std::string bytes_;
};

// Returns the names that the attributes had in a BGEO, by what they became.
std::map<std::string, std::string> original_names(const PointWriteInfo& info) {
  std::map<std::string, std::string> names;
  const auto text = info.text.find(kGeoNames);
  if (text == info.text.end()) return names;
  const auto json = nlohmann::json::parse(text->second, nullptr, false);
  if (!json.is_object()) return names;
  for (const auto& [key, name] : json.items()) {
    if (name.is_string()) names[key] = name.get<std::string>();
  }
  return names;
}

class BgeoWriter : public CheckedWriter {
 public:
  BgeoWriter(const std::filesystem::path& target, const PointWriteInfo& info)
      : CheckedWriter(info.count, row_bytes(info.channels)),
        info_(info),
        colour_(info),
        channels_(colour_.without_stored(row_channels(info.channels, taken_))),
        names_(original_names(info)),
        out_(target) {
    find_colour();
    declare_attributes();
    BigEndian header;
    header.add("BgeoV");
    for (const std::uint32_t v :
         {5U, static_cast<std::uint32_t>(info.count), 0U, 0U, 0U, attribute_count_, 0U, 0U, 0U}) {
      header.add(v);
    }
    header.add(attributes_.bytes());
    out_.put(header.bytes().data(), header.bytes().size());
  }

 private:
  [[nodiscard]] bool has_own_albedo() const { return info_.has_albedo && colour_.hides_albedo(); }

  // Takes the channel that becomes Cd from the others.
  void find_colour() {
    const auto found = std::ranges::find_if(
        channels_, [](const RowChannel& row) { return is_linear_colour(row.channel); });
    if (found == channels_.end() || !info_.has_albedo || has_own_albedo()) return;
    linear_ = std::move(*found);
    channels_.erase(found);
  }

  void declare_attributes() {
    for (const RowChannel& row : channels_) taken_.insert(row.name);
    if (info_.has_normals) declare(name_of("nx", "N"), 3, Kind::vector);
    if (colour_.exists()) declare("Cd", 3, Kind::number);
    if (info_.has_radius) declare(name_of("radius", "pscale"), 1, Kind::number);
    if (info_.has_radiance) declare(name_of("radiance_r", "radiance"), 3, Kind::number);
    if (has_own_albedo()) declare("albedo", 3, Kind::number);
    if (info_.emits) declare(name_of("emission_r", "emission"), 3, Kind::number);
    for (const RowChannel& row : channels_) {
      const Channel& channel = row.channel;
      const bool vector = channel.components == 3 && has_axes(channel);
      declare(name_of(channel.name, row.name), channel.components,
              is_integer(channel.type) ? Kind::integer
              : vector                 ? Kind::vector
                                       : Kind::number);
    }
  }
  // Returns the name that a quantity had in a BGEO, if it is free, else another.
  std::string name_of(const std::string& quantity, const std::string& otherwise) {
    const auto was = names_.find(quantity);
    const bool fits = was != names_.end() && !was->second.empty() &&
                      was->second.size() <= std::numeric_limits<std::uint16_t>::max();
    return fits && taken_.insert(was->second).second ? was->second : otherwise;
  }
  void declare(const std::string& name, std::uint16_t numbers, Kind kind) {
    attributes_.add(static_cast<std::uint16_t>(name.size()));
    attributes_.add(name);
    attributes_.add(numbers);
    attributes_.add(static_cast<std::uint32_t>(kind));
    for (std::uint16_t i = 0; i < numbers; ++i) attributes_.add(std::uint32_t{0});  // its defaults
    ++attribute_count_;
  }

  void put(const Surfel& surfel, const std::byte* row) override {
    point_.clear();
    point_.add(glm::vec3(surfel.position));
    point_.add(1.0F);
    if (info_.has_normals) point_.add(surfel.normal);
    if (colour_.exists()) point_.add(colour_of(surfel, row));
    if (info_.has_radius) point_.add(surfel.radius);
    if (info_.has_radiance) point_.add(surfel.radiance);
    if (has_own_albedo()) point_.add(surfel.albedo);
    if (info_.emits) point_.add(surfel.emission);
    for (const RowChannel& channel : channels_) {
      const ChannelType from = channel.channel.type;
      const ChannelType to = is_integer(from) ? ChannelType::i32 : ChannelType::f32;
      for (std::size_t i = 0; i < channel.channel.components; ++i) {
        std::byte number[4];
        store_number(from, channel.at(row, i), to, number);
        std::uint32_t bits = 0;
        std::memcpy(&bits, number, sizeof bits);
        point_.add(bits);
      }
    }
    out_.put(point_.bytes().data(), point_.bytes().size());
  }
  void end() override {
    const char extra[] = {'\x00', '\xff'};  // the end of a part that no attribute needs
    out_.put(extra, sizeof extra);
    out_.publish();
  }

  [[nodiscard]] glm::vec3 colour_of(const Surfel& surfel, const std::byte* row) const {
    if (!linear_ || is_unknown(linear_->channel, linear_->at(row, 0)))
      return colour_.linear(surfel, row);
    glm::vec3 colour;
    std::memcpy(&colour, linear_->at(row, 0), sizeof colour);
    return colour;
  }

  PointWriteInfo info_;
  DisplayColour colour_;
  std::set<std::string> taken_{"N",        "Cd",     "pscale", "radiance",
                               "emission", "albedo", "P",      "Pw"};  // names of attributes
  std::vector<RowChannel> channels_;          // that become attributes of their own
  std::optional<RowChannel> linear_;          // becomes Cd
  std::map<std::string, std::string> names_;  // by quantity
  BigEndian attributes_;
  std::uint32_t attribute_count_ = 0;
  BigEndian point_;
  BufferedOutput out_;
};

}  // namespace

bool is_linear_colour(const Channel& channel) noexcept {
  return channel.name == "rgb" && channel.components == 3 && channel.type == ChannelType::f32 &&
         channel.colour_space == ColourSpace::rec709 && !is_scaled(channel);
}

std::unique_ptr<PointWriter> create_bgeo(const std::filesystem::path& target,
                                         const PointWriteInfo& info) {
  if (info.count > kMostPoints) {
    throw RequestError("target", "a .bgeo holds at most 2,147,483,647 points");
  }
  return std::make_unique<BgeoWriter>(target, info);
}

std::vector<std::string> bgeo_losses(const PointWriteInfo& info) {
  std::vector<std::string> sentences;
  add_float_positions(sentences, float_error(info));
  for (const Channel& channel : info.channels) {
    if (!may_round(info, channel)) continue;
    if (channel.type == ChannelType::f64) {
      sentences.push_back("The channel " + channel.name + " is rounded from double to float.");
    } else if (channel.type == ChannelType::u32 || channel.type == ChannelType::u64 ||
               channel.type == ChannelType::i64) {
      sentences.push_back("Integers of the channel " + channel.name +
                          " that do not fit 32 bits with a sign are cut to the nearest that does.");
    }
  }
  add_unscaled_channels(sentences, info);
  add_lost_crs(sentences, info);
  return sentences;
}

}  // namespace ptc
