// Shaded points as columns of a PLY, or as attribute pages of a container.
//
// A container is copied page by page, without decoding, and gets one attribute page for each point
// page. Its payload holds one column of halves for each component:
//
//   copied pages, without meta page    | new attribute pages                    | meta page
//   point and node pages, old channels | occlusion occlusion ... bent_normal.x bent_normal.x ...
#include "engine/pipeline/shade/shaded_sink.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>
#include <numbers>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/io/text/text.h"
#include "engine/store/commit.h"
#include "engine/store/writer.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr std::uint8_t kGroup = 1;  // group of the channels that shading adds

/// The channels that shading adds to a point.
struct ShadedChannels {
  static constexpr std::size_t kPlain = 1 + 3 + 3 + 3 + 3;
  static constexpr std::size_t kFloats = kPlain + 2;  // with both estimates

  static std::vector<Channel> channels(bool estimates) {
    std::vector<Channel> channels{
        number("occlusion", "1"),
        {.name = "bent_normal", .components = 3, .role = ChannelRole::direction, .unit = "1"},
        colour("irradiance", "W/m^2"),
        colour("sky", "W/m^2"),
        colour("indirect", "W/(m^2 sr)")};
    if (!estimates) return channels;
    channels.push_back(number("occlusion_error", "1"));
    channels.push_back(number("irradiance_error", "W/m^2"));
    return channels;
  }
  static Channel number(const char* name, const char* unit) { return {.name = name, .unit = unit}; }
  static Channel colour(const char* name, const char* unit) {
    return {.name = name,
            .components = 3,
            .role = ChannelRole::colour,
            .colour_space = ColourSpace::rec709,
            .unit = unit};
  }
  static std::size_t count(bool estimates) { return estimates ? kFloats : kPlain; }
};

using ShadedValues = std::array<float, ShadedChannels::kFloats>;

/// Returns the values of a shaded surfel in the order of the channels. The radiance that leaves is
/// albedo / pi times the irradiance.
ShadedValues values_of(const Shading& s, const glm::vec3& albedo, const ErrorEstimate& estimate) {
  const glm::vec3 out = albedo * (s.irradiance + s.sky) * std::numbers::inv_pi_v<float>;
  return {s.occlusion,
          s.bent_normal.x,
          s.bent_normal.y,
          s.bent_normal.z,
          s.irradiance.r,
          s.irradiance.g,
          s.irradiance.b,
          s.sky.r,
          s.sky.g,
          s.sky.b,
          out.r,
          out.g,
          out.b,
          estimate.occlusion,
          estimate.irradiance};
}

/// Returns the record of a container with the channels of its shading, in place of those of an
/// earlier one.
Meta shaded_meta(const ContainerReader& from, const std::string& settings, bool estimates) {
  Meta meta = from.meta();
  std::erase_if(meta.channels, [](const Channel& c) { return c.group == kGroup; });
  const std::vector<Channel> added = ShadedChannels::channels(estimates);
  meta.channels.insert(meta.channels.begin(), added.begin(), added.end());
  meta.text["shading"] = settings;
  return meta;
}

/// A cloud with the channels as columns.
class PlySink : public ShadedSink {
 public:
  PlySink(const std::filesystem::path& target, std::uint64_t count, bool emits, bool estimates)
      : floats_(ShadedChannels::count(estimates)),
        writer_(target, count, emits, ply_columns(ShadedChannels::channels(estimates))) {}
  void write(std::span<const Surfel> surfels, std::span<const Shading> shading,
             std::span<const ErrorEstimate> estimates) override {
    std::vector<float> values;
    values.reserve(surfels.size() * floats_);
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      const ShadedValues v = values_of(shading[i], surfels[i].albedo,
                                       estimates.empty() ? ErrorEstimate{} : estimates[i]);
      values.insert(values.end(), v.begin(), v.begin() + static_cast<std::ptrdiff_t>(floats_));
    }
    writer_.write(surfels, values);
  }
  void finish() override { writer_.finish(); }

 private:
  std::size_t floats_;  // values of one point
  PlyWriter writer_;
};

/// A copy of the receivers' container with one attribute page more for each point page. Channels of
/// an earlier shading are left out.
class ContainerSink : public ShadedSink {
 public:
  ContainerSink(const std::filesystem::path& target, const ContainerReader& from,
                const std::string& settings, bool estimates)
      : from_(from),
        floats_(ShadedChannels::count(estimates)),
        meta_(shaded_meta(from, settings, estimates)),
        writer_(target, {.page_shift = from.header().page_shift,
                         .uuid = uuid_for(from, settings),
                         .frame = from.header().frame,
                         .point_bytes = from.header().point_bytes,
                         .source = &from.file()}) {
    assert(settings.size() <= kMaxSettingsBytes);
    copy_pages();
  }

  void write(std::span<const Surfel> surfels, std::span<const Shading> shading,
             std::span<const ErrorEstimate> estimates) override {
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      values_.push_back(values_of(shading[i], surfels[i].albedo,
                                  estimates.empty() ? ErrorEstimate{} : estimates[i]));
      if (values_.size() == page_points()) flush();
    }
  }

  void finish() override {
    if (!values_.empty()) flush();
    writer_.finish(meta_, from_.superblock());
  }

 private:
  static Uuid uuid_for(const ContainerReader& from, const std::string& settings) {
    std::string text(reinterpret_cast<const char*>(from.header().uuid.data()), sizeof(Uuid));
    text += settings;
    return uuid_of(std::as_bytes(std::span(text)));
  }

  [[nodiscard]] std::size_t page_points() const {
    const std::uint64_t left = from_.superblock().points - written_;
    return static_cast<std::size_t>(std::min<std::uint64_t>(points_per_page(from_.header()), left));
  }

  /// Copies all pages but the meta page and the channels of an earlier shading, with their ranks.
  void copy_pages() {
    std::vector<std::byte> stored;
    const std::size_t tail = from_.page_count() - from_.superblock().tail.size();
    for (std::uint32_t page = 0; page < from_.meta_page(); ++page) {
      const DirectoryEntry& entry = from_.entry(page);
      if (entry.type == PageType::attribute && entry.group == kGroup) continue;
      const std::uint32_t rank = writer_.reserve_page(entry.type, entry.group);
      if (entry.is_void()) {
        writer_.write_void_page({.type = entry.type,
                                 .group = entry.group,
                                 .rank = rank,
                                 .record_count = entry.record_count});
        continue;
      }
      const PageHeader header = from_.read_stored_page(page, stored);
      const auto write =
          page < tail ? &ContainerWriter::write_stored_page : &ContainerWriter::keep_stored_page;
      (writer_.*write)(summary_of(header), header.coding, header.raw_bytes, stored);
    }
  }

  /// Writes the collected values as one attribute page, column by column.
  void flush() {
    const std::size_t count = values_.size();
    std::vector<std::byte> payload(count * floats_ * 2);
    for (std::size_t c = 0; c < floats_; ++c) {
      for (std::size_t i = 0; i < count; ++i) {
        const std::uint16_t half = encode_half(values_[i][c]);
        std::memcpy(payload.data() + 2 * (c * count + i), &half, 2);
      }
    }
    writer_.write_attributes(kGroup, payload, static_cast<std::uint32_t>(count), meta_.channels);
    written_ += count;
    values_.clear();
  }

  const ContainerReader& from_;
  std::size_t floats_;  // values of one point
  Meta meta_;
  ContainerWriter writer_;
  std::vector<ShadedValues> values_;
  std::uint64_t written_ = 0;
};

}  // namespace

std::uint64_t sink_bytes(const std::filesystem::path& target,
                         const ContainerReader& receivers) noexcept {
  if (lower_extension(target) == ".ply") return 0;
  // There is at most one attribute page for each page
  return ContainerWriter::memory_bytes(2 * std::uint64_t{receivers.page_count()},
                                       receivers.header().page_shift, 1);
}

void check_shaded_sink(const std::filesystem::path& target, const ContainerReader& receivers,
                       bool estimates) {
  if (lower_extension(target) == ".ply") return;
  at_offset(receivers.file(), 0, [&] { check_copyable(receivers.header()); });
  const std::string file = receivers.path().string();
  if (!receivers.parts().empty()) {
    throw DataError(file +
                    ": a scene of parts cannot be written with its shading: make it one file first "
                    "with ptcconvert, or name a .ply as output");
  }
  for (const Channel& added : ShadedChannels::channels(estimates)) {
    const auto clashes = [&](const Channel& c) {
      return c.group != kGroup && c.name == added.name;
    };
    if (std::ranges::none_of(receivers.meta().channels, clashes)) continue;
    throw DataError(file + ": its channel " + added.name +
                    " has the name of a channel that shading adds: name a .ply as output");
  }
  const std::string settings(kMaxSettingsBytes, ' ');
  const std::size_t bytes =
      encode_meta(shaded_meta(receivers, settings, estimates), receivers.header().point_bytes)
          .size();
  const std::size_t most = payload_limit(receivers.header().page_shift);
  if (bytes <= most) return;
  throw DataError(fmt::format(
      "{}: with the shaded channels, the record of lights, inputs and channels takes up to {} "
      "bytes, but a page of this container holds {}: convert it to larger pages first, or name a "
      ".ply as output",
      file, bytes, most));
}

std::unique_ptr<ShadedSink> make_shaded_sink(const std::filesystem::path& target,
                                             const ContainerReader& receivers, std::uint64_t points,
                                             const std::string& settings, bool estimates) {
  if (lower_extension(target) == ".ply")
    return std::make_unique<PlySink>(target, points, receivers.header().point_bytes != kPointBytes,
                                     estimates);
  return std::make_unique<ContainerSink>(target, receivers, settings, estimates);
}

}  // namespace ptc
