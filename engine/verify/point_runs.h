// Inside the whole-file check: the points of a container, run by run, and what is said of them and
// of the tree.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/store/reader.h"
#include "engine/verify/finding.h"
#include "format/point_record.h"

namespace ptc {

/// Adds what is wrong to the findings: checksums are right, so that it was written so.
class TreeReport {
 public:
  TreeReport(const ContainerReader& container, Findings& findings)
      : container_(container), findings_(findings) {}

  void superblock(const char* clause, const std::string& text) const;
  /// @param from_header  bytes to what is wrong
  void page(std::uint32_t page, std::uint64_t from_header, const char* clause,
            const std::string& text) const;

 private:
  const ContainerReader& container_;
  Findings& findings_;
};

/// Runs of points in their order, with the totals of all that were taken.   Memory: a page, and a
/// run.
class PointRuns {
 public:
  /// All must outlive this.
  /// @param damaged  by page
  PointRuns(const ContainerReader& container, const std::vector<bool>& damaged,
            const TreeReport& report)
      : container_(container),
        damaged_(damaged),
        report_(report),
        payload_(container.page_payload_limit()) {}

  /// Points from `first` on, which must not lie before any taken already; nothing when some are in
  /// damaged pages. Valid until the next call.
  [[nodiscard]] std::optional<std::span<const PointRecord>> take(std::uint64_t first,
                                                                 std::size_t count);

  /// Compares the totals with the superblock's.
  void finish() const;

 private:
  void add(std::uint64_t number, const PointRecord& point);
  void compare(const char* what, double said, double found) const;

  const ContainerReader& container_;
  const std::vector<bool>& damaged_;
  const TreeReport& report_;
  PageDecoder decoder_;
  std::vector<std::byte> payload_;
  std::uint32_t page_ = kNoPage;  ///< in payload_
  std::uint32_t count_ = 0;       ///< its points
  std::vector<PointRecord> block_;
  MortonKey last_{};
  std::uint64_t next_ = 0;  ///< behind the last taken
  double area_ = 0;
  std::array<double, 3> flux_{};
  std::array<double, 3> low_{};
  std::array<double, 3> high_{};
};

}  // namespace ptc
