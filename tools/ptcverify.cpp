// ptcverify: checks every byte of a container against the specification, and says what may have
// damaged it.
//
//   file -> verify_container() -> findings -+-> lines, verdict, exit code
//                                           +-> damage map (--map)
//   file -> salvage_container() -> a new container with the undamaged pages (--salvage)
#include <algorithm>
#include <chrono>
#include <optional>

#include <fmt/format.h>

#include "engine/verify/salvage.h"
#include "engine/verify/verify.h"
#include "format/text.h"
#include "tools/common.h"
#include "tools/damage_map.h"
#include "tools/inputs.h"
#include "tools/option_text.h"
#include "tools/report.h"
#include "tools/values.h"

namespace {

using nlohmann::ordered_json;

constexpr char kPurpose[] =
    "Checks a container for damage, and salvages what is whole.\n"
    "Each fault is reported with its offset in the file, the rule of the specification that it "
    "breaks, and what may have caused it.";
constexpr char kExamples[] =
    "  # Check a container\n"
    "  ptcverify scene.ptcx\n"
    "  # Check the checksums alone, in less time\n"
    "  ptcverify city.ptcx --level 2 --progress\n"
    "  # Draw a map of the damage, and list all faults for a script\n"
    "  ptcverify broken.ptcx --map damage.svg --json\n"
    "  # Write the undamaged part to a new container\n"
    "  ptcverify broken.ptcx --salvage kept.ptcx\n";
/// What its exit codes mean where that is not as in kExitCodes.
constexpr char kVerifyCodes[] =
    "0 sound: no fault was found\n"
    "1 damaged: the file is missing or has faults\n"
    "3 system: the system refused, for example because the disk cannot be read\n"
    "6 unfinished or truncated: the program that wrote the file did not end, or the end of the "
    "file is missing";
constexpr std::size_t kMaxLines = 20;

/// What to do about a fault, as a sentence without a full stop.
const char* text_of(ptc::Remedy remedy) {
  switch (remedy) {
    case ptc::Remedy::replace:
      return "replace the file by a good copy, or keep the undamaged part with --salvage";
    case ptc::Remedy::test_machines:
      return "test memory and disk of the machines that it went through; replace it by a good "
             "copy, or use --salvage";
    case ptc::Remedy::copy_again:
      return "copy the file again, or use --salvage";
    case ptc::Remedy::write_again:
      return "run it again, or keep what it wrote with --salvage";
    case ptc::Remedy::transfer:
      return "transfer the file again, or use --salvage";
    case ptc::Remedy::transfer_bare:
      return "transfer the file again, as binary";
    case ptc::Remedy::cut:
      return "cut the file to the length stated, or use --salvage";
    case ptc::Remedy::copy_parts:
      return "copy the scene again with all of its parts";
    case ptc::Remedy::rescue:
      return "copy what can be read elsewhere, then use --salvage on the copy";
    case ptc::Remedy::other_file:
      return "this is another kind of file";
    case ptc::Remedy::newer_program:
      return "use the program that wrote it, or a newer version of this one";
    case ptc::Remedy::report:
      return "write the file again with another version of the program, and report this defect";
  }
  return "";
}

/// What happened, if that is known, and what to do about it.
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

/// A finding as a line of --json (spec/errors.md#findings).
ordered_json line_for(const ptc::Finding& finding) {
  ordered_json line{{"code", ptc::code_of(finding)},
                    {"severity", finding.severity == ptc::Severity::damage ? "damage" : "warning"},
                    {"cause", ptc::name_of(finding.cause)},
                    {"offset", finding.offset}};
  if (finding.bytes > 0) line["bytes"] = finding.bytes;
  if (finding.page) line["page"] = *finding.page;
  if (!finding.file.empty()) line["file"] = finding.file;
  line["level"] = finding.level;
  line["text"] = finding.text;
  if (!finding.expected.empty()) line["expected"] = finding.expected;
  if (!finding.actual.empty()) line["actual"] = finding.actual;
  line["rule"] = finding.rule;
  line["hint"] = hint_of(finding);
  return line;
}

/// A line for each of the first kMaxLines findings, and one for the number of the others.
std::string findings_text(const std::string& name, const ptc::VerifyReport& report) {
  std::string text;
  const std::size_t shown = std::min(kMaxLines, report.findings.size());
  for (std::size_t i = 0; i < shown; ++i)
    text += fmt::format("ptcverify: {}: {}\n", name, line_of(report.findings[i]));
  const std::uint64_t rest = report.damage + report.warnings - shown;
  if (rest > 0)
    text += fmt::format("ptcverify: {}: and {} more findings; --json lists {}\n", name, rest,
                        report.findings.size());
  return text;
}

/// A number with its noun: "1 page", "2 pages".
std::string counted(std::uint64_t count, const char* what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

/// The parts of the file that the check reached.
std::string looked_at(const ptc::VerifyReport& report, int level) {
  if (!report.pages) return "header, superblocks and length";
  if (level == 1) return "directory and headers of " + counted(*report.pages, "page");
  if (!report.nodes) return "checksums of " + counted(*report.pages, "page");
  std::string text = fmt::format("{}, {}, {} in {}", counted(*report.pages, "page"),
                                 counted(*report.points, "point"), counted(*report.nodes, "node"),
                                 counted(*report.groups, "group"));
  return report.tree_digest ? text + ", the tree built again" : text;
}

/// True when the file was never a container, as far as its bytes show: it begins like another kind
/// of file, and no superblock knows of pages.
bool is_foreign(const ptc::VerifyReport& report) {
  return !report.sound() && report.findings.front().cause == ptc::Cause::foreign &&
         report.pages.value_or(0) == 0;
}

/// The last line of a check: valid or damaged, how much was checked, and what to do.
std::string verdict_text(const std::string& name, const ptc::VerifyReport& report, int level,
                         double seconds) {
  const std::string over = fmt::format("{}, {}, {:.2f} s", looked_at(report, level),
                                       ptc::bytes_text(report.file_bytes), seconds);
  if (report.sound()) return fmt::format("{}: valid at level {}: {}\n", name, level, over);
  const ptc::Finding& first = report.findings.front();
  if (is_foreign(report)) {
    return fmt::format(
        "ptcverify: {}: {} ({}){}\n", name, first.text, first.rule,
        ptc::is_build_input(name)
            ? ". Only containers can be checked; to build one of it: " + ptc::build_command(name)
            : "");
  }
  std::string faults = counted(report.damage, "fault");
  if (report.pages)
    faults += fmt::format(" in {} of {}", *report.damaged_pages, counted(*report.pages, "page"));
  return fmt::format("ptcverify: {}: damaged: {} at level {}: {}\n", name, faults, level,
                     first.cause == ptc::Cause::foreign
                         ? "its beginning is overwritten; keep the undamaged part with --salvage"
                         : hint_of(first));
}

/// The value as JSON; null when there is none.
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

/// A line on what a salvage kept: points, their share of area and energy, channels, texts.
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

/// Salvages the file and adds to the outcome what was kept, or why nothing can be kept.
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
    if (outcome.exit_code == ptc::kDone) outcome.exit_code = ptc::exit_code_of(error);
  }
}

/// Declares the options that choose what is checked. The variables must outlive the parsing.
void add_checks(CLI::App& app, int& level, bool& fail_fast) {
  constexpr char kGroup[] = "Checking";
  ptc::offer(
      app.add_option(
          "--level", level,
          "0 header, 1 directory, 2 checksums, 3 contents, 4 tree rebuilt\n"
          "Each level includes those below it. Level 0 checks the header, the superblocks and the "
          "length of the file; 1 the directory and the page headers; 2 the checksums of the "
          "payloads and the padding; 3 the contents of all pages, the tree against its points, and "
          "the totals; 4 builds the tree again and compares it."),
      {"0", "1", "2", "3", "4"})
      ->type_name("N")
      ->check(ptc::whole_in_range(0, 4))
      ->capture_default_str()
      ->group(kGroup);
  app.add_flag("--fail-fast", fail_fast, "Stop at the first fault")->group(kGroup);
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcverify", kPurpose, kExamples, kVerifyCodes);
  std::filesystem::path file, map, salvage;
  int level = 3;
  bool fail_fast = false;
  command.add_input("FILE", file, {".ptcx"}, "Container to check")->required();
  command
      .add_output("--salvage", salvage, {".ptcx"}, "Write the undamaged pages to a new container")
      ->required(false);
  command.add_output("--map", map, {".svg", ".png"}, "Draw where the damage lies (.svg or .png)")
      ->required(false);
  add_checks(command.app(), level, fail_fast);
  return command.run(argc, argv, [&](ptc::Progress& progress) -> ptc::Outcome {
    // Check the file.
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

    // Report the findings and the verdict.
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
    if (!is_foreign(report)) outcome.summary = findings_text(name, report);
    outcome.summary += verdict_text(name, report, level, seconds);

    // Keep what is whole.
    if (!salvage.empty()) add_salvage(file, salvage, run, progress, outcome);
    return outcome;
  });
}
