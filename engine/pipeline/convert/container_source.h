// The points of a container as surfels with the rows of their channels, in the order of the curve
// or in that of the input.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/stream.h"
#include "engine/sort/external_sort.h"
#include "engine/store/attribute_rows.h"
#include "engine/store/point_scan.h"
#include "engine/store/reader.h"

namespace ptc {

/// The pages that a ContainerSource reads.
struct SourcePages {
  /// Ranks of point pages, ascending; empty optional: all of them.
  std::optional<std::vector<std::size_t>> ranks;
  /// Groups of channels whose attribute pages are read; empty optional: all of them.
  std::optional<std::vector<std::uint8_t>> groups;
};

/// Yields points of a container in the order of the curve, with the rows of their channels.
/// Memory: the records and rows of a page.
class ContainerSource : public PointSource {
 public:
  /// @param container  must outlive this
  explicit ContainerSource(const ContainerReader& container, SourcePages pages = {});
  std::size_t next(std::span<Surfel> out) override;
  /// Passes over points of a source that reads all pages.
  [[nodiscard]] bool skip(std::uint64_t surfels) override;
  [[nodiscard]] std::span<const std::byte> attributes() const noexcept override { return given_; }
  /// The channels of a row.
  [[nodiscard]] const std::vector<Channel>& channels() const noexcept { return rows_.channels(); }

 private:
  bool next_page();

  const ContainerReader& container_;
  SourcePages pages_;
  std::size_t done_ = 0;  ///< ranks of pages_ that were read
  PointScan scan_;
  AttributeRows rows_;
  std::span<const std::byte> page_rows_;  ///< of the page that was read last
  std::span<const std::byte> given_;      ///< of the points that next() returned last
  std::uint32_t at_ = 0;                  ///< the next point of the page
};

/// Returns the channels of a container without original_index.
[[nodiscard]] std::vector<Channel> channels_without_index(const ContainerReader& container);
/// Says whether the points of a container can be put into the order of their input: the container
/// has the channel original_index.
[[nodiscard]] bool has_input_order(const ContainerReader& container);
/// Returns the least memory for open_in_input_order(), bytes.
[[nodiscard]] std::uint64_t input_order_bytes(const ContainerReader& container);

/// Opens the points of a container in the order of their input. Rows have
/// the channels that channels_without_index() returns. It reads the container once before it
/// returns.
/// @param container  has_input_order(); must outlive the result
/// @param options    memory and directories of the sort
/// @param executor   must outlive the result
/// @throws FormatError when the container is damaged; std::system_error
[[nodiscard]] std::unique_ptr<PointSource> open_in_input_order(const ContainerReader& container,
                                                               SortOptions options,
                                                               const Executor& executor);

}  // namespace ptc
