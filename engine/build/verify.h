// The whole-file check: every byte and every rule of a container (spec/container.md#verify).
#pragma once

#include <cstdint>
#include <filesystem>

#include "engine/base/progress.h"

namespace ptc {

struct VerifyOptions {
  std::uint64_t memory_bytes = std::uint64_t{512} << 20;  ///< cap on what the check holds
  unsigned threads = 0;                                   ///< 0: as many as cores
};

/// What a check went over.
struct VerifyReport {
  std::uint64_t file_bytes = 0;
  std::uint64_t pages = 0;  ///< those in the directory
  std::uint64_t points = 0;
  std::uint64_t nodes = 0;
  std::uint64_t groups = 0;
  int levels = 0;
};

/// Checks a container whole and throws for the first rule that is broken.
///
/// Pages: header and both superblocks, the directory against every page header, payload checksums,
/// decoding, and zeros wherever no page lies. Points: keys ascend from page to page; count, bounds,
/// area and flux are the superblock's. Nodes, depth first from the root: levels ascend, cells nest,
/// leaves take the points in their order and each point once, every group is reached once. Sums:
/// what a child stores is what its points or its own children add up to, within the quantisation
/// (spec/nodes.md#quantisation), and its sphere and cone hold theirs.
/// @throws FormatError with path, offset in the file and clause; std::system_error;
///         std::invalid_argument naming the least cap that works
/// Memory: 36 bytes a page of the file, a bit a group, a page a thread, and pages of nodes up to
/// the cap.
VerifyReport verify_container(const std::filesystem::path& path, const VerifyOptions& options,
                              Progress& progress);

}  // namespace ptc
