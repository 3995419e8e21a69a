// Shaded points as columns of a PLY, or as attribute pages of a container.
//
// A container is copied page by page, without decoding, and gets an attribute page for each point
// page, and more with reflections, shadows or groups of lights. Its payload holds one column of
// halves for each component:
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
#include "engine/io/cloud/point_writer.h"
#include "engine/pipeline/convert/point_files.h"
#include "engine/store/commit.h"
#include "engine/store/writer.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr std::size_t kLightBytes = 3 * 2;  // of a colour in a container

std::size_t floats_of(const ShadedExtras& extras) {
  std::size_t floats = 0;
  for (const Channel& channel : shading_channels(extras)) floats += channel.components;
  return floats;
}

/// Appends the values of shaded surfels, in the order of the channels. The radiance that leaves is
/// albedo / pi times the irradiance.
class ShadedValues {
 public:
  ShadedValues(std::span<const Surfel> surfels, const LitReceivers& lit,
               std::span<const glm::vec3> groups)
      : surfels_(surfels),
        lit_(lit),
        groups_(groups),
        group_count_(groups.size() / std::max<std::size_t>(1, surfels.size())) {}

  void append(std::size_t i, std::vector<float>& to) const {
    const Shading& s = lit_.shading[i];
    to.push_back(s.occlusion);
    for (const glm::vec3& v :
         {s.bent_normal, s.irradiance, s.sky,
          surfels_[i].albedo * (s.irradiance + s.sky) * std::numbers::inv_pi_v<float>})
      to.insert(to.end(), {v.x, v.y, v.z});
    if (!lit_.estimates.empty()) {
      to.push_back(lit_.estimates[i].occlusion);
      to.push_back(lit_.estimates[i].irradiance);
    }
    if (!lit_.reflections.empty()) {
      const auto& [radiance, occlusion] = lit_.reflections[i];
      to.insert(to.end(), {radiance.x, radiance.y, radiance.z, occlusion});
    }
    const std::size_t shadows = lit_.shadows.size() / surfels_.size();
    const auto own = lit_.shadows.subspan(i * shadows, shadows);
    to.insert(to.end(), own.begin(), own.end());
    for (std::size_t k = 0; k < group_count_; ++k) {
      const glm::vec3& v = groups_[i * group_count_ + k];
      to.insert(to.end(), {v.x, v.y, v.z});
    }
  }

 private:
  std::span<const Surfel> surfels_;
  const LitReceivers& lit_;
  std::span<const glm::vec3> groups_;
  std::size_t group_count_;
};

/// Returns the record of a container with the channels of its shading, in place of those of an
/// earlier one. The later channels come last, as many in a group of channels as fit.
Meta shaded_meta(const ContainerReader& from, const std::string& settings,
                 const ShadedExtras& extras) {
  Meta meta = from.meta();
  std::erase_if(meta.channels,
                [&](const Channel& c) { return holds_shading(from.meta().channels, c.group); });
  std::vector<Channel> added = shading_channels(extras);
  const auto later_count = static_cast<std::ptrdiff_t>(later_channels(extras));
  const std::vector<Channel> later(added.end() - later_count, added.end());
  added.resize(added.size() - later.size());
  meta.channels.insert(meta.channels.begin(), added.begin(), added.end());
  std::size_t left = 0;
  for (Channel channel : later) {
    const std::size_t bytes = std::size_t{2} * channel.components;
    unsigned group = meta.channels.back().group;
    if (left < bytes) {
      ++group;
      left = kPointBytes;
    }
    left -= bytes;
    if (group > kMaxGroup)
      throw DataError(from.path().string() + ": its channels leave no room for those of shading");
    channel.group = static_cast<std::uint8_t>(group);
    meta.channels.push_back(std::move(channel));
  }
  meta.text["shading"] = settings;
  return meta;
}

/// A file of points with the receivers' own channels, and those of shading as floats.
class PointSink : public ShadedSink {
 public:
  PointSink(const std::filesystem::path& target, OutputFormat format, PointWriteInfo info,
            const ShadedExtras& extras)
      : floats_(floats_of(extras)) {
    for (Channel channel : shading_channels(extras)) {
      channel.type = ChannelType::f32;
      info.channels.push_back(std::move(channel));
    }
    writer_ = create_points(target, format, info);
  }

  void write(std::span<const Surfel> surfels, std::span<const std::byte> rows,
             const LitReceivers& lit, std::span<const glm::vec3> groups) override {
    const std::size_t row_bytes = rows.size() / surfels.size();
    const std::size_t added = floats_ * sizeof(float);
    joined_.resize(surfels.size() * (row_bytes + added));
    std::byte* to = joined_.data();
    const ShadedValues values(surfels, lit, groups);
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      values_.clear();
      values.append(i, values_);
      to = std::copy_n(rows.data() + i * row_bytes, row_bytes, to);
      std::memcpy(to, values_.data(), added);
      to += added;
    }
    writer_->write(surfels, joined_);
  }
  void finish() override { writer_->finish(); }

 private:
  std::size_t floats_;  // values that shading adds to a point
  std::unique_ptr<PointWriter> writer_;
  std::vector<float> values_;      // of a point
  std::vector<std::byte> joined_;  // rows of a block
};

/// A copy of the receivers' container with an attribute page more for each point page, and more for
/// reflections, shadows and groups of lights. Channels of an earlier shading are left out.
class ContainerSink : public ShadedSink {
 public:
  ContainerSink(const std::filesystem::path& target, const ContainerReader& from,
                const std::string& settings, const ShadedExtras& extras)
      : from_(from),
        floats_(floats_of(extras)),
        meta_(shaded_meta(from, settings, extras)),
        writer_(target, {.page_shift = from.header().page_shift,
                         .uuid = uuid_for(from, settings),
                         .frame = from.header().frame,
                         .point_bytes = from.header().point_bytes,
                         .source = &from.file()}) {
    assert(settings.size() <= kMaxSettingsBytes);
    for (const Channel& channel : shading_channels(extras))
      added_.push_back(*std::ranges::find(meta_.channels, channel.name, &Channel::name));
    copy_pages();
  }

  void write(std::span<const Surfel> surfels, std::span<const std::byte> /*rows*/,
             const LitReceivers& lit, std::span<const glm::vec3> groups) override {
    const ShadedValues values(surfels, lit, groups);
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      values.append(i, values_);
      if (values_.size() == page_points() * floats_) flush();
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
    std::array<bool, kMaxGroup + 1> replaced{};  // by group
    for (const std::uint8_t group : from_.groups())
      replaced[group] = holds_shading(from_.meta().channels, group);
    for (std::uint32_t page = 0; page < from_.meta_page(); ++page) {
      const DirectoryEntry& entry = from_.entry(page);
      if (entry.type == PageType::attribute && replaced[entry.group]) continue;
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

  /// Writes the collected values as one attribute page for each group, column by column.
  void flush() {
    const std::size_t count = values_.size() / floats_;
    std::size_t first = 0;  // value of the first channel
    for (std::size_t begin = 0, end = 0; begin < added_.size(); begin = end) {
      std::size_t floats = 0;
      for (; end < added_.size() && added_[end].group == added_[begin].group; ++end)
        floats += added_[end].components;
      std::vector<std::byte> payload(count * floats * 2);
      for (std::size_t c = 0; c < floats; ++c) {
        for (std::size_t i = 0; i < count; ++i) {
          const std::uint16_t half = encode_half(values_[i * floats_ + first + c]);
          std::memcpy(payload.data() + 2 * (c * count + i), &half, 2);
        }
      }
      writer_.write_attributes(added_[begin].group, payload, static_cast<std::uint32_t>(count),
                               meta_.channels);
      first += floats;
    }
    written_ += count;
    values_.clear();
  }

  const ContainerReader& from_;
  std::size_t floats_;  // values of one point
  Meta meta_;
  std::vector<Channel> added_;  // of meta_, what shading adds
  ContainerWriter writer_;
  std::vector<float> values_;  // of the points of a page, point after point
  std::uint64_t written_ = 0;
};

}  // namespace

PointWriteInfo shaded_points(const ContainerReader& receivers, std::uint64_t points,
                             const std::string& settings, const std::string& colour_from,
                             std::optional<OutputFormat> format) {
  PointWriteInfo info = describe_points(receivers, {.colour_from = colour_from}, format);
  info.count = points;
  std::erase_if(info.channels, [&](const Channel& c) {
    return holds_shading(receivers.meta().channels, c.group);
  });
  info.text["shading"] = settings;
  return info;
}

std::uint64_t sink_bytes(const std::filesystem::path& target, const ContainerReader& receivers,
                         std::size_t later) noexcept {
  if (output_format(target)) return 0;
  // There is at most one attribute page of each group of channels for each page
  return ContainerWriter::memory_bytes(
      (2 + (later + kPointBytes / kLightBytes - 1) / (kPointBytes / kLightBytes)) *
          std::uint64_t{receivers.page_count()},
      receivers.header().page_shift, 1);
}

void check_shaded_sink(const std::filesystem::path& target, const ContainerReader& receivers,
                       const ShadedExtras& extras) {
  if (output_format(target)) return;
  at_offset(receivers.file(), 0, [&] { check_copyable(receivers.header()); });
  const std::string file = receivers.path().string();
  if (!receivers.parts().empty()) {
    throw DataError(file +
                    ": a scene of parts cannot be written with its shading: make it one file first "
                    "with ptcconvert, or name a .ply as output");
  }
  for (const Channel& added : shading_channels(extras)) {
    const auto clashes = [&](const Channel& c) {
      return c.name == added.name && !holds_shading(receivers.meta().channels, c.group);
    };
    if (std::ranges::none_of(receivers.meta().channels, clashes)) continue;
    throw DataError(file + ": its channel " + added.name +
                    " has the name of a channel that shading adds: name a .ply as output");
  }
  const std::string settings(kMaxSettingsBytes, ' ');
  const std::size_t bytes =
      encode_meta(shaded_meta(receivers, settings, extras), receivers.header().point_bytes).size();
  const std::size_t most = payload_limit(receivers.header().page_shift);
  if (bytes <= most) return;
  throw DataError(fmt::format(
      "{}: with the shaded channels, the record of lights, inputs and channels takes up to {} "
      "bytes, but a page of this container holds {}: convert it to larger pages first, or name a "
      ".ply as output",
      file, bytes, most));
}

std::unique_ptr<ShadedSink> make_shaded_sink(const std::filesystem::path& target,
                                             const ContainerReader& receivers,
                                             const PointWriteInfo& info,
                                             const ShadedExtras& extras) {
  if (const auto format = output_format(target))
    return std::make_unique<PointSink>(target, *format, info, extras);
  return std::make_unique<ContainerSink>(target, receivers, info.text.at("shading"), extras);
}

}  // namespace ptc
