// The levels of a verification, one after another (engine/verify/verify.h).
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

/// Part of a file.
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
    } catch (const StopVerifying&) {  // it was found
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

  void keep_to_cap() {
    if (!survey_.superblock) return;
    const Superblock& s = *survey_.superblock;
    const std::uint64_t page = std::uint64_t{1} << s.header.page_shift;
    const std::uint64_t groups =
        survey_.container ? s.node_groups : 0;  // a lone superblock may say anything
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

  /// What keeps readers from opening the file is a finding, unless it was found in a page or the
  /// directory.
  void explain_refusal() {
    if (!survey_.refusal) return;
    const auto same = [&](const Finding& f) { return f.rule == survey_.refusal->rule; };
    if (std::ranges::none_of(findings_.kept(), same)) findings_.add(*survey_.refusal);
  }

  void check_pages(Progress& progress) {
    progress.begin("check pages", survey_.sites.size(), "pages");
    std::vector<std::unique_ptr<SurveyedPage>> pages(executor_.threads());
    std::vector<std::optional<Finding>> found(kPagesAtOnce);
    report_.pages = 0;
    for (std::size_t first = 0; first < survey_.sites.size(); first += kPagesAtOnce) {
      const std::size_t count = std::min(kPagesAtOnce, survey_.sites.size() - first);
      read_ahead(first + count);
      executor_.for_each(count, [&](std::size_t i, unsigned thread) {
        if (!pages[thread]) pages[thread] = std::make_unique<SurveyedPage>(file_, survey_);
        found[i] = pages[thread]->check(survey_.sites[first + i], static_cast<int>(options_.level),
                                        flips_);
      });
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

  /// The pages of the next round, those from `first` on, come from the disk while others are
  /// checked.
  void read_ahead(std::size_t first) const noexcept {
    if (first >= survey_.sites.size() || options_.level < VerifyLevel::payload) return;
    const std::uint64_t begin = survey_.sites[first].entry.offset;
    const std::uint64_t end =
        survey_.sites[std::min(first + kPagesAtOnce, survey_.sites.size()) - 1].end();
    if (begin < end) file_.read_ahead(begin, end - begin);
  }

  /// What lies between the pages of a container that opens.
  void check_padding() {
    std::uint64_t from = kBlockBytes;
    for (const PageSite& site : survey_.sites) {
      check_zero({from, site.entry.offset});
      from = site.end();
    }
    const Superblock& s = *survey_.superblock;
    check_zero({from, s.directory_offset});
    // Directory pages were checked when the file was opened, all but what pads the last.
    const std::uint32_t full = directory_entries_per_page(s.header);
    const std::uint64_t entries = s.page_count - (s.directory_pages - 1) * std::uint64_t{full};
    const std::uint64_t last =
        s.directory_offset + (std::uint64_t{s.directory_pages - 1} << s.header.page_shift);
    check_zero(
        {last + kPageHeaderBytes + entries * kDirectoryEntryBytes, s.file_bytes - 2 * kBlockBytes});
  }

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
    finding.text = "byte between pages is not zero";
    findings_.add(std::move(finding));
  }

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
    } catch (const FormatError&) {  // points that descend were found before, and have no tree
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
