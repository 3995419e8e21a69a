// Writes clouds as PLY.
//
// A record has the values of the surfel and then those of the columns, each in the type that PLY
// has for it:
//
//   u8 u16 u32   uchar ushort uint          half f32   float
//   i8 i16 i32   char  short  int           u64 i64 f64   double
#include <algorithm>
#include <array>
#include <cctype>
#include <set>
#include <stdexcept>
#include <utility>

#include "engine/io/cloud/checked_writer.h"
#include "engine/io/cloud/display_colour.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/points.h"
#include "engine/io/file/buffered_output.h"

namespace ptc {
namespace {

// The quantities of a surfel that a file holds.
struct SurfelParts {
  bool normal, radius, radiance, albedo, emission;
  bool colour;  // for viewers
};

constexpr std::string_view kSurfelNames[] = {
    "x",          "y",          "z",          "nx",       "ny",       "nz",       "radius",
    "radiance_r", "radiance_g", "radiance_b", "albedo_r", "albedo_g", "albedo_b", "emission_r",
    "emission_g", "emission_b", "red",        "green",    "blue"};

// Returns the names that no column may have. Those of the colours without their ends are among
// them, because a column of three components would repeat a property.
std::set<std::string> taken_names() {
  std::set<std::string> taken(std::begin(kSurfelNames), std::end(kSurfelNames));
  taken.insert("radiance");
  taken.insert("albedo");
  taken.insert("emission");
  return taken;
}

ChannelType ply_type(ChannelType type) {
  switch (type) {
    case ChannelType::half:
      return ChannelType::f32;
    case ChannelType::u64:
    case ChannelType::i64:
      return ChannelType::f64;
    default:
      return type;
  }
}

const char* type_name(ChannelType type) {
  switch (ply_type(type)) {
    case ChannelType::u8:
      return "uchar";
    case ChannelType::i8:
      return "char";
    case ChannelType::u16:
      return "ushort";
    case ChannelType::i16:
      return "short";
    case ChannelType::u32:
      return "uint";
    case ChannelType::i32:
      return "int";
    case ChannelType::f32:
      return "float";
    default:
      return "double";
  }
}

bool is_property_name(const std::string& name) {
  return !name.empty() && std::ranges::all_of(name, [](unsigned char c) {
    return c < 128 && (std::isalnum(c) != 0 || c == '_');
  });
}

// A header in the making.
class Header {
 public:
  explicit Header(std::uint64_t count)
      : text_("ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(count) +
              "\n") {}

  void add(const char* type, const std::string& name) {
    if (!is_property_name(name))
      throw std::invalid_argument("PointWriter: not the name of a PLY property: " + name);
    text_ += std::string("property ") + type + " " + name + "\n";
  }
  void add_surfel(const SurfelParts& parts) {
    const auto add_if = [this](bool wanted, std::initializer_list<const char*> names) {
      for (const char* name : names) {
        if (wanted) add("float", name);
      }
    };
    for (const char* name : {"x", "y", "z"}) add("double", name);
    add_if(parts.normal, {"nx", "ny", "nz"});
    add_if(parts.radius, {"radius"});
    add_if(parts.radiance, {"radiance_r", "radiance_g", "radiance_b"});
    add_if(parts.albedo, {"albedo_r", "albedo_g", "albedo_b"});
    add_if(parts.emission, {"emission_r", "emission_g", "emission_b"});
    if (!parts.colour) return;
    for (const char* name : {"red", "green", "blue"}) add("uchar", name);
  }
  [[nodiscard]] std::string finish() && { return std::move(text_) + "end_header\n"; }

 private:
  std::string text_;
};

void put_surfel(BufferedOutput& out, const SurfelParts& parts, const Surfel& surfel) {
  out.put(&surfel.position, sizeof surfel.position);
  if (parts.normal) out.put(&surfel.normal, sizeof surfel.normal);
  if (parts.radius) out.put(&surfel.radius, sizeof surfel.radius);
  if (parts.radiance) out.put(&surfel.radiance, sizeof surfel.radiance);
  if (parts.albedo) out.put(&surfel.albedo, sizeof surfel.albedo);
  if (parts.emission) out.put(&surfel.emission, sizeof surfel.emission);
}

// A PLY whose columns are channels, each in a type of its own.
class PlyChannelWriter : public CheckedWriter {
 public:
  PlyChannelWriter(const std::filesystem::path& target, const PointWriteInfo& info)
      : CheckedWriter(info.count, row_bytes(info.channels)),
        colour_(info),
        parts_{.normal = info.has_normals,
               .radius = info.has_radius,
               .radiance = info.has_radiance,
               .albedo = info.has_albedo,
               .emission = info.emits,
               .colour = colour_.exists()},
        channels_(colour_.without_bytes(row_channels(info.channels, taken_names()))),
        out_(target) {
    Header header(info.count);
    header.add_surfel(parts_);
    for (const RowChannel& row : channels_) {
      for (const std::string& name : row.parts) header.add(type_name(row.channel.type), name);
    }
    const std::string text = std::move(header).finish();
    out_.put(text.data(), text.size());
  }

 private:
  void put(const Surfel& surfel, const std::byte* row) override {
    put_surfel(out_, parts_, surfel);
    if (parts_.colour) {
      const std::array<std::uint8_t, 3> bytes = colour_.bytes(surfel, row);
      out_.put(bytes.data(), bytes.size());
    }
    for (const RowChannel& channel : channels_) {
      const ChannelType from = channel.channel.type, to = ply_type(from);
      for (std::size_t i = 0; i < channel.channel.components; ++i) {
        std::byte number[8];
        const std::byte* const end = store_number(from, channel.at(row, i), to, number);
        out_.put(number, static_cast<std::size_t>(end - number));
      }
    }
  }
  void end() override { out_.publish(); }

  DisplayColour colour_;
  SurfelParts parts_;
  std::vector<RowChannel> channels_;
  BufferedOutput out_;
};

}  // namespace

std::unique_ptr<PointWriter> create_ply(const std::filesystem::path& target,
                                        const PointWriteInfo& info) {
  return std::make_unique<PlyChannelWriter>(target, info);
}

std::vector<std::string> ply_losses(const PointWriteInfo& info) {
  std::vector<std::string> sentences;
  add_rounded_channels(sentences, info, 53);
  add_unscaled_channels(sentences, info);
  add_lost_crs(sentences, info);
  return sentences;
}

}  // namespace ptc
