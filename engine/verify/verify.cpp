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
//
// To decode pages of points and nodes once, level 3 checks their content where the tree leads to
// them. Afterwards it checks the pages that the tree did not lead to. Only where a page has a fault
// that the tree came upon is the tree checked again, without that page.
#include "engine/verify/verify.h"

#include <algorithm>
#include <array>
#include <bit>
#include <memory>
#include <utility>

#include "engine/base/memory_budget.h"
#include "engine/io/file/remote_file.h"
#include "engine/io/file/url.h"
#include "engine/parallel/thread_pool.h"
#include "engine/store/commit.h"
#include "engine/verify/checked_pages.h"
#include "engine/verify/rebuild.h"
#include "engine/verify/survey.h"
#include "engine/verify/surveyed_page.h"
#include "engine/verify/verify_tree.h"
#include "format/parts_page.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr char kPadding[] = "spec/container.md#padding";

constexpr std::size_t kMaxCachedPages = 1024;  // of the tree that is compared with another
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
        report_.pages = 0;
        check_pages([&](const PageSite& site) { return first_level(site); }, progress);
        explain_refusal();
      }
      if (options_.level >= VerifyLevel::payload && survey_.container) check_padding();
      if (options_.level >= VerifyLevel::directory && survey_.container) check_parts(progress);
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
          static_cast<std::uint64_t>(std::ranges::count(survey_.sites, false, &PageSite::sound)) +
          damaged_in_parts_;
    }
    report_.superblock = survey_.superblock;
    report_.sites = std::move(survey_.sites);
    return std::move(report_);
  }

  /// Divides the memory: what is fixed first, and the rest for the walks through the tree.
  /// @throws LimitError when less than one of them needs remains
  void keep_to_cap() {
    if (!survey_.superblock) return;
    const Superblock& s = *survey_.superblock;
    const std::uint64_t page = std::uint64_t{1} << s.header.page_shift;
    const std::uint64_t groups =
        survey_.container ? s.node_groups : 0;  // a superblock alone proves no number of groups
    MemoryBudget budget(options_.memory_bytes, "this file", "memory_bytes");
    budget.charge("the program", kProgramBytes);
    if (file_.is_remote()) budget.charge(RemoteFile::kMemory, RemoteFile::kMemoryBytes);
    budget.charge("the list of pages", 110 * survey_.sites.size());
    budget.charge("groups of nodes", groups / 8);
    budget.charge("threads", 3 * page * executor_.threads());
    const std::uint64_t left = budget.rest("walks through the tree", TreeMemory::least_bytes(s));
    tree_memory_ = TreeMemory::divided(left, s, executor_.threads());
    cached_pages_ = static_cast<std::size_t>(std::min<std::uint64_t>(kMaxCachedPages, left / page));
  }

  /// Reports why readers refuse the file, unless the same rule was found broken in a page or in the
  /// directory.
  void explain_refusal() {
    if (!survey_.refusal) return;
    const auto same = [&](const Finding& f) { return f.rule == survey_.refusal->rule; };
    if (std::ranges::none_of(findings_.kept(), same)) findings_.add(*survey_.refusal);
  }

  /// Returns the level to which a page is checked at first. What point and node pages hold is
  /// checked where the tree leads to them, so that they are decoded once.
  [[nodiscard]] int first_level(const PageSite& site) const {
    const int level = static_cast<int>(options_.level);
    return walks_to(site) ? std::min(level, static_cast<int>(VerifyLevel::payload)) : level;
  }

  /// Says whether the check of the tree reads a page, as far as all is sound.
  [[nodiscard]] bool walks_to(const PageSite& site) const {
    return survey_.container && !survey_.header->has_parts() && site.page != kNoPage &&
           (site.entry.type == PageType::point || site.entry.type == PageType::node);
  }

  /// Checks the pages in rounds of kPagesAtOnce, so that findings are added in the order of the
  /// file for any number of threads.
  /// @param level_of  returns the level to which a page is checked; 0: it is not
  template <class LevelOf>
  void check_pages(const LevelOf& level_of, Progress& progress) {
    progress.begin("check pages", survey_.sites.size(), "pages");
    std::vector<std::unique_ptr<SurveyedPage>> pages(executor_.threads());
    std::vector<std::optional<Finding>> found(kPagesAtOnce);
    for (std::size_t first = 0; first < survey_.sites.size(); first += kPagesAtOnce) {
      // Check one round of pages, while the system reads the next.
      const std::size_t count = std::min(kPagesAtOnce, survey_.sites.size() - first);
      read_ahead(first + count);
      executor_.for_each(count, [&](std::size_t i, unsigned thread) {
        const PageSite& site = survey_.sites[first + i];
        const int level = level_of(site);
        if (level == 0) return;
        if (!pages[thread]) pages[thread] = std::make_unique<SurveyedPage>(file_, survey_);
        found[i] = pages[thread]->check(site, level, flips_);
      });
      // Add what they found, in their order.
      report_.pages = std::max<std::uint64_t>(report_.pages.value_or(0), first + count);
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
    // Opening the file checked the directory pages, but not the padding after the last of them.
    const Superblock& s = *survey_.superblock;
    const std::uint32_t full = directory_entries_per_page(s.header);
    const std::uint64_t entries = s.page_count - (s.directory_pages - 1) * std::uint64_t{full};
    const std::uint64_t last =
        s.directory_offset + (std::uint64_t{s.directory_pages - 1} << s.header.page_shift);
    const std::uint64_t entries_end = last + kPageHeaderBytes + entries * kDirectoryEntryBytes;
    // Check the gaps before the directory, and those of the tail behind it.
    std::uint64_t from = kBlockBytes;
    for (const PageSite& site : survey_.sites) {
      if (from <= s.directory_offset && site.entry.offset >= s.tail_offset) {
        check_zero({from, s.directory_offset});
        from = entries_end;
      }
      check_zero({from, site.entry.offset});
      from = site.end();
    }
    check_zero({from, s.file_bytes - 2 * kBlockBytes});
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

  /// Says whether a file can be checked as a part: it is a file, and no scene of parts.
  static bool is_part(const std::filesystem::path& file) {
    if (!is_file(file)) return false;
    try {
      return !read_file_header(InputFile(file)).has_parts();
    } catch (const FormatError&) {  // its own check reports it
      return true;
    }
  }

  /// Checks that references of the scene's own node pages lead to what the parts have.
  void check_top() {
    const ContainerReader& scene = *survey_.container;
    std::vector<std::byte> payload(scene.page_payload_limit());
    PageDecoder decoder;
    for (PageSite& site : survey_.sites) {
      if (site.entry.type != PageType::node || !site.sound) continue;
      try {
        static_cast<void>(scene.read_page(scene.number_of(site.page), payload, decoder));
      } catch (const FormatError& error) {
        site.sound = false;
        Finding finding = finding_of(error, 3);
        finding.cause = Cause::writer;
        findings_.add(std::move(finding));
      }
    }
  }

  /// Checks that the keys of the parts' first and last points are whole those of the scene's
  /// record.
  void check_keys(const std::vector<PartRecord>& records) {
    std::vector<std::byte> payload(survey_.container->page_payload_limit());
    PageDecoder decoder;
    for (std::size_t i = 0; i < records.size(); ++i) {
      const ContainerReader& part = *survey_.container->parts()[i];
      const auto point = [&](std::size_t rank, bool last) {
        const PageHeader page = part.read_page(part.point_pages()[rank], payload, decoder);
        const PointPage points(payload.data(), page.record_count, part.header().point_bytes);
        return points[last ? page.record_count - 1 : 0].key;
      };
      if (point(0, false) == records[i].first_key &&
          point(part.point_pages().size() - 1, true) == records[i].last_key)
        continue;
      findings_.add({.cause = Cause::writer,
                     .level = 3,
                     .file = part.path().string(),
                     .rule = "spec/parts.md#parts-file",
                     .text = "its points have other keys than the scene says"});
    }
  }

  /// Takes over what the check of a part found.
  void add_part(const std::filesystem::path& file, VerifyReport& found) {
    report_.pages = report_.pages.value_or(0) + found.pages.value_or(0);
    damaged_in_parts_ += found.damaged_pages.value_or(0);
    const auto kept_damage = static_cast<std::uint64_t>(
        std::ranges::count(found.findings, Severity::damage, &Finding::severity));
    findings_.count(found.damage - kept_damage,
                    found.warnings - (found.findings.size() - kept_damage));
    for (Finding& finding : found.findings) {
      finding.file = file.string();
      findings_.add(std::move(finding));
    }
  }

  /// Checks each part of a scene of parts as a file of its own, and then the scene with them.
  void check_parts(Progress& progress) {
    if (!survey_.header->has_parts()) return;
    std::uint64_t points = 0;
    const std::uint64_t before = findings_.damage();
    try {
      const PartList list = survey_.container->read_parts();
      for (const PartRecord& part : list.parts()) {
        const std::filesystem::path file = file_beside(file_.path(), part.name);
        if (!is_part(file)) continue;  // opening the scene reports it
        VerifyReport found = FileCheck(file, options_).run(progress);
        add_part(file, found);
        points += found.points.value_or(0);
      }
      // Open the scene with its parts, unless what is wrong with them was found already.
      if (findings_.damage() == before) {
        survey_.container = std::make_unique<ContainerReader>(file_.path());
        if (options_.level >= VerifyLevel::content) {
          check_keys(list.parts());
          check_top();
        }
      }
    } catch (const FormatError& error) {
      Finding finding = finding_of(error, 1);
      finding.cause = code_of(finding) == "parts-file" ? Cause::part : Cause::writer;
      if (error.file() != file_.path()) finding.file = error.file();
      findings_.add(std::move(finding));
    }
    if (options_.level >= VerifyLevel::content) report_.points = points;
  }

  /// Checks the tree, excluding damaged pages, and the content of the pages that it leads to. Takes
  /// over what was counted.
  void check_tree(Progress& progress) {
    // Without its parts a scene has no tree to walk.
    if (survey_.header->has_parts() && survey_.container->parts().empty()) return;
    CheckedPages checked(*survey_.container);
    std::optional<CheckedTree> tree;
    try {
      tree = walk_tree(checked, progress);
    } catch (const FormatError&) {  // a page breaks a rule, which check_content() finds
    }
    // Check the pages that were not read, and without those that are damaged check the tree again.
    check_content(checked, progress);
    if (!tree) tree = walk_tree(checked, progress);
    static_cast<void>(findings_.append(tree->findings));  // it kept as many as these do
    if (survey_.container->parts().empty()) count_points();
    report_.nodes = tree->counts.nodes;
    report_.groups = tree->counts.groups;
    report_.levels = tree->counts.levels;
    report_.tree_checked = tree->counts.complete;
  }

  CheckedTree walk_tree(CheckedPages& checked, Progress& progress) {
    std::vector<bool> damaged(survey_.container->page_count());
    for (const PageSite& site : survey_.sites) {
      if (!site.sound) damaged[survey_.container->number_of(site.page)] = true;
    }
    progress.begin("check tree", survey_.superblock->points, "points");
    CheckedTree tree = verify_tree(*survey_.container, damaged, checked, tree_memory_, findings_,
                                   executor_, progress);
    progress.end();
    return tree;
  }

  /// Checks the content of the sound pages that the check of the tree did not read.
  void check_content(const CheckedPages& checked, Progress& progress) {
    const auto level_of = [&](const PageSite& site) {
      return walks_to(site) && site.sound && !checked.passed(site.page)
                 ? static_cast<int>(VerifyLevel::content)
                 : 0;
    };
    const auto is_left = [&](const PageSite& site) { return level_of(site) > 0; };
    if (std::ranges::any_of(survey_.sites, is_left)) check_pages(level_of, progress);
  }

  /// Counts the points of sound pages.
  void count_points() {
    report_.points = 0;
    for (const PageSite& site : survey_.sites) {
      if (site.sound && site.entry.type == PageType::point)
        *report_.points += site.entry.record_count;
    }
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
  TreeMemory tree_memory_;
  std::size_t cached_pages_ = 1;        ///< of node pages, to compare the tree with another
  std::uint64_t damaged_in_parts_ = 0;  ///< pages
};

}  // namespace

VerifyReport verify_container(const std::filesystem::path& path, const VerifyOptions& options,
                              Progress& progress) {
  return FileCheck(path, options).run(progress);
}

}  // namespace ptc
