#include "engine/pipeline/build/unknown_values.h"

#include <algorithm>
#include <cstring>

#include <fmt/format.h>

#include "engine/io/cloud/point_rows.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/build/point_marks.h"
#include "engine/store/attribute_rows.h"

namespace ptc {
namespace {

/// Says whether a component of any row is `usual`.
template <class T>
bool occurs(std::span<const std::byte> rows, std::size_t row_bytes, std::size_t offset,
            unsigned components, std::uint64_t usual) noexcept {
  for (std::size_t row = offset; row < rows.size(); row += row_bytes) {
    for (unsigned c = 0; c < components; ++c) {
      T value;
      std::memcpy(&value, rows.data() + row + c * sizeof value, sizeof value);
      if (value == static_cast<T>(usual)) return true;
    }
  }
  return false;
}

/// Channels that the same sources lack, and that say so in the same way.
struct Lack {
  std::vector<std::string> sources;
  bool marked = false;
  std::vector<std::string> channels;
};

std::string text_of(const Lack& lack) {
  const std::size_t others = lack.sources.size() - 1;
  std::string who = lack.sources.front();
  if (others > 0) who += fmt::format(" and {} other input{}", others, others == 1 ? "" : "s");
  return fmt::format(
      "{} {} no {}: {}", who, others > 0 ? "have" : "has", fmt::join(lack.channels, ", "),
      lack.marked ? "these values are marked as not known"
                  : "0 stands there, because other points use the value that would mark what is "
                    "not known");
}

}  // namespace

std::optional<std::uint64_t> usual_no_value(const Channel& channel) noexcept {
  switch (channel.type) {
    case ChannelType::half:
      return 0x7e00;
    case ChannelType::f32:
      return 0x7fc00000;
    case ChannelType::f64:
      return 0x7ff8000000000000;
    case ChannelType::u8:
    case ChannelType::u16:
    case ChannelType::u32:
    case ChannelType::u64:
      return ~std::uint64_t{0} >> (64 - 8 * channel_bytes(channel.type));
    case ChannelType::i8:
    case ChannelType::i16:
    case ChannelType::i32:
    case ChannelType::i64:
      return std::uint64_t{1} << (8 * channel_bytes(channel.type) - 1);
  }
  return std::nullopt;
}

bool is_watched(const Channel& channel) noexcept {
  return usual_no_value(channel) && is_integer(channel.type) && !channel.no_value;
}

ValueWatch::ValueWatch(std::span<const Channel> channels)
    : taken_(channels.size()), row_bytes_(row_bytes(channels)) {
  std::size_t offset = 0;
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const Channel& channel = channels[i];
    if (is_watched(channel)) {
      watched_.push_back(
          {i, offset, channel.component_bytes(), channel.components, *usual_no_value(channel)});
    }
    offset += channel.bytes();
  }
}

void ValueWatch::add(std::span<const std::byte> rows) {
  const auto is_taken = [&](const Watched& w) {
    switch (w.bytes) {
      case 1:
        return occurs<std::uint8_t>(rows, row_bytes_, w.offset, w.components, w.usual);
      case 2:
        return occurs<std::uint16_t>(rows, row_bytes_, w.offset, w.components, w.usual);
      case 4:
        return occurs<std::uint32_t>(rows, row_bytes_, w.offset, w.components, w.usual);
      default:
        return occurs<std::uint64_t>(rows, row_bytes_, w.offset, w.components, w.usual);
    }
  };
  std::erase_if(watched_, [&](const Watched& w) {
    if (!is_taken(w)) return false;
    taken_[w.channel] = true;
    return true;
  });
}

std::vector<bool> taken_values(const ContainerReader& container, const std::vector<bool>& wanted) {
  // Read the groups that have a channel to look at
  const std::vector<Channel>& all = container.meta().channels;
  std::vector<Channel> looked_at;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (wanted[i]) looked_at.push_back(all[i]);
  }
  const std::vector<std::uint8_t> groups = channel_groups(looked_at);
  AttributeRows rows(container, groups);
  ValueWatch watch(rows.channels());
  const PageNumbers::Range pages = container.point_pages();
  for (std::size_t rank = 0; rank < pages.size() && !groups.empty() && !watch.done(); ++rank)
    watch.add(rows.read(rank, container.entry(pages[rank]).record_count));

  // Give the channels that were read their places among all
  std::vector<bool> taken(all.size());
  std::size_t read = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (std::ranges::find(groups, all[i].group) == groups.end()) continue;
    taken[i] = watch.taken()[read++];
  }
  return taken;
}

void mark_unknown_values(AttributePlan& plan, std::span<const BuildSource> sources,
                         Progress& progress) {
  std::vector<Lack> lacks;
  for (std::size_t i = 0; i < plan.channels().size(); ++i) {
    if (holds_marks(plan.channels()[i])) continue;
    std::vector<std::string> names;
    for (const BuildSource& source : sources) {
      if (!plan.has(source.input, i)) names.push_back(source.name);
    }
    if (names.empty()) continue;
    const bool marked = plan.mark_unknown(i);
    const auto same = std::ranges::find_if(
        lacks, [&](const Lack& lack) { return lack.marked == marked && lack.sources == names; });
    Lack& lack =
        same == lacks.end() ? lacks.emplace_back(Lack{std::move(names), marked, {}}) : *same;
    lack.channels.push_back(plan.channels()[i].name);
  }
  for (const Lack& lack : lacks) progress.note(text_of(lack));
}

}  // namespace ptc
