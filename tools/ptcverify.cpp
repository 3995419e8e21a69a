// ptcverify: is every byte of a container what the specification says, and if not, what happened to
// it?
#include <algorithm>
#include <chrono>
#include <optional>

#include <fmt/format.h>

#include "engine/io/text/text.h"
#include "engine/verify/salvage.h"
#include "engine/verify/verify.h"
#include "tools/common.h"
#include "tools/damage_map.h"
#include "tools/report.h"

namespace {

using nlohmann::ordered_json;

constexpr char kPurpose[] =
    "Goes over a container and tells of every fault where it is, which rule it breaks and what may "
    "have\n"
    "caused it. Levels: 0 header, superblocks, length; 1 directory and page headers; 2 payload "
    "checksums\n"
    "and padding; 3 what pages hold, the tree against its points, totals; 4 the tree built again "
    "and\n"
    "compared.";
constexpr char kExamples[] =
    "  ptcverify scene.ptcx\n"
    "  ptcverify city.ptcx --level 2 --progress\n"
    "  ptcverify broken.ptcx --map damage.svg --json\n"
    "  ptcverify broken.ptcx --salvage kept.ptcx\n";
constexpr char kVerifyCodes[] =
    "0 sound, 1 damaged, 2 usage, 3 system, 4 format not supported, 5 limit too small,\n"
    "6 unfinished or truncated, 7 internal error.";
constexpr std::size_t kMaxLines = 20;

const char* text_of(ptc::Remedy remedy) {
  switch (remedy) {
    case ptc::Remedy::replace:
      return "take a good copy of the file, or keep what is whole with --salvage";
    case ptc::Remedy::test_machines:
      return "test memory and disk of the machines it went through; take a good copy, or use "
             "--salvage";
    case ptc::Remedy::copy_again:
      return "copy the file again, or use --salvage";
    case ptc::Remedy::write_again:
      return "run it again, or keep what it wrote with --salvage";
    case ptc::Remedy::transfer:
      return "transfer the file again, or use --salvage";
    case ptc::Remedy::transfer_bare:
      return "transfer the file again, as binary";
    case ptc::Remedy::cut:
      return "cut the file to the length given, or use --salvage";
    case ptc::Remedy::rescue:
      return "copy what can be read elsewhere, then use --salvage on the copy";
    case ptc::Remedy::other_file:
      return "this is another kind of file";
    case ptc::Remedy::newer_program:
      return "use the program that wrote it, or a newer one of this";
    case ptc::Remedy::report:
      return "write it again with another version, and report this";
  }
  return "";
}

/// What happened, where that is known, and what to do about it.
std::string hint_of(const ptc::Finding& finding) {
  const std::string happened = ptc::explanation_of(finding.cause);
  return (happened.empty() ? "" : happened + ": ") + text_of(finding.remedy());
}

/// The exit code of the most important finding.
ptc::ExitCode exit_code_of(const ptc::VerifyReport& report) {
  const auto any = [&](auto... causes) {
    return std::ranges::any_of(report.findings,
                               [&](const ptc::Finding& f) { return ((f.cause == causes) || ...); });
  };
  if (any(ptc::Cause::newer)) return ptc::kUnsupported;
  if (any(ptc::Cause::unreadable)) return ptc::kSystem;
  if (any(ptc::Cause::unfinished, ptc::Cause::truncated)) return ptc::kUnfinished;
  return report.sound() ? ptc::kDone : ptc::kInvalidData;
}

ordered_json line_for(const ptc::Finding& finding) {
  ordered_json line{{"code", ptc::code_of(finding)},
                    {"severity", finding.severity == ptc::Severity::damage ? "damage" : "warning"},
                    {"cause", ptc::name_of(finding.cause)},
                    {"offset", finding.offset}};
  if (finding.bytes > 0) line["bytes"] = finding.bytes;
  if (finding.page) line["page"] = *finding.page;
  line["level"] = finding.level;
  line["text"] = finding.text;
  if (!finding.expected.empty()) line["expected"] = finding.expected;
  if (!finding.actual.empty()) line["actual"] = finding.actual;
  line["rule"] = finding.rule;
  line["hint"] = hint_of(finding);
  return line;
}

std::string findings_text(const std::string& name, const ptc::VerifyReport& report) {
  std::string text;
  const std::size_t shown = std::min(kMaxLines, report.findings.size());
  for (std::size_t i = 0; i < shown; ++i)
    text += fmt::format("ptcverify: {}: {}\n", name, line_of(report.findings[i]));
  const std::uint64_t rest = report.damage + report.warnings - shown;
  if (rest > 0)
    text += fmt::format("ptcverify: {}: and {} more (--json lists {})\n", name, rest,
                        report.findings.size());
  return text;
}

/// "1 page", "2 pages".
std::string counted(std::uint64_t count, const char* what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

/// What was looked at, as far as the check came.
std::string looked_at(const ptc::VerifyReport& report, int level) {
  if (!report.pages) return "header, superblocks and length";
  if (level == 1) return "directory and headers of " + counted(*report.pages, "page");
  if (!report.nodes) return "checksums of " + counted(*report.pages, "page");
  std::string text = fmt::format("{}, {}, {} in {}", counted(*report.pages, "page"),
                                 counted(*report.points, "point"), counted(*report.nodes, "node"),
                                 counted(*report.groups, "group"));
  return report.tree_digest ? text + ", the tree built again" : text;
}

std::string verdict_text(const std::string& name, const ptc::VerifyReport& report, int level,
                         double seconds) {
  const std::string over = fmt::format("{}, {}, {:.2f} s", looked_at(report, level),
                                       ptc::bytes_text(report.file_bytes), seconds);
  if (report.sound()) return fmt::format("{}: valid at level {}: {}\n", name, level, over);
  std::string faults = counted(report.damage, "fault");
  if (report.pages)
    faults += fmt::format(" in {} of {}", *report.damaged_pages, counted(*report.pages, "page"));
  return fmt::format("ptcverify: {}: damaged: {} at level {}: {}\n", name, faults, level,
                     hint_of(report.findings.front()));
}

/// The value, or null where there is none.
template <class T>
ordered_json or_null(const std::optional<T>& value) {
  return value ? ordered_json(*value) : ordered_json();
}

ordered_json facts_of(const ptc::SalvageReport& kept) {
  return {{"points", kept.points},
          {"points_before", or_null(kept.points_before)},
          {"point_pages", kept.point_pages},
          {"point_pages_before", kept.point_pages_before},
          {"attribute_pages", kept.attribute_pages},
          {"attribute_pages_before", kept.attribute_pages_before},
          {"meta", kept.meta},
          {"area_share", or_null(kept.area_share)},
          {"energy_share", or_null(kept.flux_share)}};
}

std::string salvage_text(const std::string& name, const ptc::SalvageReport& kept) {
  const auto of = [](std::uint64_t part, std::uint64_t whole) {
    return fmt::format("{} of {}", part, whole);
  };
  std::string text = fmt::format("{}: salvaged ", name);
  if (const auto before = kept.points_before) {
    const double share =
        static_cast<double>(kept.points) / static_cast<double>(std::max<std::uint64_t>(1, *before));
    text += fmt::format("{} points ({:.2f} %), {:.2f} % of area and {:.2f} % of energy",
                        of(kept.points, *before), 100 * share, 100 * *kept.area_share,
                        100 * *kept.flux_share);
  } else {
    text += fmt::format("{} points in {} pages; how many there were is not known", kept.points,
                        of(kept.point_pages, kept.point_pages_before));
  }
  if (kept.attribute_pages_before > 0)
    text += fmt::format(", {} pages of channels",
                        of(kept.attribute_pages, kept.attribute_pages_before));
  return text + (kept.meta ? "\n" : "; names of channels and texts are lost\n");
}

/// What can be kept, or why nothing can: the findings are told in either case.
void add_salvage(const std::filesystem::path& file, const std::filesystem::path& target,
                 const ptc::RunOptions& run, ptc::Progress& progress, ptc::Outcome& outcome) {
  try {
    const ptc::SalvageReport kept = ptc::salvage_container(
        file, target, {.memory_bytes = run.memory_bytes, .threads = run.threads}, progress);
    outcome.facts["salvage"] = facts_of(kept);
    outcome.summary += salvage_text(ptc::printable(target.string()), kept);
  } catch (const ptc::FormatError& error) {
    outcome.facts["salvage"] = nullptr;
    outcome.summary += fmt::format("ptcverify: {}\n", ptc::printable(error.what()));
    if (outcome.exit_code == ptc::kDone) outcome.exit_code = ptc::kInvalidData;
  }
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcverify", kPurpose, kExamples, kVerifyCodes);
  std::filesystem::path file, map, salvage;
  int level = 3;
  bool fail_fast = false;
  command.add_input("file", file, "The container to check")->required();
  command.app()
      .add_option("--level", level, "How far to go, 0 to 4")
      ->check(CLI::Range(0, 4))
      ->capture_default_str();
  command.app().add_flag("--fail-fast", fail_fast, "Stop at the first fault");
  command.add_output("--map", map, {".svg", ".png"}, "Draw where the damage lies")->required(false);
  command.add_output("--salvage", salvage, {".ptcx"}, "Write what is whole to a new container")
      ->required(false);
  return command.run(argc, argv, [&](ptc::Progress& progress) -> ptc::Outcome {
    const ptc::RunOptions& run = command.run_options();
    const auto start = std::chrono::steady_clock::now();
    const ptc::VerifyReport report =
        ptc::verify_container(file,
                              {.level = static_cast<ptc::VerifyLevel>(level),
                               .memory_bytes = run.memory_bytes,
                               .threads = run.threads,
                               .fail_fast = fail_fast},
                              progress);
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const std::string name = ptc::printable(file.string());
    if (!map.empty()) ptc::write_damage_map(map, name, report);
    ptc::Outcome outcome;
    outcome.exit_code = exit_code_of(report);
    outcome.lines.emplace();
    for (const ptc::Finding& finding : report.findings) outcome.lines->push_back(line_for(finding));
    outcome.facts = {{"file", file.string()},
                     {"valid", report.sound()},
                     {"level", level},
                     {"damage", report.damage},
                     {"warnings", report.warnings},
                     {"pages", or_null(report.pages)},
                     {"damaged_pages", or_null(report.damaged_pages)},
                     {"points", or_null(report.points)},
                     {"nodes", or_null(report.nodes)},
                     {"node_groups", or_null(report.groups)},
                     {"levels", or_null(report.levels)},
                     {"tree_checked", report.tree_checked},
                     {"bytes", report.file_bytes},
                     {"seconds", seconds}};
    if (report.tree_digest)
      outcome.facts["tree_digest"] =
          ptc::hex((*report.tree_digest)[1]) + ptc::hex((*report.tree_digest)[0]);
    outcome.summary = findings_text(name, report) + verdict_text(name, report, level, seconds);
    if (!salvage.empty()) add_salvage(file, salvage, run, progress, outcome);
    return outcome;
  });
}
