#include "engine/pipeline/build/point_marks.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "engine/pipeline/build/attributes.h"
#include "format/point_page.h"

namespace ptc {
namespace {

Channel outlier_channel() {
  return {.name = kOutlierChannel, .type = ChannelType::u8, .role = ChannelRole::label};
}

Channel rise_channel() {
  return {
      .name = kRiseChannel, .type = ChannelType::u8, .role = ChannelRole::value, .scale = 0.125};
}

/// A scan's points with their marks as flags.
class MarkedStream : public PointStream {
 public:
  explicit MarkedStream(std::unique_ptr<ScanStream> scan) : scan_(std::move(scan)) {}
  std::size_t next(std::span<PointRecord> out) override {
    const std::size_t count = scan_->next(out);
    const std::span<const std::uint8_t> marks = scan_->marks();
    for (std::size_t i = 0; i < count; ++i) out[i].flags = marks[i];
    return count;
  }

 private:
  std::unique_ptr<ScanStream> scan_;
};

/// Points whose keys differ.
class UniqueStream : public PointStream {
 public:
  explicit UniqueStream(PointStream& sorted) : sorted_(sorted) {}
  std::size_t next(std::span<PointRecord> out) override {
    for (;;) {
      const std::size_t count = sorted_.next(out);
      std::size_t kept = 0;
      for (std::size_t i = 0; i < count; ++i) {
        if (last_ && out[i].key == *last_) continue;
        last_ = out[i].key;
        out[kept++] = out[i];
      }
      if (kept > 0 || count == 0) return kept;
    }
  }

 private:
  PointStream& sorted_;
  std::optional<MortonKey> last_;  ///< of the point that was handed out last
};

/// Points without flags; the marks that these were go to a file.
class Tap : public PointStream {
 public:
  Tap(PointStream& points, TempFile& file) : points_(points), file_(file) {}
  std::size_t next(std::span<PointRecord> out) override {
    const std::size_t count = points_.next(out);
    marks_.resize(count);
    for (std::size_t i = 0; i < count; ++i)
      marks_[i] = static_cast<std::byte>(std::exchange(out[i].flags, std::uint8_t{0}));
    file_.write_at(done_, marks_);
    done_ += count;
    return count;
  }

 private:
  PointStream& points_;
  TempFile& file_;
  std::vector<std::byte> marks_;
  std::uint64_t done_ = 0;
};

/// Values of a group, into which marks are put.
class MarkedValues : public PointStream {
 public:
  MarkedValues(PointStream* values, const TempFile& marks, std::uint8_t group,
               std::span<const Channel> channels)
      : values_(values), file_(marks) {
    std::vector<Channel> own;
    std::ranges::copy_if(channels, std::back_inserter(own),
                         [group](const Channel& channel) { return channel.group == group; });
    outlier_ = place_of(own, outlier_channel());
    rise_ = place_of(own, rise_channel());
  }

  std::size_t next(std::span<PointRecord> out) override {
    std::size_t count = out.size();
    if (values_ != nullptr) {
      count = values_->next(out);
    } else {
      std::ranges::fill(out, PointRecord{});
    }
    if (count == 0 || (!outlier_ && !rise_)) return count;
    marks_.resize(count);
    file_.read_at(done_, marks_);
    done_ += count;
    for (std::size_t i = 0; i < count; ++i) {
      const auto mark = std::to_integer<std::uint8_t>(marks_[i]);
      std::byte* const row = values_of(out[i]);
      if (outlier_ && (mark & kOutlier) != 0) row[*outlier_] = std::byte{1};
      if (rise_ && mark >> kRiseShift != 0)
        row[*rise_] = static_cast<std::byte>(mark >> kRiseShift);
    }
    return count;
  }

 private:
  /// Returns where a channel lies in a row of the group, if it is of the kind that marks make.
  static std::optional<std::size_t> place_of(std::span<const Channel> own, const Channel& mark) {
    const auto found = find_in_row(own, mark.name);
    if (!found || !same_but_for_group(*found->channel, mark)) return {};
    return found->offset;
  }

  PointStream* values_;
  const TempFile& file_;
  std::optional<std::size_t> outlier_, rise_;
  std::vector<std::byte> marks_;
  std::uint64_t done_ = 0;  ///< points whose marks were read
};

}  // namespace

bool holds_marks(const Channel& channel) {
  return same_but_for_group(channel, outlier_channel()) ||
         same_but_for_group(channel, rise_channel());
}

void add_marks(Meta& meta) {
  const std::uint8_t last =
      meta.channels.empty() ? kFirstInputGroup - 1 : meta.channels.back().group;
  if (last == kMaxGroup) return;
  for (Channel channel : {outlier_channel(), rise_channel()}) {
    if (std::ranges::find(meta.channels, channel.name, &Channel::name) != meta.channels.end())
      continue;
    channel.group = static_cast<std::uint8_t>(last + 1);
    meta.channels.push_back(channel);
  }
}

std::vector<std::uint8_t> rise_groups(std::span<const Channel> channels) {
  const auto found = std::ranges::find(channels, kRiseChannel, &Channel::name);
  if (found == channels.end()) return {};
  return {found->group};
}

RisePlace::RisePlace(std::span<const Channel> channels) {
  const auto found = find_in_row(channels, kRiseChannel);
  if (!found) return;
  const Channel& channel = *found->channel;
  if (channel.type == ChannelType::u8 && channel.components == 1 && channel.scale == 0.125)
    offset_ = found->offset;
}

std::unique_ptr<PointStream> marked_points(std::unique_ptr<ScanStream> scan) {
  return std::make_unique<MarkedStream>(std::move(scan));
}

std::unique_ptr<PointStream> unique_points(PointStream& sorted) {
  return std::make_unique<UniqueStream>(sorted);
}

std::unique_ptr<PointStream> PointMarks::tap(PointStream& points) {
  return std::make_unique<Tap>(points, file_);
}

std::unique_ptr<PointStream> PointMarks::put_into(PointStream* values, std::uint8_t group,
                                                  std::span<const Channel> channels) const {
  return std::make_unique<MarkedValues>(values, file_, group, channels);
}

}  // namespace ptc
