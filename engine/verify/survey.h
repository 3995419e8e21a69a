// The survey of a file that may be damaged: its identity, its commit record, and its pages, as far
// as they can still be known (spec/recovery.md#survey).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/file/file.h"
#include "engine/store/page_content.h"
#include "engine/store/reader.h"
#include "engine/verify/diagnose.h"
#include "engine/verify/finding.h"
#include "format/container.h"

namespace ptc {

/// Memory that a verification or a salvage takes whatever the file is: the program, its libraries,
/// small buffers.
inline constexpr std::uint64_t kProgramBytes = std::uint64_t{32} << 20;

/// A page of the file and where it lies, according to the directory or to its own header.
struct PageSite {
  DirectoryEntry entry;
  std::uint32_t rank = 0;        ///< among the pages of its type and group
  std::uint32_t page = kNoPage;  ///< page number; kNoPage when it is not known
  bool listed = false;  ///< the directory lists the page; otherwise its header was found by scan
  bool sound = true;    ///< false once a fault was found in the page

  /// Returns what identifies the page in its file: type, group and rank.
  [[nodiscard]] std::uint64_t identity() const noexcept {
    return static_cast<std::uint64_t>(entry.type) << 40 | std::uint64_t{entry.group} << 32 | rank;
  }
  /// Returns the file offset after the last byte of the stored payload.
  [[nodiscard]] std::uint64_t end() const noexcept {
    return entry.offset + kPageHeaderBytes + entry.stored_bytes;
  }
};

/// Everything that a survey could establish about a file.
/// Memory: 112 bytes for each page, and what ContainerReader takes.
struct Survey {
  std::optional<FileHeader> header;      ///< from the file's start, or repeated by a superblock
  std::optional<Superblock> superblock;  ///< an intact copy, wherever it lies
  std::unique_ptr<ContainerReader> container;  ///< null unless the file opens like any sound file
  std::vector<PageSite> sites;       ///< all but directory and void pages, ascending by offset
  std::vector<PageSite> void_pages;  ///< pages without bytes that the directory lists
  GroupColumns columns;              ///< columns of the channel groups, from `meta`
  Meta meta;                         ///< content of the meta page; empty when it is lost
  std::optional<Finding> refusal;    ///< why `container` is null although all before it is intact
};

/// Examines header, superblocks, length and directory, and adds their faults to `findings`. Pages
/// that no intact directory page lists are searched for sector by sector.
/// @param flips           pays for the search for flipped bits
/// @param structure_only  leaves out the search for pages that the directory does not list
/// @throws std::system_error
[[nodiscard]] Survey survey_file(const InputFile& file, Findings& findings, FlipBudget& flips,
                                 bool structure_only, Progress& progress);

/// Searches the file for pages of any type but directory pages: sectors that begin with a page
/// header whose checksum holds for this file.
/// @return  the pages, ascending by offset, with `listed` false
[[nodiscard]] std::vector<PageSite> find_pages(const InputFile& file, const FileHeader& header,
                                               Progress& progress);

}  // namespace ptc
