// The points of a container for the whole-file check: one leaf's run after another, with running
// totals, and the reports of what is wrong with points and tree.
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

/// Adds faults of points and tree to the findings, with Cause::writer: the checksums of their pages
/// are right, so the file was written with these faults.
class TreeReport {
 public:
  /// @param container, findings  must outlive this
  TreeReport(const ContainerReader& container, Findings& findings)
      : container_(container), findings_(findings) {}

  /// Reports that the superblock breaks a rule.
  void superblock(const char* clause, const std::string& text) const;
  /// Reports that a page breaks a rule.
  /// @param from_header  bytes from the start of the page header to the fault
  void page(std::uint32_t page, std::uint64_t from_header, const char* clause,
            const std::string& text) const;

 private:
  const ContainerReader& container_;
  Findings& findings_;
};

/// Reads points in the order of the file, checks that their keys ascend, and sums up what the
/// superblock states about them.   Memory: one page and one run.
class PointRuns {
 public:
  /// @param container, damaged, report  must outlive this
  /// @param damaged                     by page number, whether the page is damaged
  PointRuns(const ContainerReader& container, const std::vector<bool>& damaged,
            const TreeReport& report)
      : container_(container),
        damaged_(damaged),
        report_(report),
        payload_(container.page_payload_limit()) {}

  /// Returns `count` points from number `first` on; empty when one of them is in a damaged page.
  /// The points are valid until the next call.
  /// @param first  not less than the end of any run taken before
  [[nodiscard]] std::optional<std::span<const PointRecord>> take(std::uint64_t first,
                                                                 std::size_t count);

  /// Compares the totals of all points taken with those of the superblock, and reports what
  /// differs.
  void finish() const;

 private:
  void add(std::uint64_t number, const PointRecord& point);
  void compare(const char* what, double said, double found) const;

  const ContainerReader& container_;
  const std::vector<bool>& damaged_;
  const TreeReport& report_;
  PageDecoder decoder_;
  std::vector<std::byte> payload_;
  std::uint32_t page_ = kNoPage;  ///< the page decoded in payload_
  std::uint32_t count_ = 0;       ///< points in payload_
  std::vector<PointRecord> block_;
  MortonKey last_{};         ///< key of the last point taken
  std::uint64_t taken_ = 0;  ///< points taken
  double area_ = 0;          ///< sum over the points taken, scene units squared
  std::array<double, 3> flux_{};
  std::array<double, 3> low_{};
  std::array<double, 3> high_{};
};

}  // namespace ptc
