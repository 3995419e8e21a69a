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

/// How far a verification goes. Each level includes all lower ones (spec/container.md#verify).
enum class VerifyLevel : std::uint8_t {
  commit = 0,     ///< file header, superblocks, length
  directory = 1,  ///< directory, page headers, which pages exist
  payload = 2,    ///< payload checksums, padding
  content = 3,    ///< decoded pages, the tree against its points, counts and totals
  rebuild = 4,    ///< the tree built again from the points, compared bit by bit
};

/// How a verification runs.
struct VerifyOptions {
  VerifyLevel level = VerifyLevel::content;
  std::uint64_t memory_bytes = std::uint64_t{512} << 20;  ///< cap on the memory of the check
  unsigned threads = 0;                                   ///< 0: one for each core
  std::size_t keep_findings = 1000;  ///< findings beyond these are only counted
  bool fail_fast = false;            ///< stop at the first damage
  /// Bytes that may be hashed to find flipped bits, at about 20 GB a second and core.
  std::uint64_t flip_budget = std::uint64_t{1} << 38;
};

/// What a verification examined and found. A count is empty when the level does not include it or
/// when a fault prevented it.
struct VerifyReport {
  std::vector<Finding> findings;  ///< ascending by level, within a level by place in the file
  std::uint64_t damage = 0;       ///< findings that make the file unsound, including those not kept
  std::uint64_t warnings = 0;     ///< findings that do not, including those not kept
  std::uint64_t file_bytes = 0;
  std::optional<std::uint64_t> pages;          ///< pages that were checked, from level 1 on
  std::optional<std::uint64_t> damaged_pages;  ///< pages with a fault, among `pages`
  std::optional<std::uint64_t> points;         ///< points in intact pages, from level 3 on
  std::optional<std::uint64_t> nodes;          ///< nodes in groups that were reached, from level 3
  std::optional<std::uint64_t> groups;         ///< groups that were reached, from level 3 on
  std::optional<int> levels;                   ///< levels of the tree reached, from level 3 on
  bool tree_checked = false;  ///< the whole tree was checked; false where damage hides part of it
  std::optional<std::array<std::uint64_t, 2>>
      tree_digest;              ///< of the stored tree (spec/nodes.md#tree-digest), level 4
  std::vector<PageSite> sites;  ///< all pages found, ascending by offset
  std::optional<Superblock> superblock;

  /// Returns whether the file has no damage.
  [[nodiscard]] bool sound() const noexcept { return damage == 0; }
};

/// Checks a container and reports every fault that the level includes. A fault does not end the
/// check: everything that does not depend on damaged bytes is still checked, pages one by one, and
/// of the tree all that intact pages hold.
///
/// The summary that a node stores is compared with the sum over its points or its own children,
/// within the quantisation (spec/nodes.md#quantisation); its sphere and cone must enclose theirs.
/// @throws std::system_error; LimitError naming the smallest cap that works
/// What is found does not depend on the number of threads and on the cap.
/// Memory: 110 bytes for each page of the file, one bit for each group, three pages for each
/// thread, and what the walks through the tree take up to the cap: 64 node pages each, some more
/// pages, and the points of a leaf.
[[nodiscard]] VerifyReport verify_container(const std::filesystem::path& path,
                                            const VerifyOptions& options, Progress& progress);

}  // namespace ptc
