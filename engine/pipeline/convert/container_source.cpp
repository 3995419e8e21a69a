// The order of the input comes back through external sorts by original_index.
//
// A sort moves records of a key and kPieceBytes more. A point with its channels takes more than
// that, so it travels in several pieces, each in a sort of its own under the same keys; the sorts
// are read side by side:
//
//   point and row   | key radius normal .. | intensity class time .. |
//   pieces          | 24 bytes | 24 bytes | 24 bytes |   under the key {0, original_index}
#include "engine/pipeline/convert/container_source.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "engine/io/cloud/record.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/sort/point_streams.h"

namespace ptc {
namespace {

constexpr std::size_t kPieceBytes = sizeof(PointRecord) - sizeof(MortonKey);
constexpr std::size_t kPieceBlock = 1 << 13;  // points that are cut into pieces at once
constexpr std::uint64_t kMinPieceSortBytes = std::uint64_t{8} << 20;  // of each sort

std::byte* piece_of(PointRecord& record) noexcept {
  return reinterpret_cast<std::byte*>(&record) + sizeof(MortonKey);
}

/// Where original_index lies in a row.
struct IndexPlace {
  std::size_t offset = 0, bytes = 0;
};

IndexPlace index_place(const ContainerReader& container) {
  const auto found = find_in_row(container.meta().channels, kOriginalIndex);
  if (!found || found->channel->role != ChannelRole::index) return {};
  return {found->offset, found->channel->component_bytes()};
}

std::size_t pieces_of(const ContainerReader& container) {
  const std::size_t bytes = sizeof(PointRecord) + row_bytes(container.meta().channels);
  return (bytes + kPieceBytes - 1) / kPieceBytes;
}

/// Points of a container by ascending original_index.
class InputOrder : public PointSource {
 public:
  InputOrder(const ContainerReader& container, SortOptions options, const Executor& executor)
      : frame_(container.header().frame), index_(index_place(container)), rows_(container) {
    // Divide the memory and draw a sample: indices lie evenly
    const std::size_t pieces = pieces_of(container);
    const std::uint64_t points = container.superblock().points;
    options.memory_bytes /= pieces;
    options.expected = points;
    options.emits = true;  // every byte of a record counts
    std::vector<MortonKey> sample;
    const std::uint64_t step = points / (1 << 14) + 1;
    for (std::uint64_t i = 0; i < points; i += step) sample.push_back({0, i});
    for (std::size_t i = 0; i < pieces; ++i) {
      sorts_.push_back(std::make_unique<ExternalSorter>(options, executor, sample));
      blocks_.emplace_back(kPieceBlock);
    }
    // Sort all points
    PointScan scan(container);
    while (scan.next()) add(scan.points(), rows_.read(scan.index(), scan.count()));
    for (const auto& sort : sorts_) streams_.push_back(sort->finish());
  }

  std::size_t next(std::span<Surfel> out) override {
    // Read the pieces of the next points side by side
    std::size_t count = std::min(out.size(), kPieceBlock);
    for (std::size_t i = 0; i < streams_.size(); ++i)
      count = std::min(count, read_full(*streams_[i], std::span(blocks_[i]).first(count)));
    // Join them, and leave the index out of the rows
    const std::size_t row_bytes = rows_.row_bytes();
    given_.resize(count * (row_bytes - index_.bytes));
    std::byte* row = given_.data();
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t k = 0; k < blocks_.size(); ++k)
        std::memcpy(joined_.data() + k * kPieceBytes, piece_of(blocks_[k][i]), kPieceBytes);
      PointRecord record;
      std::memcpy(&record, joined_.data(), sizeof record);
      out[i] = to_surfel(record, frame_);
      const std::byte* const from = joined_.data() + sizeof record;
      row = std::copy_n(from, index_.offset, row);
      row = std::copy(from + index_.offset + index_.bytes, from + row_bytes, row);
    }
    return count;
  }

  [[nodiscard]] std::span<const std::byte> attributes() const noexcept override { return given_; }

 private:
  /// Cuts the points of a page into pieces and adds these to the sorts.
  void add(const PointPage& points, std::span<const std::byte> rows) {
    joined_.resize(sorts_.size() * kPieceBytes);
    for (std::uint32_t done = 0; done < points.size();) {
      const std::size_t count = std::min<std::size_t>(kPieceBlock, points.size() - done);
      for (std::size_t i = 0; i < count; ++i, ++done) {
        const PointRecord record = points[done];
        const std::byte* const row = rows.data() + done * rows_.row_bytes();
        std::memcpy(joined_.data(), &record, sizeof record);
        std::copy_n(row, rows_.row_bytes(), joined_.data() + sizeof record);
        std::uint64_t index = 0;
        std::memcpy(&index, row + index_.offset, index_.bytes);
        for (std::size_t k = 0; k < blocks_.size(); ++k) {
          blocks_[k][i].key = {0, index};
          std::memcpy(piece_of(blocks_[k][i]), joined_.data() + k * kPieceBytes, kPieceBytes);
        }
      }
      for (std::size_t k = 0; k < blocks_.size(); ++k)
        sorts_[k]->add(std::span<const PointRecord>(blocks_[k]).first(count));
    }
  }

  Frame frame_;
  IndexPlace index_;
  AttributeRows rows_;
  std::vector<std::unique_ptr<ExternalSorter>> sorts_;
  std::vector<std::vector<PointRecord>> blocks_;  ///< pieces of the same points
  std::vector<std::unique_ptr<PointStream>> streams_;
  std::vector<std::byte> joined_;  ///< a point and its row
  std::vector<std::byte> given_;   ///< rows of the points that next() returned last
};

}  // namespace

ContainerSource::ContainerSource(const ContainerReader& container, SourcePages pages)
    : container_(container),
      pages_(std::move(pages)),
      scan_(container),
      rows_(pages_.groups ? AttributeRows(container, *pages_.groups) : AttributeRows(container)) {}

bool ContainerSource::next_page() {
  if (pages_.ranks) {
    if (done_ == pages_.ranks->size()) return false;
    const std::size_t rank = (*pages_.ranks)[done_];
    scan_.skip(rank - (done_ == 0 ? 0 : (*pages_.ranks)[done_ - 1] + 1));
    ++done_;
  }
  if (!scan_.next()) return false;
  page_rows_ = rows_.read(scan_.index(), scan_.count());
  at_ = 0;
  return true;
}

bool ContainerSource::skip(std::uint64_t surfels) {
  if (pages_.ranks) return false;
  const std::uint64_t left = scan_.skip_points(surfels);
  if (left > 0 && next_page()) at_ = static_cast<std::uint32_t>(left);
  return true;
}

std::size_t ContainerSource::next(std::span<Surfel> out) {
  if (at_ == scan_.count() && !next_page()) return 0;
  const PointPage points = scan_.points();
  const std::size_t count = std::min<std::size_t>(out.size(), points.size() - at_);
  for (std::size_t i = 0; i < count; ++i)
    out[i] = to_surfel(points[at_ + static_cast<std::uint32_t>(i)], container_.header().frame);
  given_ = page_rows_.subspan(at_ * rows_.row_bytes(), count * rows_.row_bytes());
  at_ += static_cast<std::uint32_t>(count);
  return count;
}

std::vector<Channel> channels_without_index(const ContainerReader& container) {
  std::vector<Channel> channels = container.meta().channels;
  std::erase_if(channels, [](const Channel& c) { return c.name == kOriginalIndex; });
  return channels;
}

bool has_input_order(const ContainerReader& container) {
  return index_place(container).bytes > 0;
}

std::uint64_t input_order_bytes(const ContainerReader& container) {
  return pieces_of(container) * kMinPieceSortBytes;
}

std::unique_ptr<PointSource> open_in_input_order(const ContainerReader& container,
                                                 SortOptions options, const Executor& executor) {
  return std::make_unique<InputOrder>(container, std::move(options), executor);
}

}  // namespace ptc
