// The points of a container for the whole-file check: one leaf's run after another, with running
// totals, and the reports of what is wrong with points and tree.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/octree/point_columns.h"
#include "engine/store/reader.h"
#include "engine/verify/checked_pages.h"
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

/// What the superblock states about points, added up over some of them.
struct PointTotals {
  std::uint64_t taken = 0;  ///< points
  double area = 0;          ///< scene units squared
  std::array<double, 3> flux{};
  std::array<double, 3> low{kNoBound, kNoBound, kNoBound};  ///< bounds, lattice units
  std::array<double, 3> high{-kNoBound, -kNoBound, -kNoBound};
  MortonKey first;  ///< key of the first point taken
  MortonKey last;   ///< key of the last point taken; of no points: the least key

  static constexpr double kNoBound = std::numeric_limits<double>::infinity();
};

/// A run of points: some rows of columns.
struct PointRun {
  const PointColumns& columns;
  std::size_t begin = 0;  ///< row of the first point
  std::size_t end = 0;    ///< row behind the last point
  /// Keys of the first and the last point that the run has in each page. Between them keys ascend.
  std::span<const std::array<MortonKey, 2>> pieces;
};

/// Reads points in the order of the file, checks that their keys ascend, and sums up what the
/// superblock states about them.
/// Memory: bytes(); at most three pages, three times as much for columns, and one leaf.
class PointRuns {
 public:
  /// @param container, damaged, checked, report  must outlive this
  /// @param damaged  by page number, whether the page is damaged
  PointRuns(const ContainerReader& container, const std::vector<bool>& damaged,
            CheckedPages& checked, const TreeReport& report);

  /// Returns the greatest number of bytes that an object takes for one container.
  [[nodiscard]] static std::uint64_t bytes(const Superblock& superblock) noexcept;

  /// Returns `count` points from number `first` on; empty when one of them is in a damaged page.
  /// The points are valid until the next call.
  /// @param first  not less than the end of any run taken since the last call of finish()
  [[nodiscard]] std::optional<PointRun> take(std::uint64_t first, std::size_t count);

  /// Returns the totals of the points taken since the last call, and begins new ones.
  [[nodiscard]] PointTotals finish();
  /// Adds the totals of the points that follow, which were taken elsewhere.
  /// @return  false when their keys do not follow, and nothing was added
  [[nodiscard]] bool append(const PointTotals& totals);

  /// Compares the totals of all points taken with those of the superblock, and reports what
  /// differs.
  void compare();

 private:
  void take_piece(std::uint64_t first, std::size_t begin, std::size_t end);
  void load(std::uint32_t page);
  void add_up();
  void add(const PointTotals& sum);
  [[nodiscard]] std::array<double, 3> position_of(const std::array<double, 3>& lattice) const;
  void compare(const char* what, double said, double found) const;

  const ContainerReader& container_;
  const std::vector<bool>& damaged_;
  CheckedPages& checked_;
  const TreeReport& report_;
  std::uint64_t per_page_;
  double unit_;  ///< lattice unit in scene units
  PageDecoder decoder_;
  std::vector<std::byte> payload_;
  std::uint32_t page_ = kNoPage;  ///< the page decoded in payload_ and columns_
  std::uint32_t count_ = 0;       ///< points in it
  PointColumns columns_;
  std::size_t begin_ = 0;  ///< its points from here up to end_ were taken and not added up yet
  std::size_t end_ = 0;
  std::vector<std::array<MortonKey, 2>> pieces_;
  std::vector<PointRecord> gathered_;  ///< a run of several pages
  PointColumns gathered_columns_;
  PointTotals totals_;
};

}  // namespace ptc
