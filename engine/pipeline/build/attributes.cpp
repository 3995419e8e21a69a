// A plan copies few long runs of bytes rather than many values: channels that follow each other in
// a row and in a group are one piece.
//
//   row    | intensity | returns | class | time |                 rgb |
//   piece    <------------- 20 bytes ---------->   <---- 6 bytes ---->
//   group 2  intensity returns class time          group 3  rgb
#include "engine/pipeline/build/attributes.h"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <iterator>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/pipeline/build/unknown_values.h"
#include "engine/pipeline/shade/shading_channels.h"
#include "engine/sort/point_streams.h"
#include "engine/store/attribute_rows.h"
#include "engine/store/container_points.h"
#include "format/container.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr std::size_t kGrain = 1 << 11;  // records that a thread fills at once
constexpr std::uint64_t kMaxGroups = kMaxGroup - kFirstInputGroup + 1;

/// Returns whether two channels hold the same kind of value. Their groups and the values that
/// stand for "not known" do not matter.
bool same_kind(Channel a, const Channel& b) {
  a.no_value = b.no_value;
  return same_but_for_group(std::move(a), b);
}

/// Returns whether the values of two channels of the same kind can stand in one: each value that
/// stands for "not known" does so in both, or its other channel has no such value.
/// @param taken_a, taken_b  whether a point has usual_no_value() in the channel
bool agree_on_unknown(const Channel& a, bool taken_a, const Channel& b, bool taken_b) {
  if (a.no_value == b.no_value) return true;
  if (a.no_value && b.no_value) return false;
  return (a.no_value ? a : b).no_value == usual_no_value(a) && !(a.no_value ? taken_b : taken_a);
}

/// Returns a name of at most 31 bytes that ends in `ending`.
std::string with_ending(const std::string& name, const std::string& ending) {
  constexpr std::size_t kMaxName = 31;
  return name.substr(0, kMaxName - ending.size()) + ending;
}

/// Divides a channel that takes more than a group holds.
std::vector<Channel> divided(const Channel& channel) {
  const std::size_t most = kGroupBytes / channel.component_bytes();
  if (channel.components <= most) return {channel};
  std::vector<Channel> parts;
  for (unsigned done = 0; done < channel.components; done += parts.back().components) {
    Channel part = channel;
    part.components =
        static_cast<std::uint8_t>(std::min<std::size_t>(most, channel.components - done));
    part.role = ChannelRole::value;  // a part of a vector is no vector
    part.name = with_ending(channel.name, fmt::format("_{}", parts.size()));
    parts.push_back(part);
  }
  return parts;
}

/// Fills values with those of a channel of which nothing is known.
void fill_unknown(const Channel& channel, std::byte* to) {
  const std::uint64_t bits = channel.no_value.value_or(0);
  for (unsigned c = 0; c < channel.components; ++c)
    std::memcpy(to + c * channel.component_bytes(), &bits, channel.component_bytes());
}

/// The values of one group for the points of a container.
class ContainerAttributes : public PointStream {
 public:
  ContainerAttributes(const ContainerReader& container, const AttributePlan& plan,
                      std::size_t group)
      : plan_(plan), group_(group), points_(container), scan_(container), rows_(container) {}

  std::size_t next(std::span<PointRecord> out) override {
    // The keys come from the points, the values from the rows of the same pages
    if (left_ == 0) {
      if (!scan_.next()) return 0;
      left_ = scan_.count();
      at_ = rows_.read(scan_.index(), left_).data();
    }
    const std::size_t count = std::min<std::size_t>(left_, out.size());
    if (read_full(points_, out.first(count)) != count) return 0;
    const std::size_t bytes = count * rows_.row_bytes();
    plan_.fill(0, {at_, bytes}, done_, group_, out.first(count));
    at_ += bytes;
    done_ += count;
    left_ -= static_cast<std::uint32_t>(count);
    return count;
  }

 private:
  const AttributePlan& plan_;
  std::size_t group_;
  ContainerPoints points_;
  PointScan scan_;  ///< one page ahead of the points
  AttributeRows rows_;
  const std::byte* at_ = nullptr;  ///< the next row of the page
  std::uint32_t left_ = 0;         ///< rows that are left of the page
  std::uint64_t done_ = 0;         ///< points that next() has returned
};

}  // namespace

bool same_but_for_group(Channel a, const Channel& b) {
  a.group = b.group;
  return a == b;
}

std::size_t AttributePlan::add_channel(Channel channel, bool taken) {
  // Put the channel behind the last one, or into a new group. Those of a shading have groups of
  // their own, because the next shading replaces them
  const std::size_t bytes = channel.bytes();
  if (group_bytes_.empty() || group_bytes_.back() + bytes > kGroupBytes ||
      is_shading(channels_.back()) != is_shading(channel)) {
    if (group_bytes_.size() == kMaxGroups)
      throw RequestError("inputs", "the inputs have more channels than a container can hold");
    group_bytes_.push_back(0);
    unknown_.resize(unknown_.size() + kGroupBytes);
  }
  const Place place{group_bytes_.size() - 1, group_bytes_.back()};
  group_bytes_.back() += bytes;
  channel.group = static_cast<std::uint8_t>(kFirstInputGroup + place.group);
  fill_unknown(channel, unknown_.data() + place.group * kGroupBytes + place.offset);
  channels_.push_back(std::move(channel));
  places_.push_back(place);
  taken_.push_back(taken);
  return channels_.size() - 1;
}

void AttributePlan::set_no_value(std::size_t channel, std::uint64_t bits) {
  const Place& place = places_[channel];
  channels_[channel].no_value = bits;
  fill_unknown(channels_[channel], unknown_.data() + place.group * kGroupBytes + place.offset);
}

std::size_t AttributePlan::join(const Channel& channel, bool taken, const Input& input) {
  // Look for the same channel of an earlier input, then for a name that is free
  Channel wanted = channel;
  const std::vector<Channel> added = shading_channels({.estimates = true});
  for (unsigned number = 2;; ++number) {
    const bool reserved = std::ranges::find(added, wanted.name, &Channel::name) != added.end() &&
                          !(input.shaded && is_shading(wanted));
    const auto found = std::ranges::find(channels_, wanted.name, &Channel::name);
    if (!reserved && found == channels_.end()) return add_channel(std::move(wanted), taken);
    const auto at = static_cast<std::size_t>(found - channels_.begin());
    if (!reserved && std::ranges::find(input.channels, at) == input.channels.end() &&
        same_kind(wanted, *found) && agree_on_unknown(wanted, taken, *found, taken_[at])) {
      if (wanted.no_value && !found->no_value) set_no_value(at, *wanted.no_value);
      taken_[at] = taken_[at] || taken;
      return at;
    }
    wanted.name = with_ending(channel.name, fmt::format("_{}", number));
  }
}

std::size_t AttributePlan::add_input(std::span<const Channel> channels,
                                     const std::vector<bool>& taken) {
  Input input{.shaded = have_shading(channels)};
  for (std::size_t i = 0; i < channels.size(); ++i) {
    for (const Channel& channel : divided(channels[i])) {
      const std::size_t index = join(channel, !taken.empty() && taken[i], input);
      const Place& place = places_[index];
      input.channels.push_back(index);
      input.indexed |= channel.name == kOriginalIndex;
      const std::size_t bytes = channel.bytes();
      Piece* const last = input.pieces.empty() ? nullptr : &input.pieces.back();
      if (last && last->group == place.group && last->to + last->bytes == place.offset) {
        last->bytes += bytes;  // rows have no gaps, so the piece goes on in the row, too
      } else {
        input.pieces.push_back({input.row_bytes, place.group, place.offset, bytes});
      }
      input.row_bytes += bytes;
    }
  }
  inputs_.push_back(std::move(input));
  return inputs_.size() - 1;
}

void AttributePlan::add_original_index() {
  index_ = join({.name = kOriginalIndex, .type = ChannelType::u64, .role = ChannelRole::index},
                false, {});
}

bool AttributePlan::has(std::size_t input, std::size_t channel) const {
  if (channel == index_) return true;
  if (input == kNoInput) return false;
  const std::vector<std::size_t>& own = inputs_[input].channels;
  return std::ranges::find(own, channel) != own.end();
}

bool AttributePlan::mark_unknown(std::size_t channel) {
  const Channel& marked = channels_[channel];
  if (marked.no_value) return true;
  const std::optional<std::uint64_t> usual = usual_no_value(marked);
  if (!usual || taken_[channel]) return false;
  set_no_value(channel, *usual);
  return true;
}

void AttributePlan::fill(std::size_t input, std::span<const std::byte> rows, std::uint64_t first,
                         std::size_t group, std::span<PointRecord> records) const {
  const std::byte* const unknown = unknown_.data() + group * kGroupBytes;
  for (PointRecord& record : records) std::memcpy(values_of(record), unknown, kGroupBytes);
  if (input != kNoInput) {
    const Input& from = inputs_[input];
    for (const Piece& piece : from.pieces) {
      if (piece.group != group) continue;
      const std::byte* row = rows.data() + piece.from;
      for (PointRecord& record : records) {
        std::memcpy(values_of(record) + piece.to, row, piece.bytes);
        row += from.row_bytes;
      }
    }
  }
  if (!index_ || places_[*index_].group != group) return;
  if (input != kNoInput && inputs_[input].indexed) return;
  for (PointRecord& record : records) {
    std::memcpy(values_of(record) + places_[*index_].offset, &first, sizeof first);
    ++first;
  }
}

AttributeSorts::AttributeSorts(const AttributePlan& plan, SortOptions options,
                               std::span<const std::filesystem::path> kept,
                               const Executor& executor, std::span<const MortonKey> sample)
    : executor_(&executor) {
  constexpr std::size_t kShort = kSpilledBytes - sizeof(MortonKey);
  for (std::size_t group = 0; group < plan.groups(); ++group) {
    options.emits = plan.group_bytes(group) > kShort;
    const std::size_t files = kept.size() / plan.groups();
    const auto names = kept.subspan(group * files, files);
    options.kept_files.assign(names.begin(), names.end());
    sorts_.push_back(std::make_unique<ExternalSorter>(options, executor, sample));
  }
}

AttributeSorts::AttributeSorts(const SortOptions& options, const Executor& executor,
                               StateReader& state)
    : executor_(&executor) {
  for (std::uint64_t left = state.get_count(kMaxGroups); left > 0; --left)
    sorts_.push_back(std::make_unique<ExternalSorter>(options, executor, state));
}

void AttributeSorts::add(const AttributePlan& plan, std::span<const PointRecord> points,
                         std::size_t input, std::span<const std::byte> rows, std::uint64_t first) {
  const std::size_t row_bytes = input == AttributePlan::kNoInput ? 0 : plan.row_bytes(input);
  block_.resize(points.size());
  for (std::size_t group = 0; group < sorts_.size(); ++group) {
    executor_->for_ranges(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) block_[i].key = points[i].key;
      plan.fill(input, rows.subspan(begin * row_bytes, (end - begin) * row_bytes), first + begin,
                group, std::span(block_).subspan(begin, end - begin));
    });
    sorts_[group]->add(block_);
  }
}

std::uint64_t AttributeSorts::expected_spill() const noexcept {
  std::uint64_t bytes = 0;
  for (const auto& sort : sorts_) bytes += sort->expected_spill();
  return bytes;
}

std::vector<RecordsDigest> AttributeSorts::digest() const {
  std::vector<RecordsDigest> digests;
  for (const auto& sort : sorts_) digests.push_back(sort->digest());
  return digests;
}

void AttributeSorts::keep(StateWriter& state) {
  state.put(std::uint64_t{sorts_.size()});
  for (const auto& sort : sorts_) sort->keep(state);
}

void write_attribute_pages(PointStream& values, std::uint8_t group,
                           std::span<const Channel> channels, std::uint64_t points,
                           ContainerWriter& writer) {
  std::vector<Channel> own;
  std::ranges::copy_if(channels, std::back_inserter(own),
                       [&](const Channel& channel) { return channel.group == group; });
  const std::size_t row_bytes = group_point_bytes(channels, group);
  std::vector<PointRecord> block(points_per_page(writer.header()));
  std::vector<std::byte> payload;
  for (std::uint64_t left = points; left > 0;) {
    const std::size_t count =
        read_full(values, std::span(block).first(std::min<std::uint64_t>(block.size(), left)));
    assert(count > 0);  // each sort of a build has a record for every point
    payload.resize(count * row_bytes);
    const std::span<const std::byte> rows(values_of(block.front()),
                                          (count - 1) * sizeof(PointRecord) + row_bytes);
    rows_to_columns(own, rows, sizeof(PointRecord), 0, static_cast<std::uint32_t>(count), payload);
    writer.write_attributes(group, payload, static_cast<std::uint32_t>(count), channels);
    left -= count;
  }
}

AttributePlan plan_of(const std::vector<Channel>* scene, std::span<const Channel> channels) {
  AttributePlan plan;
  if (scene) plan.add_input(*scene);
  plan.add_input(channels);
  if (std::ranges::find(channels, kOriginalIndex, &Channel::name) != channels.end())
    plan.add_original_index();
  return plan;
}

std::unique_ptr<PointStream> container_attributes(const ContainerReader& container,
                                                  const AttributePlan& plan, std::size_t group) {
  return std::make_unique<ContainerAttributes>(container, plan, group);
}

}  // namespace ptc
