// What can still be known of a file, whole or damaged: its identity, its commit record, its pages.
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

/// A page, as the directory or its own header tells of it.
struct PageSite {
  DirectoryEntry entry;
  std::uint32_t page = 0;
  bool listed = false;  ///< by the directory; else found by its header
  bool sound = true;    ///< false once a fault was found in it

  [[nodiscard]] std::uint64_t end() const noexcept {
    return entry.offset + kPageHeaderBytes + entry.stored_bytes;
  }
};

/// Memory: 48 bytes a page for the sites, and those of ContainerReader.
struct Survey {
  std::optional<FileHeader> header;            ///< the file's own, or one that a superblock repeats
  std::optional<Superblock> superblock;        ///< a whole copy, wherever it lies
  std::unique_ptr<ContainerReader> container;  ///< when it opens as every reader opens it
  std::vector<PageSite> sites;                 ///< all but directory pages, ascending by offset
  GroupColumns columns;                        ///< of the meta page, when that is whole
  Meta meta;                                   ///< likewise
  std::optional<Finding> refusal;  ///< why `container` does not open, when all before it is whole
};

/// Looks at header, superblocks, length and directory, and adds what is wrong with them to
/// `findings`. Pages that no whole directory page lists are looked for sector by sector.
/// @param flips           for telling what damaged them
/// @param structure_only  looks for no pages that the directory does not list
/// @throws std::system_error
[[nodiscard]] Survey survey_file(const InputFile& file, Findings& findings, FlipBudget& flips,
                                 bool structure_only, Progress& progress);

/// All pages but those of the directory that begin on a sector with a header whose checksum holds,
/// ascending.
[[nodiscard]] std::vector<PageSite> find_pages(const InputFile& file, const FileHeader& header,
                                               Progress& progress);

}  // namespace ptc
