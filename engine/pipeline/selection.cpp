#include "engine/pipeline/selection.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/cloud/point_rows.h"

namespace ptc {
namespace {

/// Returns the names of channels for an error.
std::string names_of(std::span<const Channel> channels) {
  std::string names;
  for (const Channel& channel : channels) names += (names.empty() ? "" : ", ") + channel.name;
  return names.empty() ? "it has no channels" : "it has " + names;
}

/// The points of another source that pass a selection.
class SelectedPoints : public PointSource {
 public:
  SelectedPoints(std::unique_ptr<PointSource> source, std::span<const Channel> channels,
                 const Selection& selection, const std::filesystem::path& path)
      : source_(std::move(source)), selection_(selection) {
    const std::vector<Channel> kept = kept_channels(channels, selection, path);
    for (const Channel& channel : channels) {
      if (std::ranges::find(kept, channel.name, &Channel::name) != kept.end())
        copies_.push_back({row_bytes_, channel.bytes()});
      row_bytes_ += channel.bytes();
    }
    if (selection.classes.empty()) return;
    const auto found = find_in_row(channels, kClassChannel);
    if (!found || found->channel->components != 1 || !is_integer(found->channel->type)) {
      throw RequestError("classes", path.string() +
                                        ": there is no channel of whole numbers named " +
                                        kClassChannel + ": " + names_of(channels));
    }
    class_type_ = found->channel->type;
    class_offset_ = found->offset;
  }

  std::size_t next(std::span<Surfel> out) override {
    rows_.clear();
    while (const std::size_t count = source_->next(out)) {
      const std::byte* row = source_->attributes().data();
      std::size_t taken = 0;
      for (std::size_t i = 0; i < count; ++i, row += row_bytes_) {
        if (!takes(out[i], row)) continue;
        out[taken++] = out[i];
        for (const Copy& copy : copies_)
          rows_.insert(rows_.end(), row + copy.offset, row + copy.offset + copy.bytes);
      }
      if (taken > 0) return taken;
    }
    return 0;
  }

  [[nodiscard]] bool skip(std::uint64_t surfels) override {
    return selection_.takes_all() && source_->skip(surfels);
  }
  [[nodiscard]] std::span<const std::byte> attributes() const noexcept override { return rows_; }
  [[nodiscard]] std::uint64_t left_out() const noexcept override { return source_->left_out(); }
  [[nodiscard]] std::optional<Extent> extent() override {
    return selection_.takes_all() ? source_->extent() : std::nullopt;
  }

 private:
  /// A run of bytes of a row that is kept.
  struct Copy {
    std::size_t offset, bytes;
  };

  bool takes(const Surfel& surfel, const std::byte* row) {
    const glm::dvec3& p = surfel.position;
    if (const auto& box = selection_.box) {
      for (int axis = 0; axis < 3; ++axis) {
        if (!(p[axis] >= box->low[axis] && p[axis] <= box->high[axis])) return false;
      }
    }
    if (!selection_.classes.empty()) {
      const std::int64_t number = load_integer(class_type_, row + class_offset_);
      if (number < 0 || std::ranges::find(selection_.classes, static_cast<std::uint64_t>(number)) ==
                            selection_.classes.end())
        return false;
    }
    return passed_++ % selection_.every == 0;
  }

  std::unique_ptr<PointSource> source_;
  Selection selection_;
  std::size_t row_bytes_ = 0;
  ChannelType class_type_ = ChannelType::u8;
  std::size_t class_offset_ = 0;
  std::vector<Copy> copies_;
  std::vector<std::byte> rows_;  ///< of the points that next() returned last
  std::uint64_t passed_ = 0;     ///< points that all other conditions took
};

}  // namespace

std::vector<Channel> kept_channels(std::span<const Channel> channels, const Selection& selection,
                                   const std::filesystem::path& path) {
  if (!selection.channels) return {channels.begin(), channels.end()};
  for (const std::string& name : *selection.channels) {
    if (std::ranges::find(channels, name, &Channel::name) != channels.end()) continue;
    throw RequestError("channels", path.string() + ": there is no channel named " + name + ": " +
                                       names_of(channels));
  }
  std::vector<Channel> kept;
  for (const Channel& channel : channels) {
    if (std::ranges::find(*selection.channels, channel.name) != selection.channels->end())
      kept.push_back(channel);
  }
  return kept;
}

std::unique_ptr<PointSource> select_points(std::unique_ptr<PointSource> source,
                                           std::span<const Channel> channels,
                                           const Selection& selection,
                                           const std::filesystem::path& path) {
  return std::make_unique<SelectedPoints>(std::move(source), channels, selection, path);
}

}  // namespace ptc
