#include "engine/pipeline/build/point_marks.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "engine/pipeline/build/attributes.h"
#include "format/point_page.h"

namespace ptc {
namespace {

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

}  // namespace

bool add_marks(Meta& meta) {
  const std::uint8_t last =
      meta.channels.empty() ? kFirstInputGroup - 1 : meta.channels.back().group;
  const auto is_taken = [](const Channel& channel) {
    return channel.name == kOutlierChannel || channel.name == kRiseChannel;
  };
  if (last == kMaxGroup || std::ranges::any_of(meta.channels, is_taken)) return false;
  Channel channel{.name = kOutlierChannel,
                  .type = ChannelType::u8,
                  .group = static_cast<std::uint8_t>(last + 1),
                  .role = ChannelRole::label};
  meta.channels.push_back(channel);
  channel.name = kRiseChannel;
  channel.role = ChannelRole::value;
  channel.scale = 0.125;
  meta.channels.push_back(channel);
  return true;
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

void PointMarks::write(std::uint64_t points, std::span<const Channel> channels,
                       ContainerWriter& writer) {
  std::vector<std::byte> marks, payload;
  for (std::uint64_t done = 0; done < points; done += marks.size()) {
    marks.resize(static_cast<std::size_t>(
        std::min<std::uint64_t>(points_per_page(writer.header()), points - done)));
    file_.read_at(done, marks);
    // The column of outliers precedes that of rises
    payload.resize(2 * marks.size());
    for (std::size_t i = 0; i < marks.size(); ++i) {
      const auto mark = std::to_integer<std::uint8_t>(marks[i]);
      payload[i] = static_cast<std::byte>(mark & kOutlier);
      payload[marks.size() + i] = static_cast<std::byte>(mark >> kRiseShift);
    }
    writer.write_attributes(channels.back().group, payload,
                            static_cast<std::uint32_t>(marks.size()), channels);
  }
}

}  // namespace ptc
