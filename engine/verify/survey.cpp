// Surveys a file from both ends, past whatever is broken on the way (spec/recovery.md#survey).
// Every structure can be found in two ways, so that the loss of one costs little:
//
//   | header | page | page | ... | directory pages | coarse pages, meta | superblock A | B |
//       ^______repeated by both superblocks________________________________/           /
//                                  directory offset and page counts <-----------------/
//              ^      ^            page headers, found sector by sector, repeat the directory
//
// The survey tries the way of every reader first. Where that fails, it collects what is left: the
// header from a superblock, a superblock from before the end, the directory page by page, and pages
// that are listed nowhere from the sectors that begin with a page header.
#include "engine/verify/survey.h"

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "engine/store/commit.h"
#include "engine/store/structure.h"
#include "engine/verify/surveyed_page.h"
#include "format/bytes.h"

namespace ptc {
namespace {

constexpr std::size_t kScanBytes = std::size_t{1} << 20;  // read at once by a scan, whole sectors

/// Calls body(header, offset) for every sector that begins with a valid page header of this file.
template <class Body>
void for_each_page(const InputFile& file, const FileHeader& header, Progress& progress,
                   const Body& body) {
  progress.begin("look for pages", file.size(), "bytes");
  std::vector<std::byte> chunk(kScanBytes);
  for (std::uint64_t at = 0; at < file.size(); at += kScanBytes) {
    const auto part = std::span(chunk).first(std::min<std::uint64_t>(kScanBytes, file.size() - at));
    file.read_at(at, part);
    for (std::size_t sector = 0; sector + kPageHeaderBytes <= part.size(); sector += kSectorBytes) {
      if (load<std::uint32_t>(part.data(), sector) != kPageMagic) continue;
      try {
        body(decode_page_header(part.subspan(sector), header), at + sector);
      } catch (const FormatError&) {  // the header is damaged, or belongs to another file
      }
    }
    progress.advance(part.size());
  }
  progress.end();
}

/// One survey, which fills in a Survey step by step.
class Surveyor {
 public:
  Surveyor(const InputFile& file, Findings& findings, FlipBudget& flips, Progress& progress)
      : file_(file), findings_(findings), flips_(flips), progress_(progress) {}

  Survey run(bool structure_only) {
    // Establish the identity of the file, without which no page proves itself.
    look_at_header();
    if (!survey_.header) return std::move(survey_);
    // Find a superblock; then open the file, or collect what is left of it.
    look_at_superblocks();
    if (!open()) {
      if (survey_.superblock) look_at_directory();
      if (!structure_only && !listed_all_) scan();
      if (no_superblock_) report_end();
      std::ranges::sort(survey_.sites, {}, [](const PageSite& site) { return site.entry.offset; });
      read_meta();
    }
    return std::move(survey_);
  }

 private:
  /// Reads a block, with zeros beyond the end of the file.
  Block read_block(std::uint64_t offset) const {
    Block block{};
    file_.read_at(offset, std::span(block).first(
                              std::min<std::uint64_t>(kBlockBytes, file_.size() - offset)));
    return block;
  }

  /// Adds an error and its diagnosis to the findings.
  /// @param looked_at  file offset of the bytes that were diagnosed
  void add(const FormatError& error, int level, const Diagnosis& diagnosis,
           std::uint64_t looked_at) {
    Finding finding = finding_of(error, level);
    apply(diagnosis, looked_at, finding);
    findings_.add(std::move(finding));
  }

  /// Reads the file header, or takes the copy in a superblock when it is damaged.
  void look_at_header() {
    Block block = read_block(0);
    const auto bytes = std::span(block).first(std::min<std::uint64_t>(file_.size(), kBlockBytes));
    try {
      survey_.header = decode_file_header(bytes);
      return;
    } catch (const FormatError& error) {
      const Diagnosis diagnosis = diagnose_header(error, bytes);
      add(error, 0, diagnosis, 0);
      if (diagnosis.cause == Cause::newer) return;
    }
    survey_.header = repeated_header();
  }

  Diagnosis diagnose_header(const FormatError& error, std::span<std::byte> bytes) {
    const std::string code = code_of(finding_of(error, 0));
    if (code == "header-version" || code == "header-draft" || code == "header-features")
      return {Cause::newer};
    if (code == "header-length") return {Cause::truncated};
    Diagnosis diagnosis = diagnose_sealed(
        bytes, [&] { static_cast<void>(decode_file_header(bytes)); }, flips_);
    if (diagnosis.cause != Cause::unknown || code == "header-checksum") return diagnosis;
    if (code == "header-magic")
      return diagnose_magic(bytes.first(std::min<std::size_t>(16, bytes.size())));
    return {Cause::writer};
  }

  /// Searches backwards from the end for an intact superblock, and returns its copy of the header.
  /// A superblock is only valid for a file of its length, so both lengths are tried: that of the
  /// first and that of the second copy.
  std::optional<FileHeader> repeated_header() const {
    const std::uint64_t blocks = file_.size() / kBlockBytes;
    for (std::uint64_t back = 1; back <= std::min(kSuperblockSearch, blocks); ++back) {
      const std::uint64_t offset = (blocks - back) * kBlockBytes;
      const Block block = read_block(offset);
      for (const std::uint64_t length : {offset + kBlockBytes, offset + 2 * kBlockBytes}) {
        try {
          const FileHeader header = decode_repeated_header(block);
          static_cast<void>(decode_superblock(block, header, length));
          return header;
        } catch (const FormatError&) {  // no superblock of this length: try the next
        }
      }
    }
    return std::nullopt;
  }

  /// Checks both superblocks in their places; where none is intact there, searches for one before
  /// the end.
  void look_at_superblocks() {
    // Check both copies.
    const std::uint64_t size = file_.size();
    const bool room = size % kBlockBytes == 0 && size >= 3 * kBlockBytes;
    std::vector<Finding> faults;
    std::array<Block, 2> blocks{};
    for (std::size_t i = 0; room && i < 2; ++i) {
      const std::uint64_t offset = size - (2 - i) * kBlockBytes;
      blocks[i] = read_block(offset);
      if (auto fault = look_at_copy(blocks[i], offset)) faults.push_back(std::move(*fault));
    }
    if (survey_.superblock && faults.empty() && blocks[0] != blocks[1]) {
      const FormatError error(size - 2 * kBlockBytes, "spec/container.md#superblock-copies",
                              "the two superblocks differ");
      add(error, 0, {Cause::writer}, 0);
    }
    if (!survey_.superblock) {
      // Look for a superblock before the end: the file is longer or shorter than it was.
      if (const auto length = committed_length(file_, *survey_.header))
        return report_length(*length);
      // Report damaged superblocks, but leave blocks that show no trace of one to report_end().
      std::erase_if(faults, [](const Finding& f) {
        return code_of(f) == "superblock-magic" && f.cause == Cause::unknown;
      });
      no_superblock_ = faults.empty();
    }
    for (Finding& fault : faults) findings_.add(std::move(fault));
  }

  /// Decodes one superblock, and keeps the first that is intact.
  /// @return  what is wrong with it; empty when it is intact
  std::optional<Finding> look_at_copy(Block block, std::uint64_t offset) {
    const auto decode = [&] { return decode_superblock(block, *survey_.header, file_.size()); };
    try {
      const Superblock found = decode();
      if (!survey_.superblock) survey_.superblock = found;
      return std::nullopt;
    } catch (const FormatError& error) {
      Finding finding = finding_of(error.rebased(offset, ""), 0);
      const std::string code = code_of(finding);
      Diagnosis diagnosis = diagnose_sealed(
          block, [&] { static_cast<void>(decode()); }, flips_);
      if (diagnosis.cause == Cause::unknown && code != "superblock-magic" &&
          code != "superblock-checksum") {
        diagnosis.cause = Cause::writer;
      }
      apply(diagnosis, offset, finding);
      return finding;
    }
  }

  /// Reports that the file is longer or shorter than when it was published, and takes the
  /// superblock that says so.
  /// @param committed  length of the file when it was published, bytes
  void report_length(std::uint64_t committed) {
    const std::uint64_t size = file_.size();
    const bool longer = size > committed;
    const std::uint64_t by = longer ? size - committed : committed - size;
    findings_.add({.cause = longer ? Cause::appended : Cause::truncated,
                   .offset = std::min(size, committed),
                   .bytes = longer ? by : 0,
                   .rule = "spec/container.md#superblock-length",
                   .text = fmt::format("the file is {} bytes {} than its superblock says", by,
                                       longer ? "longer" : "shorter"),
                   .expected = std::to_string(committed),
                   .actual = std::to_string(size)});
    for (const std::uint64_t back : {2 * kBlockBytes, kBlockBytes}) {
      const std::uint64_t offset = committed - back;
      if (survey_.superblock || offset + kBlockBytes > size) continue;
      try {
        survey_.superblock = decode_superblock(read_block(offset), *survey_.header, committed);
      } catch (const FormatError&) {  // the other copy is whole
      }
    }
  }

  /// Opens the container as every reader does, and takes over its pages.
  /// @return  false when there is no superblock for a file of this length, or when the reader
  ///          refuses the file, which Survey::refusal then explains
  bool open() {
    if (!survey_.superblock || survey_.superblock->file_bytes != file_.size()) return false;
    try {
      survey_.container =
          std::make_unique<ContainerReader>(file_.path(), ContainerReader::OpenParts::no);
    } catch (const FormatError& error) {
      survey_.refusal = finding_of(error, 1);
      survey_.refusal->cause = Cause::writer;
      return false;
    }
    const ContainerReader& container = *survey_.container;
    survey_.sites.reserve(container.page_count());
    for (std::uint32_t page = 0; page < container.page_count(); ++page)
      list({container.entry(page), container.rank(page), page, true});
    std::ranges::sort(survey_.sites, {}, [](const PageSite& site) { return site.entry.offset; });
    survey_.meta = container.meta();
    survey_.columns = columns_by_group(survey_.meta);
    return true;
  }

  /// Adds a page that the directory lists.
  void list(const PageSite& site) {
    (site.entry.is_void() ? survey_.void_pages : survey_.sites).push_back(site);
  }

  /// Reads what is left of the directory, page by page, and reports its damaged pages.
  void look_at_directory() {
    const Superblock& s = *survey_.superblock;
    std::vector<std::byte> entries;
    bool lost = false;
    listed_all_ = false;
    for (std::uint32_t i = 0; i < s.directory_pages; ++i) {
      const std::uint64_t offset = directory_page_offset(s, i);
      const std::size_t bytes = directory_page_entry_bytes(s, i);
      if (offset + kPageHeaderBytes + bytes > file_.size())
        break;  // the file is too short, which was reported before
      listed_all_ = i + 1 == s.directory_pages;
      entries.resize(bytes);
      try {
        read_directory_page(file_, s, i, entries);
        list_entries(i, entries);
      } catch (const FormatError& error) {
        add(error, 1, diagnose_directory_page(offset, bytes), offset);
        lost = true;
      }
    }
    listed_all_ &= !lost && !bad_entries_ && PageNumbers(s, {}).others().count == 0;
  }

  Diagnosis diagnose_directory_page(std::uint64_t offset, std::size_t bytes) {
    std::vector<std::byte> image(kPageHeaderBytes + bytes);
    file_.read_at(offset, image);
    const auto header = std::span(image).first(kPageHeaderBytes);
    const auto decode = [&] { return decode_page_header(header, *survey_.header); };
    try {
      const std::uint64_t expected = decode().payload_xxh3;
      Diagnosis found = diagnose_payload(std::span(image).subspan(kPageHeaderBytes), expected, true,
                                         offset + kPageHeaderBytes, flips_);
      found.offset += kPageHeaderBytes;
      return found;
    } catch (const FormatError&) {
      return diagnose_sealed(
          header, [&] { static_cast<void>(decode()); }, flips_);
    }
  }

  /// Lists the pages of one directory page, but for those between node pages and meta page: their
  /// ranks follow from the directory as a whole, and scan() finds them.
  void list_entries(std::uint32_t directory_page, std::span<const std::byte> bytes) {
    const Superblock& s = *survey_.superblock;
    const PageNumbers numbers(s, {});
    const std::uint32_t first = directory_page * directory_entries_per_page(s.header);
    for (std::uint32_t i = 0; i * kDirectoryEntryBytes < bytes.size(); ++i) {
      const std::uint32_t page = first + i;
      if (numbers.others().contains(page)) continue;
      try {
        const DirectoryEntry entry =
            decode_directory_entry(bytes.subspan(i * kDirectoryEntryBytes), s.header, s.file_bytes);
        list({entry, rank_of(numbers, {}, page), page, true});
      } catch (const FormatError&) {  // Survey::refusal reports the entry
        bad_entries_ = true;
      }
    }
  }

  /// Adds the pages that the directory does not list, found by their headers.
  void scan() {
    std::set<std::uint64_t> listed;
    for (const PageSite& site : survey_.sites) listed.insert(site.identity());
    for_each_page(file_, *survey_.header, progress_,
                  [&](const PageHeader& header, std::uint64_t offset) {
                    const PageSite site{entry_of(header, offset), header.rank};
                    pages_end_ = offset + kPageHeaderBytes + header.stored_bytes;
                    has_directory_ |= header.type == PageType::directory;
                    has_meta_ |= header.type == PageType::meta;
                    if (header.type != PageType::directory && !listed.contains(site.identity())) {
                      survey_.sites.push_back(site);
                    }
                  });
  }

  /// Reports that no superblock was found, and tells an unfinished file from a truncated or zeroed
  /// one by whether it has a directory.
  void report_end() {
    Finding finding{.cause = Cause::unfinished,
                    .offset = file_.size(),
                    .rule = "spec/container.md#superblock-magic",
                    .text = "no superblock at the end: the file is unfinished or truncated"};
    if (has_directory_) {
      // The meta page is the last one before the superblocks.
      const std::uint64_t length = round_up(pages_end_, kBlockBytes) + 2 * kBlockBytes;
      const Block last = read_block((file_.size() - 1) / kBlockBytes * kBlockBytes);
      finding.cause = file_.size() < length ? Cause::truncated
                      : last == Block{}     ? Cause::zeroed
                      : !has_meta_          ? Cause::truncated
                                            : Cause::unknown;
      finding.text = "no superblock at the end, although the file has a directory";
      finding.expected = fmt::format("at least {}", length);
      finding.actual = std::to_string(file_.size());
    }
    findings_.add(std::move(finding));
  }

  /// Reads the meta page of a file that does not open.
  void read_meta() {
    for (const PageSite& site : survey_.sites) {
      if (site.entry.type != PageType::meta) continue;
      SurveyedPage page(file_, survey_);
      if (page.check(site, 3, flips_)) continue;
      try {
        survey_.meta = decode_meta(page.payload(), survey_.header->point_bytes);
        survey_.columns = columns_by_group(survey_.meta);
      } catch (const FormatError&) {  // the check of pages reports it
      }
    }
  }

  const InputFile& file_;
  Findings& findings_;
  FlipBudget& flips_;
  Progress& progress_;
  Survey survey_;
  bool listed_all_ = false;      ///< every entry of the directory was read
  bool bad_entries_ = false;     ///< an entry breaks a rule
  bool no_superblock_ = false;   ///< there is no trace of a superblock
  bool has_directory_ = false;   ///< a scan met a directory page
  bool has_meta_ = false;        ///< a scan met a meta page
  std::uint64_t pages_end_ = 0;  ///< end offset of the last page that a scan met
};

}  // namespace

Survey survey_file(const InputFile& file, Findings& findings, FlipBudget& flips,
                   bool structure_only, Progress& progress) {
  return Surveyor(file, findings, flips, progress).run(structure_only);
}

std::vector<PageSite> find_pages(const InputFile& file, const FileHeader& header,
                                 Progress& progress) {
  std::vector<PageSite> sites;
  for_each_page(file, header, progress, [&](const PageHeader& page, std::uint64_t offset) {
    if (page.type != PageType::directory) sites.push_back({entry_of(page, offset), page.rank});
  });
  return sites;
}

}  // namespace ptc
