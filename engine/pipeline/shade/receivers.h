// The points that are shaded, as whole runs and runs over a range of them read them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/base/surfel.h"
#include "engine/io/cloud/record.h"
#include "engine/pipeline/build/point_marks.h"
#include "engine/pipeline/quality/pilots.h"
#include "engine/pipeline/shade/shade_container.h"
#include "engine/shade/lift.h"
#include "engine/shade/lost_pages.h"
#include "engine/shade/shader.h"
#include "engine/store/attribute_rows.h"
#include "engine/store/point_scan.h"
#include "engine/store/reader.h"

namespace ptc {

/// Receivers that are read, shaded and written at once. The light of a receiver depends on those
/// that are shaded with it (Shader::shade()), so a range of a run's receivers begins at a multiple
/// of this.
inline constexpr std::size_t kReceiverBatch = 16 * Shader::kBlock;

/// Returns the number of points that a request selects. @param count  that it asks for; 0: all
[[nodiscard]] inline std::uint64_t selected_of(const ContainerReader& container,
                                               std::uint64_t count) {
  const std::uint64_t all = container.superblock().points;
  return count == 0 ? all : std::min(count, all);
}

/// An even selection of a container's points, in their order and in blocks.
///
/// Point i of `all` is selected when a multiple of all / wanted falls on it. share_ counts this in
/// integers, as Bresenham's algorithm does: it grows by `wanted` for each point, and a point at
/// which it reaches `all` is selected and takes `all` off.
class PointCursor {
 public:
  /// @param groups  of the channels whose values rows have
  /// @param wanted  number of points to select, at most as many as there are
  /// @param from    index among the selected points of the first that next() gives, below `wanted`
  /// @param lost    gets the damaged pages, whose points are skipped; null: damaged pages are
  ///                errors
  PointCursor(const ContainerReader& container, std::span<const std::uint8_t> groups,
              std::uint64_t wanted, std::uint64_t from = 0, LostPages* lost = nullptr)
      : container_(container),
        wanted_(wanted),
        scan_(container, noted_in(lost)),
        rows_(container, groups) {
    if (from == 0) return;
    // The products of two numbers of points take up to 128 bits; share_ is below `wanted`
    __extension__ typedef unsigned __int128 Wide;
    const Wide before = Wide{from} * all_points();
    const auto passed =
        static_cast<std::uint64_t>((before + wanted - 1) / wanted);  // they hold `from` selected
    share_ = static_cast<std::uint64_t>(Wide{passed} * wanted - before);
    const std::uint64_t left = scan_.skip_points(passed);
    if (scan_.next()) at_ = static_cast<std::uint32_t>(left);
  }

  /// The channels of a row.
  [[nodiscard]] std::span<const Channel> channels() const noexcept { return rows_.channels(); }

  /// Fills `out` from the front. @return the number of points, 0 at the end
  /// @param rows  gets the rows of their channels; may be null
  std::size_t next(std::span<Surfel> out, std::vector<std::byte>* rows = nullptr) {
    std::size_t filled = 0;
    if (rows) rows->clear();
    while (filled < out.size()) {
      if (at_ == scan_.count()) {
        pass_unwanted_pages();
        if (!scan_.next()) break;
        at_ = 0;
      }
      std::span<const std::byte> page_rows;
      if (rows && scan_.whole()) page_rows = rows_.read(scan_.index(), scan_.count());
      const PointPage points = scan_.points();
      for (; at_ < points.size() && filled < out.size(); ++at_) {
        share_ += wanted_;
        if (share_ < all_points()) continue;
        share_ -= all_points();
        if (!scan_.whole()) continue;
        out[filled++] = to_surfel(points[at_], container_.header().frame);
        if (!rows) continue;
        const auto row = page_rows.subspan(at_ * rows_.row_bytes(), rows_.row_bytes());
        rows->insert(rows->end(), row.begin(), row.end());
      }
    }
    return filled;
  }

 private:
  [[nodiscard]] std::uint64_t all_points() const noexcept { return container_.superblock().points; }

  /// Skips the pages before the next one with a selected point, without reading them.
  void pass_unwanted_pages() {
    while (const std::uint32_t count = scan_.next_count()) {
      const std::uint64_t share = share_ + wanted_ * count;
      if (share >= all_points()) return;
      share_ = share;
      scan_.skip(1);
    }
  }

  const ContainerReader& container_;
  std::uint64_t wanted_;
  std::uint64_t share_ = 0;  // wanted_ for each point passed, less all_points() for each selected
  PointScan scan_;
  std::uint32_t at_ = 0;  // next point of the page
  AttributeRows rows_;
};

/// Puts receivers above the points of a cursor: at the lift of the run, and clear of the noise of
/// scanned surfaces.
class Lifting {
 public:
  /// @param channels  of the rows of the points
  Lifting(const Frame& frame, std::span<const Channel> channels, float lift)
      : frame_(frame), lift_(lift), row_bytes_(row_bytes(channels)), rise_(channels) {}

  void place(std::span<const Surfel> surfels, std::span<const std::byte> rows,
             std::span<Receiver> receivers) const {
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      const float rise = rise_.radii(rows.data() + i * row_bytes_);
      receivers[i] = lifted(surfels[i], std::max(lift_, rise), frame_);
    }
  }

 private:
  Frame frame_;
  float lift_;
  std::size_t row_bytes_;
  RisePlace rise_;
};

/// Returns pilots that stand for receivers: some of the blocks that are shaded. (A batch is put
/// along the curve of the scene before it is cut, so the receivers of another container may be cut
/// a little elsewhere.)
/// @param wanted  number of receivers, an even selection of the container's points
[[nodiscard]] std::vector<Pilot> pilots_of(const ContainerReader& container, std::uint64_t wanted,
                                           float lift);

/// Returns the groups of a container's channels that a file of its shaded points takes over: all
/// but those of an earlier shading.
[[nodiscard]] std::vector<std::uint8_t> groups_without_shading(const ContainerReader& container);

/// Returns the text by which shaded points record their settings.
/// @param rays  of a receiver; 0: the gather shaded it
[[nodiscard]] std::string settings_text(const ShadeRequest& request, const GatherOptions& gather,
                                        unsigned rays);

}  // namespace ptc
