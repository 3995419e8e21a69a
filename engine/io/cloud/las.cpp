// Reads clouds from LAS, LAZ and COPC.
//
//   header, records  -->  facts, texts, fields                          (las_header, las_crs ...)
//   points           -->  records  -->  position, colour, parts in extra bytes  -->  surfel
//                                  -->  row of attributes               (las_records, las_fields)
//
// Colours have fields of 16 bits, but many programs write values of 8 bits into them. No field says
// which, so a sample of the points decides before the first one is returned: colours that are all
// at most 255 are taken as 8 bits. A colour that contradicts this later ends the reading, because
// the points before it were read wrongly.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/las_crs.h"
#include "engine/io/cloud/las_fields.h"
#include "engine/io/cloud/las_header.h"
#include "engine/io/cloud/las_records.h"
#include "engine/io/cloud/las_texts.h"
#include "engine/io/cloud/las_vlrs.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/surfel_check.h"
#include "engine/io/image/srgb.h"
#include "engine/io/laz/layout.h"

namespace ptc {
namespace {

constexpr std::string_view kSpecUser = "LASF_Spec";
constexpr unsigned kExtraBytesNumber = 4;
constexpr std::size_t kSampleStride = 16;  // every so many records of the sample give a position
constexpr std::size_t kMaxRowsBytes = std::size_t{1} << 24;  // returned at once

// How the colours of a file are to be understood.
enum class Colours { none, black, eight_bits, sixteen_bits };

// The place of the colour in a record of a format that has one.
std::size_t rgb_place(unsigned format) {
  if (format >= 6) return 30;
  return laz::has_time(format) ? 28 : 20;
}

std::array<std::uint16_t, 3> rgb_at(const std::byte* record, std::size_t place) {
  std::array<std::uint16_t, 3> rgb{};
  std::memcpy(rgb.data(), record + place, sizeof rgb);
  return rgb;
}

std::string shortest(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return {text.data(), end};
}

double largest_side(const Bounds& box) {
  const glm::dvec3 sides = box.high - box.low;
  return std::max({sides.x, sides.y, sides.z});
}

// Returns the linear value of each stored one from 0 to `most`.
std::vector<double> tabulate_srgb(std::size_t most) {
  std::vector<double> curve(most + 1);
  for (std::size_t i = 0; i <= most; ++i)
    curve[i] = srgb_to_linear(static_cast<double>(i) / static_cast<double>(most));
  return curve;
}

class LasSource : public PointSource {
 public:
  explicit LasSource(const std::filesystem::path& path)
      : file_(path),
        header_(read_las_header(file_)),
        fields_(read_fields(file_, header_)),
        rows_of_(header_, fields_.surfel),
        records_(open_las_records(file_, header_)) {
    look_at_colours();
    static const std::vector<double> narrow = tabulate_srgb(255);
    static const std::vector<double> wide = tabulate_srgb(65535);
    if (colours_ == Colours::eight_bits) curve_ = narrow;
    if (colours_ == Colours::sixteen_bits) curve_ = wide;
  }

  // Returns the facts about the file.
  [[nodiscard]] PointFileInfo info() const {
    PointFileInfo info;
    info.format = format_name();
    info.stated_bounds = stated_bounds();
    info.count = header_.points;
    const LasSurfel& surfel = fields_.surfel;
    info.has_normals = surfel.normal.has_value();
    info.has_radius = surfel.radius.has_value();
    info.has_radiance = surfel.radiance.has_value();
    info.has_emission = surfel.emission.has_value();
    info.has_albedo = surfel.albedo.has_value() || !curve_.empty();
    info.channels = fields_.channels;
    if (colours_ == Colours::eight_bits)
      std::ranges::find(info.channels, "rgb", &Channel::name)->scale = kByteScale;
    info.notes = fields_.notes;
    add_texts(info);
    if (colours_ == Colours::eight_bits) {
      info.notes.emplace_back(
          "The colours are taken as 8 bits: no point that was looked at has one above 255.");
    } else if (colours_ == Colours::black) {
      info.notes.emplace_back(
          "All colours that were looked at are 0, so the points are taken to have no colour.");
    }
    return info;
  }

  std::size_t next(std::span<Surfel> out) override {
    rows_.clear();
    if (block_.records.empty()) block_ = records_->next();
    const std::size_t record_bytes = header_.record_bytes;
    const std::size_t count = std::min(
        {out.size(), block_.records.size() / record_bytes, kMaxRowsBytes / rows_of_.row_bytes()});
    rows_.resize(count * rows_of_.row_bytes());
    const std::byte* record = block_.records.data();
    std::byte* row = rows_.data();
    for (std::size_t i = 0; i < count; ++i) {
      read_surfel(record, out[i]);
      rows_of_.write(record, row);
      ++done_;
      block_.offset += block_.stride;
      record += record_bytes;
      row += rows_of_.row_bytes();
    }
    block_.records = block_.records.subspan(count * record_bytes);
    return count;
  }

  [[nodiscard]] std::span<const std::byte> attributes() const noexcept override { return rows_; }

  // Gives the box of the header, unless a sample of the points says that the box is wrong or far
  // too large, as programs leave it that cut a part out of a file.
  [[nodiscard]] std::optional<Extent> extent() override {
    const std::optional<Bounds> stated = stated_bounds();
    if (!stated) return std::nullopt;
    Extent extent{.bounds = *stated};
    for (int axis = 0; axis < 3; ++axis) {
      // Programs compute the box in their own ways, so it is larger by what rounding may change
      const double rounding = std::abs(header_.scale[static_cast<std::size_t>(axis)]) / 1024;
      extent.bounds.low[axis] -= rounding;
      extent.bounds.high[axis] += rounding;
    }
    Bounds sampled;
    std::size_t looked = 0;
    records_->sample([&](std::span<const std::byte> records) {
      for (; !records.empty(); records = records.subspan(header_.record_bytes)) {
        const glm::dvec3 position = position_of(records.data());
        sampled.add(position);
        if (looked++ % kSampleStride == 0) extent.sample.push_back(position);
      }
    });
    const Bounds& box = extent.bounds;
    const bool believed = !sampled.empty() && box.contains(sampled.low) &&
                          box.contains(sampled.high) &&
                          largest_side(sampled) >= largest_side(box) / 2 &&
                          fits_coordinates(box.low) && fits_coordinates(box.high);
    if (!believed) return std::nullopt;
    return extent;
  }

 private:
  static LasFields read_fields(const InputFile& file, const LasHeader& header) {
    const LasRecord* const record = header.find(kSpecUser, kExtraBytesNumber);
    if (record == nullptr) return make_las_fields(header, {});
    return make_las_fields(header,
                           read_las_payload(file, *record).value_or(std::vector<std::byte>()));
  }

  // Decides what the colours are by a sample of the points.
  void look_at_colours() {
    if (!laz::has_rgb(header_.format) || header_.points == 0) return;
    const std::size_t place = rgb_place(header_.format);
    std::uint16_t most = 0;
    records_->sample([&](std::span<const std::byte> records) {
      for (; !records.empty(); records = records.subspan(header_.record_bytes))
        most = std::max(most, std::ranges::max(rgb_at(records.data(), place)));
    });
    colours_ = most == 0    ? Colours::black
               : most > 255 ? Colours::sixteen_bits
                            : Colours::eight_bits;
  }

  // Returns the format as its users name it: "LAZ 1.4 (COPC), point format 7".
  [[nodiscard]] std::string format_name() const {
    const bool copc = header_.find("copc", 1) != nullptr;
    return std::string(header_.compressed ? "LAZ" : "LAS") + " 1." + std::to_string(header_.minor) +
           (copc ? " (COPC)" : "") + ", point format " + std::to_string(header_.format);
  }

  // Returns the bounds of the header, unless they are no box.
  [[nodiscard]] std::optional<Bounds> stated_bounds() const {
    const Bounds& bounds = header_.bounds;
    for (int axis = 0; axis < 3; ++axis) {
      if (!(std::isfinite(bounds.low[axis]) && std::isfinite(bounds.high[axis]) &&
            bounds.low[axis] <= bounds.high[axis]))
        return std::nullopt;
    }
    return bounds;
  }

  void add_texts(PointFileInfo& info) const {
    info.text.emplace("up", "z");
    LasCrs crs = read_las_crs(file_, header_);
    if (!crs.text.empty()) info.text["crs"] = crs.text;
    if (crs.metres_per_unit) info.text["metres_per_unit"] = shortest(*crs.metres_per_unit);
    std::ranges::move(crs.notes, std::back_inserter(info.notes));
    const unsigned bits = colours_ == Colours::eight_bits     ? 8
                          : colours_ == Colours::sixteen_bits ? 16
                                                              : 0;
    info.text["las.header"] = make_las_header_text(header_, bits);
    std::string records = make_las_records_text(file_, header_, info.notes);
    if (!records.empty()) info.text[kLasRecordsKey] = std::move(records);
  }

  [[noreturn]] void fail(const std::string& rule) const {
    refuse_las(file_, block_.offset, "point " + std::to_string(done_) + ": " + rule);
  }

  [[nodiscard]] glm::dvec3 position_of(const std::byte* record) const {
    std::array<std::int32_t, 3> place{};
    std::memcpy(place.data(), record, sizeof place);
    glm::dvec3 position;
    for (int axis = 0; axis < 3; ++axis) {
      const auto k = static_cast<std::size_t>(axis);
      position[axis] = static_cast<double>(place[k]) * header_.scale[k] + header_.offset[k];
    }
    return position;
  }

  void read_surfel(const std::byte* record, Surfel& surfel) {
    RawSurfel raw;
    raw.position = position_of(record);
    if (colours_ != Colours::none) read_colour(record, raw);
    const bool has_normal = read_parts(record, raw);
    const std::string rule = convert_surfel(raw, has_normal, surfel);
    if (!rule.empty()) fail(rule);
  }

  // Reads what extra bytes hold of the surfel. @return whether the point has a normal
  bool read_parts(const std::byte* record, RawSurfel& raw) const {
    const LasSurfel& parts = fields_.surfel;
    if (parts.radius) raw.radius = value_of(record, *parts.radius).value_or(0);
    if (parts.radiance) raw.radiance = values_of(record, *parts.radiance).value_or(glm::dvec3(0));
    if (parts.emission) raw.emission = values_of(record, *parts.emission).value_or(glm::dvec3(0));
    if (parts.albedo) raw.albedo = values_of(record, *parts.albedo).value_or(raw.albedo);
    if (!parts.normal) return false;
    raw.normal = values_of(record, *parts.normal).value_or(glm::dvec3(0));
    return !has_nan(raw.normal) && raw.normal != glm::dvec3(0);
  }

  // Returns what a number stands for; nothing when it is not known.
  static std::optional<double> value_of(const std::byte* record, const LasNumber& number) {
    return meaning_of(number.channel, record + number.offset);
  }
  static std::optional<glm::dvec3> values_of(const std::byte* record, const LasTriple& triple) {
    glm::dvec3 values;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::optional<double> value = value_of(record, triple[i]);
      if (!value) return std::nullopt;
      values[static_cast<int>(i)] = *value;
    }
    return values;
  }

  void read_colour(const std::byte* record, RawSurfel& raw) const {
    const std::array<std::uint16_t, 3> rgb = rgb_at(record, rgb_place(header_.format));
    const std::uint16_t most = std::ranges::max(rgb);
    if (colours_ == Colours::black) {
      if (most > 0)
        fail("the point has a colour, but all points that were looked at on opening have none");
      return;
    }
    if (most >= curve_.size()) {
      fail(
          "a colour is above 255, but those of all points that were looked at on opening are of 8 "
          "bits");
    }
    raw.albedo = {curve_[rgb[0]], curve_[rgb[1]], curve_[rgb[2]]};
  }

  InputFile file_;
  LasHeader header_;
  LasFields fields_;
  LasRows rows_of_;
  std::unique_ptr<LasRecordSource> records_;
  Colours colours_ = Colours::none;
  std::vector<double> curve_;    // linear value of each stored colour; empty without colours
  LasBlock block_;               // records that next() has not returned
  std::vector<std::byte> rows_;  // of the surfels that next() returned last
  std::uint64_t done_ = 0;       // points that next() has returned
};

}  // namespace

PointFile open_las(const std::filesystem::path& path) {
  return open_source<LasSource>(path);
}

}  // namespace ptc
