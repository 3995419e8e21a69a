// Reads clouds from E57 (ASTM E2807): the scans of a file one after another, in its coordinates.
//
//   E57Pages --> E57Document    which scans, fields, poses
//            --> E57Section     blocks of records, one column of numbers for each field
//                 |-- E57Roles    position --pose--> surfel     normal, colour
//                 `-- E57Cell     the rest       --> a row of the channels
//
// All sections are checked against the file when it is opened; then one is read at a time.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "engine/base/error.h"
#include "engine/io/cloud/e57_channels.h"
#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/surfel_check.h"
#include "engine/io/e57/section.h"
#include "engine/io/image/srgb.h"
#include "format/text.h"

namespace ptc {
namespace {

// Returns the point of a range (m), an azimuth in the xy plane from x to y, and an elevation.
glm::dvec3 from_spherical(const glm::dvec3& polar) {
  const double flat = polar.x * std::cos(polar.z);
  return {flat * std::cos(polar.y), flat * std::sin(polar.y), polar.x * std::sin(polar.z)};
}

// The linear values of one component of the colours of a scan.
class ColourCurve {
 public:
  ColourCurve() = default;
  ColourCurve(const E57Field& field, const E57Limits& limits, std::uint64_t records)
      : field_(&field), limits_(limits) {
    // Tabulate the curve where that is less work than to compute it for each point.
    const auto most =
        static_cast<std::uint64_t>(field.maximum) - static_cast<std::uint64_t>(field.minimum);
    if (!field.is_integer() || most > 65535 || most >= records) return;
    for (std::uint64_t i = 0; i <= most; ++i) {
      table_.push_back(compute(i + static_cast<std::uint64_t>(field.minimum)));
    }
  }

  // Returns the linear value in [0, 1] of a stored one; NaN of NaN.
  [[nodiscard]] double operator()(std::uint64_t value) const {
    if (table_.empty()) return compute(value);
    return table_[value - static_cast<std::uint64_t>(field_->minimum)];
  }

 private:
  [[nodiscard]] double compute(std::uint64_t value) const {
    const double share = (field_->real(value) - limits_.low) / (limits_.high - limits_.low);
    return std::isnan(share) ? share : srgb_to_linear(std::clamp(share, 0.0, 1.0));
  }

  const E57Field* field_ = nullptr;
  E57Limits limits_;
  std::vector<double> table_;  // of all integers from the minimum of the field on
};

class E57Source : public PointSource {
 public:
  explicit E57Source(const std::filesystem::path& path)
      : pages_(path), document_(read_e57_document(pages_)), channels_(document_, pages_) {
    check_sections();
  }

  [[nodiscard]] PointFileInfo info() const;

  std::size_t next(std::span<Surfel> out) override {
    rows_.clear();
    std::size_t count = 0;
    while (count < out.size() && (at_ < block_ || next_block())) {
      if (read_surfel(out[count])) {
        append_row();
        ++count;
      } else {
        ++left_out_;
      }
      ++at_;
    }
    return count;
  }

  [[nodiscard]] std::span<const std::byte> attributes() const noexcept override { return rows_; }
  [[nodiscard]] std::uint64_t left_out() const noexcept override { return left_out_; }

 private:
  // Checks the header of every section, and that the records of all scans fit in the file: a file
  // whose scans share one section could have any number of points.
  void check_sections() {
    std::uint64_t bits = 8 * pages_.size();
    std::uint64_t empty = E57Section::kMaxEmptyRecords;
    for (const E57Scan& each : document_.scans) {
      static_cast<void>(E57Section(pages_, each));  // now records and bits are in range
      const std::uint64_t size = each.record_bits();
      std::uint64_t& left = size == 0 ? empty : bits;
      const std::uint64_t taken = each.records * std::max<std::uint64_t>(size, 1);
      if (taken > left) {
        pages_.fail_at(pages_.xml_offset(), "the scans have more records than the file can hold");
      }
      left -= taken;
    }
  }

  // Reads the next block of records, of the next scan where one ends. @return false at the end
  bool next_block() {
    at_ = 0;
    while (true) {
      block_ = section_ ? section_->next() : 0;
      if (block_ > 0) return true;
      if (section_) ++scan_;
      section_.reset();
      while (scan_ < document_.scans.size() && scan().records == 0) ++scan_;
      if (scan_ == document_.scans.size()) return false;
      begin_scan();
    }
  }

  void begin_scan() {
    section_.emplace(pages_, scan());
    roles_ = *find_e57_roles(scan());  // E57Channels has checked that there are some
    cells_ = channels_.cells(document_, scan_);
    if (!roles_.colour) return;
    const auto limits = e57_colour_limits(scan(), *roles_.colour);
    for (std::size_t i = 0; i < 3; ++i) {
      curves_[i] = ColourCurve(scan().fields[(*roles_.colour)[i]], limits[i], scan().records);
    }
  }

  [[nodiscard]] const E57Scan& scan() const { return document_.scans[scan_]; }

  // Returns the bits of a field of the record, or the number that they stand for.
  [[nodiscard]] std::uint64_t value(std::size_t field) const {
    return section_->column(field)[at_];
  }
  [[nodiscard]] double real(std::size_t field) const {
    return scan().fields[field].real(value(field));
  }
  [[nodiscard]] glm::dvec3 real(const E57Triple& fields) const {
    return {real(fields[0]), real(fields[1]), real(fields[2])};
  }

  // Converts the record. @return false when it has no place
  bool read_surfel(Surfel& surfel) {
    // Place it in the coordinates of the file.
    if (roles_.invalid && real(*roles_.invalid) != 0) return false;
    glm::dvec3 position = real(roles_.position);
    if (has_nan(position)) return false;
    if (roles_.spherical) position = from_spherical(position);
    RawSurfel raw;
    raw.position = scan().rotation * position + scan().translation;

    // Add what is known of normal and colour.
    bool has_normal = false;
    if (roles_.normal) {
      const glm::dvec3 normal = real(*roles_.normal);
      has_normal = !has_nan(normal) && normal != glm::dvec3(0);
      if (has_normal) raw.normal = scan().rotation * normal;
    }
    if (roles_.colour && !(roles_.no_colour && real(*roles_.no_colour) != 0)) {
      glm::dvec3 colour;
      for (int i = 0; i < 3; ++i) {
        const auto component = static_cast<std::size_t>(i);
        colour[i] = curves_[component](value((*roles_.colour)[component]));
      }
      if (!has_nan(colour)) raw.albedo = colour;
    }
    const std::string rule = convert_surfel(raw, has_normal, surfel);
    if (!rule.empty()) {
      pages_.fail_at(section_->packet_offset(), "scan " + std::to_string(scan_) + ", point " +
                                                    std::to_string(section_->block_begin() + at_) +
                                                    ": " + rule);
    }
    return true;
  }

  void append_row() {
    for (const E57Cell& cell : cells_) {
      std::uint64_t bits = cell.otherwise;
      if (cell.field && !(cell.invalid && real(*cell.invalid) != 0)) {
        bits = cell.as_real ? std::bit_cast<std::uint64_t>(real(*cell.field)) : value(*cell.field);
      }
      const auto bytes = std::as_bytes(std::span(&bits, 1)).first(cell.bytes);
      rows_.insert(rows_.end(), bytes.begin(), bytes.end());
    }
  }

  E57Pages pages_;
  E57Document document_;
  E57Channels channels_;
  std::size_t scan_ = 0;               // index of the scan of section_, or of the next one
  std::optional<E57Section> section_;  // empty before the first scan and behind the last one
  E57Roles roles_;                     // of the scan
  std::vector<E57Cell> cells_;
  std::array<ColourCurve, 3> curves_;
  std::size_t block_ = 0;        // records in the block of section_
  std::size_t at_ = 0;           // next record in the block
  std::vector<std::byte> rows_;  // of the surfels that next() returned last
  std::uint64_t left_out_ = 0;
};

// Returns the places of the scanners, or nothing unless the place of each is known: a scan states
// its pose, or its coordinates are spherical around the scanner.
std::vector<glm::dvec3> places_of(const std::vector<E57Scan>& scans) {
  std::vector<glm::dvec3> places;
  for (const E57Scan& scan : scans) {
    const auto roles = find_e57_roles(scan);
    if (!scan.has_pose && !(roles && roles->spherical)) return {};
    places.push_back(scan.translation);
  }
  return places;
}

// Returns the shortest decimal number that is read as this one.
std::string decimal(double value) {
  std::array<char, 32> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return {text.data(), end};
}

PointFileInfo E57Source::info() const {
  PointFileInfo info;
  info.count = document_.records;
  info.channels = channels_.channels();
  info.notes = channels_.notes();
  for (const E57Scan& scan : document_.scans) {
    const auto roles = scan.records > 0 ? find_e57_roles(scan) : std::nullopt;
    info.has_normals = info.has_normals || (roles && roles->normal);
    info.has_albedo = info.has_albedo || (roles && roles->colour);
  }
  info.text.emplace("up", "z");
  info.text.emplace("metres_per_unit", "1");
  if (!document_.crs.empty() && is_utf8(document_.crs)) info.text["crs"] = document_.crs;
  if (document_.scans.size() == 1 && document_.scans[0].start > 0) {
    info.text["time"] = decimal(document_.scans[0].start);
  }
  info.scanners = places_of(document_.scans);
  if (document_.pictures > 0) {
    info.notes.push_back("The pictures in the file (" + std::to_string(document_.pictures) +
                         ") are not read.");
  }
  return info;
}

}  // namespace

PointFile open_e57(const std::filesystem::path& path) {
  return open_source<E57Source>(path);
}

}  // namespace ptc
