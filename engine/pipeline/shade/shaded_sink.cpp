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
#include <cstring>
#include <numbers>
#include <vector>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/io/text/text.h"
#include "engine/pipeline/scene_record.h"
#include "engine/store/writer.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

constexpr std::uint16_t kGroup = 1;  // group of the channels that shading adds

/// The channels that shading adds to a point.
struct ShadedChannels {
  static constexpr std::size_t kPlain = 1 + 3 + 3 + 3 + 3;
  static constexpr std::size_t kFloats = kPlain + 2;  // with both estimates

  static std::vector<Channel> channels(bool estimates) {
    std::vector<Channel> channels{{"occlusion", ChannelType::half, 1, kGroup},
                                  {"bent_normal", ChannelType::half, 3, kGroup},
                                  {"irradiance", ChannelType::half, 3, kGroup},
                                  {"sky", ChannelType::half, 3, kGroup},
                                  {"indirect", ChannelType::half, 3, kGroup}};
    if (!estimates) return channels;
    channels.push_back({"occlusion_error", ChannelType::half, 1, kGroup});
    channels.push_back({"irradiance_error", ChannelType::half, 1, kGroup});
    return channels;
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

/// A cloud with the channels as columns.
class PlySink : public ShadedSink {
 public:
  PlySink(const std::filesystem::path& target, std::uint64_t count, bool estimates)
      : floats_(ShadedChannels::count(estimates)),
        writer_(target, count, ply_columns(ShadedChannels::channels(estimates))) {}
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
        meta_(from.meta()),
        writer_(target, {.page_shift = from.header().page_shift,
                         .uuid = uuid_for(from, settings),
                         .frame = from.header().frame}) {
    std::erase_if(meta_.channels, [](const Channel& c) { return c.group == kGroup; });
    const std::vector<Channel> added = ShadedChannels::channels(estimates);
    for (const Channel& channel : added) {
      if (std::ranges::find(meta_.channels, channel.name, &Channel::name) == meta_.channels.end())
        continue;
      throw DataError(from.path().string() + ": its channel " + channel.name +
                      " has the name of a channel that shading adds: name a .ply as output");
    }
    meta_.channels.insert(meta_.channels.begin(), added.begin(), added.end());
    meta_.text["shading"] = settings;
    check_meta(meta_, from.header().page_shift);
    columns_ = packed_group_columns(meta_.channels, kGroup);
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
    return static_cast<std::size_t>(
        std::min<std::uint64_t>(from_.superblock().points_per_page, left));
  }

  /// Copies all pages but the meta page and the channels of an earlier shading. Point and node
  /// pages precede all others, so they keep their numbers and references to them stay valid.
  void copy_pages() {
    std::vector<std::byte> stored;
    for (std::uint32_t page = 0; page < from_.page_count(); ++page) {
      const DirectoryEntry& entry = from_.entry(page);
      const bool earlier = entry.type == PageType::attribute && entry.group == kGroup;
      if (entry.type == PageType::meta || earlier) continue;
      const PageHeader header = from_.read_stored_page(page, stored);
      writer_.write_stored_page(writer_.reserve_page(), summary_of(header), header.coding,
                                header.raw_bytes, stored);
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
    writer_.write_page(writer_.reserve_page(),
                       {.type = PageType::attribute,
                        .group = kGroup,
                        .record_count = static_cast<std::uint32_t>(count)},
                       payload, columns_);
    written_ += count;
    values_.clear();
  }

  const ContainerReader& from_;
  std::size_t floats_;  // values of one point
  Meta meta_;
  std::vector<PackedColumn> columns_;
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

std::unique_ptr<ShadedSink> make_shaded_sink(const std::filesystem::path& target,
                                             const ContainerReader& receivers, std::uint64_t points,
                                             const std::string& settings, bool estimates) {
  if (lower_extension(target) == ".ply")
    return std::make_unique<PlySink>(target, points, estimates);
  return std::make_unique<ContainerSink>(target, receivers, settings, estimates);
}

}  // namespace ptc
