#include "engine/io/cloud/written_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/cloud/checked_writer.h"
#include "engine/io/cloud/display_colour.h"
#include "engine/io/cloud/las_places.h"
#include "engine/io/cloud/las_plan.h"
#include "engine/io/cloud/packed_number.h"

namespace ptc {
namespace {

constexpr std::size_t kBlock = 1 << 13;  // points that are read at once

// Numbers of a surfel, in the order in which PointColumns has them.
enum Quantity : std::uint8_t { position, normal, radius, radiance, albedo, emission };
struct SurfelColumn {
  std::string_view name;
  Quantity of;
};
constexpr std::array kSurfelColumns = std::to_array<SurfelColumn>({
    {"x", position},
    {"y", position},
    {"z", position},
    {"nx", normal},
    {"ny", normal},
    {"nz", normal},
    {"radius", radius},
    {"radiance_r", radiance},
    {"radiance_g", radiance},
    {"radiance_b", radiance},
    {"albedo_r", albedo},
    {"albedo_g", albedo},
    {"albedo_b", albedo},
    {"emission_r", emission},
    {"emission_g", emission},
    {"emission_b", emission},
});

constexpr double kShare = 1e-4;  // of the range by which numbers may be off
// The last bits of floats and of doubles, of the greatest magnitude
constexpr double kFloatStep = 0x1p-22, kDoubleStep = 0x1p-44;

// How far numbers may be off besides.
struct Tolerance {
  double absolute = 0;
  double step = kDoubleStep;  // of the greatest magnitude
};

bool agree(const ColumnFacts& written, const ColumnFacts& read, const Tolerance& tolerance) {
  if (written.known != read.known) return false;
  if (written.known == 0) return true;
  const double magnitude = std::max(std::abs(written.low), std::abs(written.high));
  const auto count = static_cast<double>(written.known);
  const double most = std::max(tolerance.absolute, kShare * (written.high - written.low)) +
                      (tolerance.step + 0x1p-52 * count) * magnitude;
  return std::abs(written.low - read.low) <= most && std::abs(written.high - read.high) <= most &&
         std::abs(written.mean() - read.mean()) <= most &&
         std::abs(written.weighted - read.weighted) / count <= most;
}

std::string text_of(const ColumnFacts& facts) {
  if (facts.known == 0) return "no values";
  return fmt::format("{} values from {:.9g} to {:.9g}, {:.9g} in the mean", facts.known, facts.low,
                     facts.high, facts.mean());
}

[[noreturn]] void refuse(const std::filesystem::path& target, std::string_view name,
                         const ColumnFacts& written, const ColumnFacts& read) {
  const std::string what =
      text_of(written) == text_of(read) ? "them at other points" : text_of(read);
  throw DataError(fmt::format("{}: {} was written with {}, but the file, which is kept, has {}",
                              target.string(), name, text_of(written), what));
}

}  // namespace

void ColumnFacts::add(double value) noexcept {
  // Fractions of the multiples of the golden ratio are evenly spread
  const std::uint64_t place = (known + unknown) * 0x9e3779b97f4a7c15U;
  if (!(std::abs(value) <= static_cast<double>(std::numeric_limits<float>::max()))) {
    ++unknown;
    return;
  }
  ++known;
  weighted += value * (static_cast<double>(place >> 11) * 0x1p-53);
  low = std::min(low, value);
  high = std::max(high, value);
  sum += value;
}

double ColumnFacts::mean() const noexcept {
  return known > 0 ? sum / static_cast<double>(known) : 0;
}

PointColumns::PointColumns(std::span<const Channel> channels, Values values)
    : values_(values),
      channels_(row_channels(channels, {})),
      row_bytes_(row_bytes(channels)),
      surfel_(kSurfelColumns.size()) {
  for (const RowChannel& row : channels_) parts_.emplace_back(row.channel.components);
}

void PointColumns::add_surfels(std::span<const Surfel> surfels) {
  points_ += surfels.size();
  for (const Surfel& s : surfels) {
    const std::array<double, kSurfelColumns.size()> numbers{
        s.position.x,         s.position.y,         s.position.z,         double{s.normal.x},
        double{s.normal.y},   double{s.normal.z},   double{s.radius},     double{s.radiance.r},
        double{s.radiance.g}, double{s.radiance.b}, double{s.albedo.r},   double{s.albedo.g},
        double{s.albedo.b},   double{s.emission.r}, double{s.emission.g}, double{s.emission.b}};
    for (std::size_t i = 0; i < numbers.size(); ++i) surfel_[i].add(numbers[i]);
  }
}

void PointColumns::add_rows(std::span<const std::byte> rows, std::size_t count) {
  for (std::size_t c = 0; c < channels_.size(); ++c) {
    const RowChannel& row = channels_[c];
    const Channel& channel = row.channel;
    const bool meant = values_ == Values::meant;
    for (std::size_t k = 0; k < channel.components; ++k) {
      ColumnFacts& facts = parts_[c][k];
      const std::byte* at = row.at(rows.data(), k);
      for (std::size_t i = 0; i < count; ++i, at += row_bytes_) {
        const double number = load_number(at, channel.type);
        facts.add(!meant                    ? number
                  : is_unknown(channel, at) ? std::numeric_limits<double>::quiet_NaN()
                                            : number * channel.scale + channel.offset);
      }
    }
  }
}

std::optional<PointColumns::Part> PointColumns::find(const std::string& name) const {
  for (std::size_t c = 0; c < channels_.size(); ++c) {
    for (std::size_t k = 0; k < parts_[c].size(); ++k) {
      if (channels_[c].parts[k] == name) return Part{&channels_[c].channel, &parts_[c][k]};
    }
  }
  return std::nullopt;
}

WrittenCheck::WrittenCheck(OutputFormat format, const PointWriteInfo& info)
    : format_(format), info_(info), stored_(info.channels, PointColumns::Values::stored) {
  const auto differs = [](const Channel& channel) {
    return channel.scale != 1 || channel.offset != 0 || channel.no_value;
  };
  if (std::ranges::any_of(info.channels, differs))
    meant_.emplace(info.channels, PointColumns::Values::meant);
}

bool WrittenCheck::is_read() const noexcept {
  return format_ != OutputFormat::usda && format_ != OutputFormat::usdc;
}

void WrittenCheck::add(std::span<const Surfel> surfels, std::span<const std::byte> rows) {
  if (!is_read()) return;
  stored_.add_surfels(surfels);
  stored_.add_rows(rows, surfels.size());
  if (meant_) meant_->add_rows(rows, surfels.size());
}

std::vector<std::string> WrittenCheck::compare(const std::filesystem::path& target,
                                               Progress& progress) const {
  std::vector<std::string> others;
  if (!is_read()) return others;
  const PointFile file = open_points(target);
  PointColumns read(file.info.channels, PointColumns::Values::meant);
  std::vector<Surfel> block(kBlock);
  while (const std::size_t count = file.source->next(block)) {
    read.add_surfels(std::span(block).first(count));
    read.add_rows(file.source->attributes(), count);
    progress.advance(count);
  }
  if (read.points() != stored_.points()) {
    throw DataError(fmt::format("{}: {} points were written, but the file, which is kept, has {}",
                                target.string(), stored_.points(), read.points()));
  }
  if (read.points() == 0) return others;
  compare_surfels(target, file.info, read);
  for (const RowChannel& row : row_channels(info_.channels, {})) {
    if (is_held_otherwise(row)) continue;
    if (!compare_channel(target, row, read)) others.push_back(row.channel.name);
  }
  return others;
}

void WrittenCheck::compare_surfels(const std::filesystem::path& target, const PointFileInfo& file,
                                   const PointColumns& read) const {
  // Says of a quantity whether it was written, and whether the file has it. Colours of a viewer are
  // not compared: the albedo, where they take its place
  const DisplayColour colour(info_);
  const bool is_shown = colour.stored() != nullptr || colour.hides_albedo() ||
                        std::ranges::any_of(info_.channels, &is_linear_colour);
  const auto is_written = [&](Quantity of) {
    return std::array{true,
                      info_.has_normals,
                      info_.has_radius,
                      info_.has_radiance,
                      info_.has_albedo && !is_shown && format_ != OutputFormat::las,
                      info_.emits}[of];
  };
  const auto is_found = [&](Quantity of) {
    return std::array{true,
                      file.has_normals,
                      file.has_radius,
                      file.has_radiance,
                      file.has_albedo,
                      file.has_emission}[of];
  };
  const glm::dvec3 steps =
      format_ == OutputFormat::las ? las::plan_head(info_).scale : glm::dvec3(0);
  double brightest = 0;  // of what is emitted, from which a PTC tells what is reflected
  for (std::size_t i = 0; i < kSurfelColumns.size(); ++i) {
    if (info_.emits && kSurfelColumns[i].of == emission)
      brightest = std::max(brightest, stored_.surfel(i).high);
  }
  for (std::size_t i = 0; i < kSurfelColumns.size(); ++i) {
    const auto& [name, of] = kSurfelColumns[i];
    if (!is_written(of)) continue;
    Tolerance tolerance{.step = kFloatStep};
    if (of == position) {
      tolerance.absolute = steps[static_cast<int>(i)];
      const bool has_doubles = format_ == OutputFormat::las || format_ == OutputFormat::ply ||
                               format_ == OutputFormat::xyz;
      if (has_doubles) tolerance.step = kDoubleStep;
    }
    if (of == normal || of == albedo) tolerance.absolute = 0.01;
    if (of == radiance) tolerance.absolute = kFloatStep * brightest;
    const ColumnFacts& written = stored_.surfel(i);
    if (!is_found(of)) refuse(target, name, written, {});
    if (!agree(written, read.surfel(i), tolerance)) refuse(target, name, written, read.surfel(i));
  }
}

// Compares a channel. A file that does not say what stored values mean gives these back.
// @return false when the file does not have it under its name
bool WrittenCheck::compare_channel(const std::filesystem::path& target, const RowChannel& row,
                                   const PointColumns& read) const {
  for (const std::string& name : row.parts) {
    const auto found = read.find(name);
    if (!found) return false;
    const ColumnFacts& stored = *stored_.find(name)->facts;
    const ColumnFacts& meant = meant_ ? *meant_->find(name)->facts : stored;
    const bool scaled = is_scaled(*found->channel);
    const auto is_float = [](ChannelType type) {
      return type == ChannelType::f32 || type == ChannelType::half;
    };
    const bool floats = is_float(row.channel.type) || is_float(found->channel->type);
    const Tolerance tolerance{.absolute = scaled ? std::abs(found->channel->scale) : 0,
                              .step = floats ? kFloatStep : kDoubleStep};
    if (!agree(stored, *found->facts, tolerance) && !agree(meant, *found->facts, tolerance))
      refuse(target, name, meant, *found->facts);
  }
  return true;
}

// Says whether a format holds a channel in another way than as a column, or cuts its values.
bool WrittenCheck::is_held_otherwise(const RowChannel& row) const {
  const Channel& channel = row.channel;
  if (info_.grid && (channel.name == "row" || channel.name == "column")) return true;
  // Fields of LAS have values of their own for "not known", steps and limits
  if (format_ == OutputFormat::las &&
      (las::needs_range(channel) || las::place_channel(row, info_.ranges)))
    return true;
  // The point's colour, and the same from a text
  if (channel.name == "rgb" || channel.name.starts_with("rgb_")) return true;
  return format_ == OutputFormat::bgeo &&
         (channel.type == ChannelType::u32 || channel.type == ChannelType::u64 ||
          channel.type == ChannelType::i64);
}

}  // namespace ptc
