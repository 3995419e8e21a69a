// Runs the levels of a verification one after another. Each level examines more of the file and
// leans on what the levels before found sound:
//
//   0 commit     header ............................... superblock A | superblock B
//   1 directory         header of each page | directory
//   2 payload           every byte of each page, and the padding between pages
//   3 content           decoded pages | tree against points | totals
//   4 rebuild           tree built again from the points, compared bit by bit
//
// Levels 0 to 2 work on any file whose identity is known; 3 and 4 need a file that opens, because
// the tree refers to pages by their numbers. Pages with a fault are excluded from the tree's check.
#include "engine/verify/verify.h"

#include <algorithm>
#include <array>
#include <bit>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/parallel/thread_pool.h"
#include "engine/verify/rebuild.h"
#include "engine/verify/surveyed_page.h"
#include "engine/verify/verify_tree.h"

namespace ptc {
namespace {

constexpr char kPadding[] = "spec/container.md#padding";

constexpr std::uint64_t kBaseBytes = std::uint64_t{32} << 20;  // program, libraries, small buffers
constexpr std::size_t kMaxCachedPages = 1024;
constexpr std::size_t kMinCachedPages = 8;
constexpr std::size_t kPagesAtOnce = 256;

/// A range of bytes of a file, from `begin` up to `end`.
struct Extent {
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
};

class FileCheck {
 public:
  FileCheck(const std::filesystem::path& path, const VerifyOptions& options)
      : file_(path),
        options_(options),
        executor_(options.threads),
        findings_(options.keep_findings, options.fail_fast),
        flips_(options.flip_budget) {}

  VerifyReport run(Progress& progress) {
    try {
      survey_ =
          survey_file(file_, findings_, flips_, options_.level == VerifyLevel::commit, progress);
      keep_to_cap();
      if (options_.level >= VerifyLevel::directory) {
        check_pages(progress);
        explain_refusal();
      }
      if (options_.level >= VerifyLevel::payload && survey_.container) check_padding();
      if (options_.level >= VerifyLevel::content && survey_.container) check_tree(progress);
      if (options_.level >= VerifyLevel::rebuild && report_.tree_checked) rebuild(progress);
    } catch (const StopVerifying&) {  // the first damage was found, and no more was asked for
    }
    return report();
  }

 private:
  VerifyReport report() {
    report_.findings = findings_.kept();
    report_.damage = findings_.damage();
    report_.warnings = findings_.warnings();
    report_.file_bytes = file_.size();
    if (report_.pages) {
      report_.damaged_pages =
          static_cast<std::uint64_t>(std::ranges::count(survey_.sites, false, &PageSite::sound));
    }
    report_.superblock = survey_.superblock;
    report_.sites = std::move(survey_.sites);
    return std::move(report_);
  }

  /// Divides the memory: what is fixed first, and the rest for node pages.
  /// @throws LimitError when less than kMinCachedPages remain
  void keep_to_cap() {
    if (!survey_.superblock) return;
    const Superblock& s = *survey_.superblock;
    const std::uint64_t page = std::uint64_t{1} << s.header.page_shift;
    const std::uint64_t groups =
        survey_.container ? s.node_groups : 0;  // a superblock alone proves no number of groups
    const std::uint64_t fixed = kBaseBytes + 100 * survey_.sites.size() + groups / 8 +
                                3 * page * executor_.threads() + 100 * s.leaf_points;
    const std::uint64_t least = fixed + kMinCachedPages * page;
    if (options_.memory_bytes < least) {
      throw LimitError(
          fmt::format("the memory cap is too small for this file: the least that works is {}M",
                      (least >> 20) + 1));
    }
    cached_pages_ = static_cast<std::size_t>(
        std::min<std::uint64_t>(kMaxCachedPages, (options_.memory_bytes - fixed) / page));
  }

  /// Reports why readers refuse the file, unless the same rule was found broken in a page or in the
  /// directory.
  void explain_refusal() {
    if (!survey_.refusal) return;
    const auto same = [&](const Finding& f) { return f.rule == survey_.refusal->rule; };
    if (std::ranges::none_of(findings_.kept(), same)) findings_.add(*survey_.refusal);
  }

  /// Checks the pages in rounds of kPagesAtOnce, so that findings are added in the order of the
  /// file for any number of threads.
  void check_pages(Progress& progress) {
    progress.begin("check pages", survey_.sites.size(), "pages");
    std::vector<std::unique_ptr<SurveyedPage>> pages(executor_.threads());
    std::vector<std::optional<Finding>> found(kPagesAtOnce);
    report_.pages = 0;
    for (std::size_t first = 0; first < survey_.sites.size(); first += kPagesAtOnce) {
      // Check one round of pages, while the system reads the next.
      const std::size_t count = std::min(kPagesAtOnce, survey_.sites.size() - first);
      read_ahead(first + count);
      executor_.for_each(count, [&](std::size_t i, unsigned thread) {
        if (!pages[thread]) pages[thread] = std::make_unique<SurveyedPage>(file_, survey_);
        found[i] = pages[thread]->check(survey_.sites[first + i], static_cast<int>(options_.level),
                                        flips_);
      });
      // Add what they found, in their order.
      *report_.pages += count;
      for (std::size_t i = 0; i < count; ++i) {
        if (!found[i]) continue;
        survey_.sites[first + i].sound = false;
        findings_.add(*std::exchange(found[i], std::nullopt));
      }
      progress.advance(count);
    }
    progress.end();
  }

  /// Asks the system to read the pages of the next round, from page `first` on, ahead of their
  /// check.
  void read_ahead(std::size_t first) const noexcept {
    if (first >= survey_.sites.size() || options_.level < VerifyLevel::payload) return;
    const std::uint64_t begin = survey_.sites[first].entry.offset;
    const std::uint64_t end =
        survey_.sites[std::min(first + kPagesAtOnce, survey_.sites.size()) - 1].end();
    if (begin < end) file_.read_ahead(begin, end - begin);
  }

  /// Checks the bytes between the pages of a container that opens.
  void check_padding() {
    std::uint64_t from = kBlockBytes;
    for (const PageSite& site : survey_.sites) {
      check_zero({from, site.entry.offset});
      from = site.end();
    }
    const Superblock& s = *survey_.superblock;
    check_zero({from, s.directory_offset});
    // Opening the file checked the directory pages, but not the padding after the last of them.
    const std::uint32_t full = directory_entries_per_page(s.header);
    const std::uint64_t entries = s.page_count - (s.directory_pages - 1) * std::uint64_t{full};
    const std::uint64_t last =
        s.directory_offset + (std::uint64_t{s.directory_pages - 1} << s.header.page_shift);
    check_zero(
        {last + kPageHeaderBytes + entries * kDirectoryEntryBytes, s.file_bytes - 2 * kBlockBytes});
  }

  /// Reports the bytes of a gap that are not zero, from the first to the last, as one finding.
  void check_zero(Extent gap) {
    std::array<std::byte, 2 * kBlockBytes> block;
    Finding finding{.level = 2, .rule = kPadding};
    int bits = 0;
    for (; gap.begin < gap.end; gap.begin += block.size()) {
      const auto part =
          std::span(block).first(std::min<std::uint64_t>(block.size(), gap.end - gap.begin));
      file_.read_at(gap.begin, part);
      for (std::size_t i = 0; i < part.size(); ++i) {
        if (part[i] == std::byte{0}) continue;
        if (finding.bytes == 0) finding.offset = gap.begin + i;
        finding.bytes = gap.begin + i + 1 - finding.offset;
        bits += std::popcount(std::to_integer<unsigned>(part[i]));
      }
    }
    if (bits == 0) return;
    finding.cause = bits == 1 ? Cause::bit_flip : Cause::unknown;
    finding.text = "the space between pages is not zero";
    findings_.add(std::move(finding));
  }

  /// Walks the tree, excluding damaged pages, and takes over what it counted.
  void check_tree(Progress& progress) {
    std::vector<bool> damaged(survey_.container->page_count());
    for (const PageSite& site : survey_.sites) damaged[site.page] = !site.sound;
    progress.begin("check tree", survey_.superblock->points, "points");
    const TreeCounts tree =
        verify_tree(*survey_.container, damaged, cached_pages_, findings_, progress);
    progress.end();
    report_.points = 0;
    for (const PageSite& site : survey_.sites) {
      if (site.sound && site.entry.type == PageType::point)
        *report_.points += site.entry.record_count;
    }
    report_.nodes = tree.nodes;
    report_.groups = tree.groups;
    report_.levels = tree.levels;
    report_.tree_checked = tree.complete;
  }

  void rebuild(Progress& progress) {
    progress.begin("build again", survey_.superblock->points, "points");
    try {
      report_.tree_digest =
          compare_rebuilt(*survey_.container, cached_pages_, findings_, executor_, progress);
    } catch (const FormatError&) {  // points out of order have no tree, and were reported before
    }
    progress.end();
  }

  InputFile file_;
  VerifyOptions options_;
  ThreadPool executor_;
  Findings findings_;
  FlipBudget flips_;
  Survey survey_;
  VerifyReport report_;
  std::size_t cached_pages_ = kMinCachedPages;
};

}  // namespace

VerifyReport verify_container(const std::filesystem::path& path, const VerifyOptions& options,
                              Progress& progress) {
  return FileCheck(path, options).run(progress);
}

}  // namespace ptc
