// The whole-file check: every byte and every rule of a container (spec/container.md#verify).
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "engine/base/progress.h"
#include "engine/verify/finding.h"
#include "engine/verify/survey.h"

namespace ptc {

/// How far a verification goes; each level does what those below do (spec/container.md#verify).
enum class VerifyLevel : std::uint8_t {
  commit = 0,     ///< file header, superblocks, length
  directory = 1,  ///< directory, page headers, what pages there are
  payload = 2,    ///< payload checksums, padding
  content = 3,    ///< what pages decode to, the tree against its points, counts and totals
  rebuild = 4,    ///< the tree built again from the points, compared bit by bit
};

struct VerifyOptions {
  VerifyLevel level = VerifyLevel::content;
  std::uint64_t memory_bytes = std::uint64_t{512} << 20;  ///< cap on what the check holds
  unsigned threads = 0;                                   ///< 0: as many as cores
  std::size_t keep_findings = 1000;                       ///< of more only the number is told
  bool fail_fast = false;                                 ///< stops at the first damage
  /// Bytes that may be hashed to find flipped bits, at about 20 GB a second and core.
  std::uint64_t flip_budget = std::uint64_t{1} << 38;
};

/// What a check went over and found. What was not counted, because the level does not look at it or
/// a fault stands before it, is empty.
struct VerifyReport {
  std::vector<Finding> findings;  ///< by level; of one level as they lie in the file
  std::uint64_t damage = 0;       ///< findings that make the file unsound, with those not kept
  std::uint64_t warnings = 0;
  std::uint64_t file_bytes = 0;
  std::optional<std::uint64_t> pages;          ///< whose headers at least were checked; level 1
  std::optional<std::uint64_t> damaged_pages;  ///< of these
  std::optional<std::uint64_t> points;         ///< of whole pages that were decoded; level 3
  std::optional<std::uint64_t> nodes;          ///< in groups that were reached; level 3
  std::optional<std::uint64_t> groups;
  std::optional<int> levels;
  bool tree_checked = false;  ///< and whole: false where damage hides part of it
  std::optional<std::array<std::uint64_t, 2>>
      tree_digest;              ///< of the stored tree (spec/nodes.md#tree-digest), level 4
  std::vector<PageSite> sites;  ///< ascending by offset
  std::optional<Superblock> superblock;

  [[nodiscard]] bool sound() const noexcept { return damage == 0; }
};

/// Checks a container and reports every fault that the level looks for. What lies behind a fault is
/// checked as far as it does not depend on what is damaged: pages one by one, and of the tree all
/// that sound pages hold.
///
/// Sums: what a child stores is what its points or its own children add up to, within the
/// quantisation (spec/nodes.md#quantisation), and its sphere and cone hold theirs.
/// @throws std::system_error; LimitError naming the least cap that works
/// Memory: 100 bytes a page of the file, a bit a group, three pages a thread, and pages of nodes up
/// to the cap.
[[nodiscard]] VerifyReport verify_container(const std::filesystem::path& path,
                                            const VerifyOptions& options, Progress& progress);

}  // namespace ptc
