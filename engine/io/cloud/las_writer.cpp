// Writes LAS 1.4.
//
//   | header 375 | records: originals, WKT, extra bytes | point | point | ... | extended originals
//     ^ again at the end: bounds and counts of returns are known then
//
// Points keep the steps of the LAS file that they came from, so each coordinate gets the integer
// that it had. las_plan.cpp and las_layout.cpp decide everything before the first point.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/cloud/checked_writer.h"
#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/las_plan.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/rounding.h"
#include "engine/io/file/buffered_output.h"

namespace ptc {
namespace las {
namespace {

constexpr std::uint16_t kHeaderBytes = 375;
constexpr std::uint16_t kWktBit = 16;                   // of "Global Encoding"
constexpr std::size_t kMostExtraNumbers = 65535 / 192;  // whose descriptions fit one record
constexpr std::size_t kReturns = 15;

// What the header says of the points, gathered while they are written.
struct Totals {
  std::array<std::int32_t, 3> low{};
  std::array<std::int32_t, 3> high{};
  std::uint64_t points = 0;
  std::array<std::uint64_t, kReturns> by_return{};  // of return numbers from 1 on

  void add(const std::array<std::int32_t, 3>& place, unsigned return_number) {
    for (std::size_t i = 0; i < 3; ++i) {
      low[i] = points == 0 ? place[i] : std::min(low[i], place[i]);
      high[i] = points == 0 ? place[i] : std::max(high[i], place[i]);
    }
    ++points;
    if (return_number >= 1 && return_number <= kReturns) ++by_return[return_number - 1];
  }
};

void append_padded(std::vector<std::byte>& bytes, const std::string& text) {
  const auto raw = std::as_bytes(std::span(text)).first(std::min<std::size_t>(text.size(), 32));
  bytes.insert(bytes.end(), raw.begin(), raw.end());
  bytes.resize(bytes.size() + 32 - raw.size());
}

class LasWriter : public CheckedWriter {
 public:
  LasWriter(const std::filesystem::path& target, const PointWriteInfo& info, Layout layout)
      : CheckedWriter(info.count, row_bytes(info.channels)),
        layout_(std::move(layout)),
        head_(plan_head(info)),
        records_(plan_records(info)),
        record_(layout_.record_bytes),
        out_(target) {
    if (records_.has_wkt) head_.encoding |= kWktBit;
    if (layout_.extra_numbers > 0) {
      records_.add("LASF_Spec", 4, "Extra Bytes", layout_.extra_records());
    }
    const std::vector<std::byte> header = make_header();
    out_.put(header.data(), header.size());
    out_.put(records_.bytes.data(), records_.bytes.size());
  }

 private:
  [[nodiscard]] std::vector<std::byte> make_header() const {
    // Say what the file is and where it comes from
    std::vector<std::byte> h;
    for (const char c : {'L', 'A', 'S', 'F'}) append_value(h, c);
    append_value(h, head_.source);
    append_value(h, head_.encoding);
    for (const std::byte byte : head_.guid) h.push_back(byte);
    append_value(h, std::uint8_t{1});
    append_value(h, std::uint8_t{4});
    append_padded(h, head_.system);
    append_padded(h, head_.software);
    append_value(h, head_.day);
    append_value(h, head_.year);
    // Say where the points are and how they are laid out
    append_value(h, kHeaderBytes);
    append_value(h, points_begin());
    append_value(h, records_.count);
    append_value(h, layout_.point_format);
    append_value(h, static_cast<std::uint16_t>(layout_.record_bytes));
    h.resize(h.size() + 24);  // legacy counts, which are 0 from point format 6 on
    // Say what they are
    for (int i = 0; i < 3; ++i) append_value(h, head_.scale[i]);
    for (int i = 0; i < 3; ++i) append_value(h, head_.offset[i]);
    for (int i = 0; i < 3; ++i) {
      append_value(h, coordinate(totals_.high, i));
      append_value(h, coordinate(totals_.low, i));
    }
    append_value(h, std::uint64_t{0});  // no waveforms
    append_value(h, records_.extended_count > 0 ? points_end() : std::uint64_t{0});
    append_value(h, records_.extended_count);
    append_value(h, totals_.points);
    for (const std::uint64_t count : totals_.by_return) append_value(h, count);
    return h;
  }
  [[nodiscard]] std::uint32_t points_begin() const {
    return static_cast<std::uint32_t>(kHeaderBytes + records_.bytes.size());
  }
  [[nodiscard]] std::uint64_t points_end() const {
    return points_begin() + announced() * layout_.record_bytes;
  }
  [[nodiscard]] double coordinate(const std::array<std::int32_t, 3>& place, int i) const {
    if (totals_.points == 0) return 0;
    return place[static_cast<std::size_t>(i)] * head_.scale[i] + head_.offset[i];
  }

  void put(const Surfel& surfel, const std::byte* row) override {
    std::ranges::fill(record_, std::byte{0});
    const std::array<std::int32_t, 3> place = to_steps(surfel.position);
    std::memcpy(record_.data(), place.data(), sizeof place);
    unsigned returned = 1;
    std::optional<unsigned> returns;
    for (const PlacedChannel& field : layout_.fields) {
      // What is not known stays as it is in a file without the channel
      if (is_unknown(field.channel.channel, field.channel.at(row, 0))) continue;
      if (field.field == Field::return_number) {
        returned = static_cast<unsigned>(field.value(row));
      } else if (field.field == Field::number_of_returns) {
        returns = static_cast<unsigned>(field.value(row));
      } else {
        set_field(field, row);
      }
    }
    const unsigned of = returns.value_or(returned);
    set<std::uint8_t>(14, static_cast<std::uint8_t>(returned | of << 4));
    if (layout_.colour.exists()) {
      const bool is_stored = layout_.colour.stored() != nullptr;
      const std::array<std::uint16_t, 3> colour =
          is_stored ? layout_.colour.stored_values(surfel, row) : layout_.colour.srgb(surfel, row);
      std::memcpy(record_.data() + 30, colour.data(), sizeof colour);
    }
    set_extras(surfel, row);
    out_.put(record_.data(), record_.size());
    totals_.add(place, returned);
  }

  void end() override {
    out_.put(records_.extended.data(), records_.extended.size());
    const std::vector<std::byte> header = make_header();
    out_.put_at(0, header.data(), header.size());
    out_.publish();
  }

  [[nodiscard]] std::array<std::int32_t, 3> to_steps(const glm::dvec3& position) const {
    std::array<std::int32_t, 3> place{};
    for (int i = 0; i < 3; ++i) {
      const double steps = std::round((position[i] - head_.offset[i]) / head_.scale[i]);
      if (!(std::abs(steps) <= std::numeric_limits<std::int32_t>::max())) {
        throw std::invalid_argument("PointWriter: a point lies outside of the announced bounds");
      }
      place[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(steps);
    }
    return place;
  }

  template <typename T>
  void set(std::size_t offset, T value) {
    std::memcpy(record_.data() + offset, &value, sizeof value);
  }
  void set_bits(std::size_t offset, unsigned value) {
    record_[offset] |= static_cast<std::byte>(value);
  }

  // Sets a place of point formats 6 to 8 other than the numbers of returns.
  void set_field(const PlacedChannel& field, const std::byte* row) {
    const double number = field.value(row);
    if (field.field == Field::gps_time) return set(22, number);
    if (field.field == Field::scan_angle) return set(18, static_cast<std::int16_t>(number));
    const auto value = static_cast<unsigned>(number);
    switch (field.field) {
      case Field::intensity:
        return set(12, static_cast<std::uint16_t>(value));
      case Field::class_flags:
        return set_bits(15, value);
      case Field::scanner_channel:
        return set_bits(15, value << 4);
      case Field::scan_direction:
        return set_bits(15, value << 6);
      case Field::edge_of_flight_line:
        return set_bits(15, value << 7);
      case Field::classification:
        return set(16, static_cast<std::uint8_t>(value));
      case Field::user_data:
        return set(17, static_cast<std::uint8_t>(value));
      case Field::point_source_id:
        return set(20, static_cast<std::uint16_t>(value));
      case Field::nir:
        return set(36, static_cast<std::uint16_t>(value));
      default:
        break;
    }
  }

  void set_extras(const Surfel& surfel, const std::byte* row) {
    std::byte* to = record_.data() + layout_.standard_bytes;
    for (const Extra& extra : layout_.extras) {
      const Channel& channel = extra.channel.channel;
      if (extra.source != ExtraSource::channel) {
        const std::size_t bytes = channel.components * sizeof(float);
        std::memcpy(to, floats_of(extra.source, surfel), bytes);
        to += bytes;
        continue;
      }
      for (std::size_t i = 0; i < channel.components; ++i)
        to = store_number(channel.type, extra.channel.at(row, i), extra_type(channel.type), to);
    }
  }
  static const float* floats_of(ExtraSource source, const Surfel& surfel) {
    switch (source) {
      case ExtraSource::normal:
        return &surfel.normal.x;
      case ExtraSource::radiance:
        return &surfel.radiance.x;
      case ExtraSource::emission:
        return &surfel.emission.x;
      case ExtraSource::albedo:
        return &surfel.albedo.x;
      default:
        return &surfel.radius;
    }
  }

  Layout layout_;
  Head head_;
  Records records_;
  Totals totals_;
  std::vector<std::byte> record_;  // of the current point
  BufferedOutput out_;
};

}  // namespace
}  // namespace las

std::unique_ptr<PointWriter> create_las(const std::filesystem::path& target,
                                        const PointWriteInfo& info) {
  las::Layout layout(info);
  if (layout.extra_numbers > las::kMostExtraNumbers) {
    throw RequestError("target",
                       fmt::format("a .las holds at most {} numbers of each point beyond those of "
                                   "the standard, but these points have {}",
                                   las::kMostExtraNumbers, layout.extra_numbers));
  }
  return std::make_unique<las::LasWriter>(target, info, std::move(layout));
}

std::vector<std::string> las_unknown_losses(const PointWriteInfo& info) {
  const las::Layout layout(info);
  std::vector<std::string> zeros, ones, sentences;
  for (const las::PlacedChannel& field : layout.fields) {
    if (!field.channel.channel.no_value) continue;
    const bool counts_returns =
        field.field == las::Field::return_number || field.field == las::Field::number_of_returns;
    (counts_returns ? ones : zeros).push_back(field.channel.channel.name);
  }
  if (!zeros.empty()) {
    sentences.push_back(
        fmt::format("LAS has no value for \"not known\": points without {} get 0 there.",
                    fmt::join(zeros, ", ")));
  }
  if (!ones.empty()) {
    sentences.push_back(
        fmt::format("Points without {} become the first of one return.", fmt::join(ones, ", ")));
  }
  if (layout.colour.stored() != nullptr && layout.colour.stored()->channel.no_value)
    sentences.push_back(kAlbedoAsColour);
  return sentences;
}

std::vector<std::string> las_scaling_notes(const PointWriteInfo& info) {
  std::vector<std::string> sentences;
  for (const las::PlacedChannel& field : las::Layout(info).fields) {
    if (!field.by_values) continue;
    sentences.push_back(field.loss +
                        " Another file may be scaled otherwise, by its own values; files that are "
                        "joined are scaled alike.");
  }
  return sentences;
}

std::vector<std::string> las_losses(const PointWriteInfo& info) {
  std::vector<std::string> sentences;
  const las::Head head = las::plan_head(info);
  const las::Layout layout(info);
  const bool was_las = info.text.contains("las.header");
  if (las::moves_positions(info, head)) {
    sentences.push_back(fmt::format("Positions are rounded to steps of {:.2g} units.",
                                    std::max({head.scale.x, head.scale.y, head.scale.z})));
    if (was_las && head.own_steps) {
      sentences.push_back(
          "The steps of the LAS file that the points came from do not hold all positions.");
    }
  }
  if (info.has_albedo && !layout.colour.hides_albedo() && layout.colour.stored() == nullptr &&
      (!info.rounding || info.rounding->albedos)) {
    sentences.push_back("Colours are rounded to 16 bits on the sRGB curve.");
  }
  for (const las::PlacedChannel& field : layout.fields) {
    const std::string& name = field.channel.channel.name;
    const bool narrows = narrowing_of(OutputFormat::las, field.channel.channel).has_value();
    if (narrows && !may_round(info, field.channel.channel)) continue;
    if (!field.loss.empty()) sentences.push_back(field.loss);
    if (was_las || field.high > 15 || info.ranges.contains(name)) continue;
    sentences.push_back(
        fmt::format("Values of the channel {} above {} become {}.", name, field.high, field.high));
  }
  sentences.insert(sentences.end(), layout.misfits.begin(), layout.misfits.end());
  const las::Records records = las::plan_records(info);
  sentences.insert(sentences.end(), records.dropped.begin(), records.dropped.end());
  return sentences;
}

}  // namespace ptc
