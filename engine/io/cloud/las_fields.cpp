// The fields of a LAS point record, as channels.
//
//   formats 0 to 5    x y z 12 | intensity 2 | returns 1 | class 1 | angle user source time rgb ...
//   formats 6 to 10   x y z 12 | intensity 2 | returns 1 | flags 1 | class 1 | user angle source
//   ... row               intensity 2 | return, returns, direction, edge, class, flags, 1 each |
//                     [channel 1] | the rest of the record as it is
//
// Fields that share a byte become a channel each. The rest of a record, from the byte behind the
// classification on, is copied as it is but for what is part of the surfel, so its channels stand
// in the order of the record. Extra bytes are what a record has beyond its format; a record of the
// file describes them:
//
//   offset  size  of 192 bytes for each field        offset  size
//        2     1  type: 0 any bytes, 1 u8, 2 i8,         40     8  no-data value, as u64, i64 or
//        f64
//                 ... 8 i64, 9 f32, 10 f64; + 10 for    112    24  scales f64
//                 pairs, + 20 for triples               136    24  offsets f64
//        3     1  options: bit 0 no data, 3 scale,      160    32  description
//                 4 offset; of type 0 the bytes
//        4    32  name
//
// Source: LAS Specification 1.4 R15, tables 7 to 17 and 24 to 26; types 11 to 30 in R13.
#include "engine/io/cloud/las_fields.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "engine/io/cloud/channel_names.h"
#include "engine/io/cloud/formats.h"
#include "engine/io/laz/layout.h"
#include "format/bytes.h"

namespace ptc {
namespace {

constexpr std::size_t kDescriptionBytes = 192;
constexpr std::size_t kMaxComponents = 16;  // of a channel
constexpr unsigned kNoDataOption = 1;
constexpr unsigned kScaleOption = 8;
constexpr unsigned kOffsetOption = 16;
constexpr unsigned kMaxType = 30;

constexpr std::array<ChannelType, 10> kTypes = {
    ChannelType::u8,  ChannelType::i8,  ChannelType::u16, ChannelType::i16, ChannelType::u32,
    ChannelType::i32, ChannelType::u64, ChannelType::i64, ChannelType::f32, ChannelType::f64};

// A field of the extra bytes as it is described.
struct Described {
  std::span<const std::byte> description;
  std::string name;
  std::size_t offset = 0;      // in the record
  std::size_t bytes = 0;       // of the record
  ChannelType type{};          // of its numbers
  std::size_t components = 0;  // 0 for bytes of no type
  bool in_surfel = false;      // it is part of the surfel
};

// Collects the fields of a file.
class FieldList {
 public:
  explicit FieldList(const LasHeader& header) : header_(header) {}

  LasFields make(std::span<const std::byte> descriptions) {
    add_core();
    add_optional();
    add_extra(descriptions);
    return std::move(list_);
  }

 private:
  Channel& add(const std::string& name, ChannelType type, ChannelRole role = ChannelRole::value) {
    Channel channel;
    channel.name = channel_name(name, list_.channels);
    channel.type = type;
    channel.role = role;
    list_.channels.push_back(channel);
    return list_.channels.back();
  }

  void note(const std::string& sentence) { list_.notes.push_back(sentence); }

  void add_core() {
    add("intensity", ChannelType::u16);
    add("return_number", ChannelType::u8);
    add("number_of_returns", ChannelType::u8);
    add("scan_direction", ChannelType::u8);
    add("edge_of_flight_line", ChannelType::u8);
    add("classification", ChannelType::u8, ChannelRole::label);
    add("class_flags", ChannelType::u8, ChannelRole::label);
    if (header_.format >= 6) {
      add("scanner_channel", ChannelType::u8);
      add("user_data", ChannelType::u8);
      Channel& angle = add("scan_angle", ChannelType::i16);
      angle.unit = "deg";
      angle.scale = 0.006;
    } else {
      add("scan_angle", ChannelType::i8).unit = "deg";
      add("user_data", ChannelType::u8);
    }
    add("point_source_id", ChannelType::u16, ChannelRole::label);
  }

  void add_optional() {
    if (laz::has_time(header_.format))
      add("gps_time", ChannelType::f64, ChannelRole::time).unit = std::string("s");
    if (laz::has_rgb(header_.format)) {
      Channel& rgb = add("rgb", ChannelType::u16, ChannelRole::colour);
      rgb.components = 3;
      rgb.colour_space = ColourSpace::srgb;
    }
    if (laz::has_nir(header_.format)) add("nir", ChannelType::u16);
    if (!laz::has_wave_packet(header_.format)) return;
    add("wave_descriptor", ChannelType::u8, ChannelRole::label);
    add("wave_offset", ChannelType::u64);
    add("wave_bytes", ChannelType::u32);
    add("wave_return", ChannelType::f32).unit = "ps";
    Channel& direction = add("wave_direction", ChannelType::f32, ChannelRole::vector);
    direction.components = 3;
    note("The waveforms are not read; the points keep the fields that refer to them.");
  }

  void add_extra(std::span<const std::byte> descriptions) {
    // Read the descriptions
    std::size_t left = header_.record_bytes - laz::format_bytes(header_.format);
    std::vector<Described> fields;
    bool all_fit = descriptions.size() % kDescriptionBytes == 0;
    for (; all_fit && descriptions.size() >= kDescriptionBytes;
         descriptions = descriptions.subspan(kDescriptionBytes)) {
      all_fit = describe(descriptions.first(kDescriptionBytes), left, fields);
    }
    if (!all_fit)
      note(
          "The record that describes the extra bytes does not fit them; what does not is ignored.");

    // Choose those of the surfel; the others become channels
    find_surfel(fields);
    for (const Described& field : fields) {
      if (field.in_surfel) continue;
      const std::size_t before = list_.channels.size();
      if (field.components == 0) {
        add_bytes(field.name, field.bytes);
      } else {
        add_numbers(field.name, field.type, field.components, field.description);
      }
      keep_names(field, before);
    }
    if (left == 0) return;
    note(std::to_string(left) +
         " extra bytes of each point are not described; they are kept as bytes.");
    add_bytes("extra_bytes", left);
  }

  // Appends a described field and takes it off the bytes that are left. Returns false when it does
  // not fit.
  [[nodiscard]] bool describe(std::span<const std::byte> description, std::size_t& left,
                              std::vector<Described>& fields) const {
    const unsigned type = load<std::uint8_t>(description.data(), 2);
    if (type > kMaxType) return false;
    Described field{.description = description, .offset = header_.record_bytes - left};
    field.name.assign(reinterpret_cast<const char*>(description.data()) + 4, 32);
    field.name.resize(std::min(field.name.find('\0'), field.name.size()));
    if (field.name.empty()) field.name = "extra_bytes";
    if (type == 0) {
      field.bytes = load<std::uint8_t>(description.data(), 3);
    } else {
      field.type = kTypes[(type - 1) % kTypes.size()];
      field.components = (type - 1) / kTypes.size() + 1;
      field.bytes = field.components * channel_bytes(field.type);
    }
    if (field.bytes > left) return false;
    left -= field.bytes;
    fields.push_back(std::move(field));
    return true;
  }

  void find_surfel(std::vector<Described>& fields) {
    const auto triple = [&](const std::array<std::string_view, 3>& names) {
      std::optional<LasTriple> numbers;
      std::array<Described*, 3> at{};
      for (std::size_t i = 0; i < 3; ++i) at[i] = find_number(fields, names[i]);
      if (std::ranges::find(at, nullptr) != at.end()) return numbers;
      numbers.emplace();
      for (std::size_t i = 0; i < 3; ++i) (*numbers)[i] = take_number(*at[i]);
      return numbers;
    };
    LasSurfel& surfel = list_.surfel;
    surfel.normal = triple({"nx", "ny", "nz"});
    surfel.radiance = triple({"radiance_r", "radiance_g", "radiance_b"});
    surfel.emission = triple({"emission_r", "emission_g", "emission_b"});
    surfel.albedo = triple({"albedo_r", "albedo_g", "albedo_b"});
    if (Described* const radius = find_number(fields, "radius"))
      surfel.radius = take_number(*radius);
  }

  // Returns the field that may be this number of the surfel; null when there is none.
  static Described* find_number(std::vector<Described>& fields, std::string_view name) {
    const auto found = std::ranges::find_if(fields, [&](const Described& field) {
      if (field.components != 1 || surfel_name(field.name) != name) return false;
      const Channel number = number_of(field.type, field.description, 0);
      return field.type == ChannelType::f32 || field.type == ChannelType::f64 || number.scale != 1;
    });
    return found == fields.end() ? nullptr : &*found;
  }

  // Keeps what the file calls a field whose channels are those from `first` on.
  void keep_names(const Described& field, std::size_t first) {
    const bool one = list_.channels.size() - first == 1;
    for (std::size_t i = first; i < list_.channels.size(); ++i) {
      list_.names.push_back(
          {.channel = list_.channels[i].name,
           .name = one ? field.name : field.name + "_" + std::to_string(i - first),
           .description = description_of(field)});
    }
  }

  static std::string description_of(const Described& field) {
    const std::string text(reinterpret_cast<const char*>(field.description.data()) + 160, 32);
    return text.substr(0, text.find('\0'));
  }

  LasNumber take_number(Described& field) {
    field.in_surfel = true;
    list_.names.push_back({.channel = std::string(*surfel_name(field.name)),
                           .name = field.name,
                           .description = description_of(field)});
    return {field.offset, number_of(field.type, field.description, 0)};
  }

  // Returns type, scale, offset and no-data value of a number of a described field.
  static Channel number_of(ChannelType type, std::span<const std::byte> description,
                           std::size_t component) {
    Channel channel;
    channel.type = type;
    const unsigned options = load<std::uint8_t>(description.data(), 3);
    const auto scale = load<double>(description.data(), 112 + 8 * component);
    const auto offset = load<double>(description.data(), 136 + 8 * component);
    if ((options & kScaleOption) != 0 && std::isfinite(scale) && scale != 0) channel.scale = scale;
    if ((options & kOffsetOption) != 0 && std::isfinite(offset)) channel.offset = offset;
    if ((options & kNoDataOption) != 0)
      channel.no_value = no_value(description, 40 + 8 * component, type);
    return channel;
  }

  // Adds a field of one to three numbers: one channel, or one for each number when their scales,
  // offsets or no-data values differ.
  void add_numbers(const std::string& name, ChannelType type, std::size_t components,
                   std::span<const std::byte> description) {
    std::vector<Channel> numbers;
    for (std::size_t i = 0; i < components; ++i) numbers.push_back(number_of(type, description, i));
    const bool alike =
        std::ranges::all_of(numbers, [&](const Channel& c) { return c == numbers[0]; });
    if (alike) numbers.resize(1);
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      Channel& channel = numbers[i];
      channel.components = static_cast<std::uint8_t>(alike ? components : 1);
      channel.name = channel_name(alike ? name : name + "_" + std::to_string(i), list_.channels);
      list_.channels.push_back(channel);
    }
  }

  // Returns the bits of the value that stands for "not known", or nothing when the type has no such
  // value.
  static std::optional<std::uint64_t> no_value(std::span<const std::byte> description,
                                               std::size_t at, ChannelType type) {
    const auto bits = load<std::uint64_t>(description.data(), at);
    const auto number = load<double>(description.data(), at);
    if (type == ChannelType::f64) return bits;
    if (type == ChannelType::f32) {
      const auto narrow = static_cast<float>(number);
      std::uint32_t narrow_bits = 0;
      std::memcpy(&narrow_bits, &narrow, sizeof narrow);
      return narrow_bits;
    }
    const unsigned width = static_cast<unsigned>(8 * channel_bytes(type));
    if (width == 64) return bits;
    const std::uint64_t mask = (std::uint64_t{1} << width) - 1;
    const bool is_signed =
        type == ChannelType::i8 || type == ChannelType::i16 || type == ChannelType::i32;
    const bool negative = is_signed && (bits >> (width - 1) & 1) != 0;
    const std::uint64_t extended = negative ? bits | ~mask : bits & mask;
    if (extended != bits) return std::nullopt;
    return bits & mask;
  }

  void add_bytes(const std::string& name, std::size_t bytes) {
    for (std::size_t done = 0; done < bytes; done += kMaxComponents) {
      add(name, ChannelType::u8).components =
          static_cast<std::uint8_t>(std::min(kMaxComponents, bytes - done));
    }
  }

  const LasHeader& header_;
  LasFields list_;
};

}  // namespace

LasFields make_las_fields(const LasHeader& header, std::span<const std::byte> descriptions) {
  return FieldList(header).make(descriptions);
}

std::vector<LasNumber> LasSurfel::numbers() const {
  std::vector<LasNumber> all;
  for (const auto& triple : {normal, radiance, emission, albedo}) {
    if (triple) all.insert(all.end(), triple->begin(), triple->end());
  }
  if (radius) all.push_back(*radius);
  std::ranges::sort(all, {}, &LasNumber::offset);
  return all;
}

LasRows::LasRows(const LasHeader& header, const LasSurfel& surfel)
    : layered_(header.format >= 6), row_bytes_(layered_ ? 9 : 8) {
  // Copy the rest of the record, but jump over the numbers of the surfel
  std::size_t from = layered_ ? 17 : 16;
  const auto copy_until = [&](std::size_t end) {
    if (end > from) runs_.push_back({from, row_bytes_, end - from});
    row_bytes_ += end - from;
  };
  for (const LasNumber& number : surfel.numbers()) {
    copy_until(number.offset);
    from = number.offset + number.channel.bytes();
  }
  copy_until(header.record_bytes);
}

void LasRows::write(const std::byte* record, std::byte* row) const noexcept {
  const auto byte_at = [record](std::size_t at) { return std::to_integer<unsigned>(record[at]); };
  const unsigned returns = byte_at(14);
  const unsigned third = byte_at(15);
  std::memcpy(row, record + 12, 2);
  const auto put = [row](std::size_t at, unsigned value) {
    row[at] = static_cast<std::byte>(value);
  };
  if (layered_) {  // third: flags of the class, 4 bits; channel, 2; direction; edge
    put(2, returns & 15);
    put(3, returns >> 4);
    put(4, third >> 6 & 1);
    put(5, third >> 7);
    put(6, byte_at(16));
    put(7, third & 15);
    put(8, third >> 4 & 3);
  } else {  // third: class, 5 bits; its flags, 3
    put(2, returns & 7);
    put(3, returns >> 3 & 7);
    put(4, returns >> 6 & 1);
    put(5, returns >> 7);
    put(6, third & 31);
    put(7, third >> 5);
  }
  for (const Run& run : runs_) std::memcpy(row + run.to, record + run.from, run.bytes);
}

}  // namespace ptc
