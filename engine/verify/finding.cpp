// The table of causes, with their names, explanations and remedies, and the texts of findings.
#include "engine/verify/finding.h"

#include <array>
#include <utility>

#include <fmt/format.h>

namespace ptc {
namespace {

/// What is said about one cause. The explanation stands in front of the remedy: "EXPLANATION:
/// REMEDY".
struct CauseText {
  const char* name;
  const char* explanation;
  Remedy remedy;
};

constexpr std::array kCauses{
    // in the order of Cause
    CauseText{"unknown", "", Remedy::replace},
    CauseText{"bit-flip", "", Remedy::test_machines},
    CauseText{"zeroed", "blocks were lost in a copy or by the disk", Remedy::copy_again},
    CauseText{"swapped", "blocks were written to the wrong place", Remedy::copy_again},
    CauseText{"stale", "blocks come from an older version of this file or from another file",
              Remedy::copy_again},
    CauseText{"unfinished", "the program that wrote the file was stopped before it finished",
              Remedy::write_again},
    CauseText{"truncated", "the end of the file is missing", Remedy::transfer},
    CauseText{"appended", "", Remedy::cut},
    CauseText{"text-mode", "", Remedy::transfer_bare},
    CauseText{"unreadable", "the disk cannot read its blocks", Remedy::rescue},
    CauseText{"foreign", "", Remedy::other_file},
    CauseText{"newer", "", Remedy::newer_program},
    CauseText{"part", "the scene was copied without this part, or the part was replaced",
              Remedy::copy_parts},
    CauseText{"writer", "the program that wrote the file made this error", Remedy::report},
};
static_assert(kCauses.size() == static_cast<std::size_t>(Cause::writer) + 1);

const CauseText& text_of(Cause cause) noexcept {
  return kCauses[static_cast<std::size_t>(cause)];
}

}  // namespace

const char* name_of(Cause cause) noexcept {
  return text_of(cause).name;
}

const char* explanation_of(Cause cause) noexcept {
  return text_of(cause).explanation;
}

Remedy remedy_of(Cause cause) noexcept {
  return text_of(cause).remedy;
}

Finding finding_of(const FormatError& error, int level) {
  const std::string page = error.page() ? fmt::format("page {}: ", *error.page()) : "";
  return {.level = level,
          .offset = error.offset(),
          .page = error.page(),
          .rule = error.clause(),
          .text = page + error.text()};
}

std::string code_of(const Finding& finding) {
  return finding.rule.substr(finding.rule.find('#') + 1);
}

std::string line_of(const Finding& finding) {
  const std::string cause =
      finding.cause == Cause::unknown ? "" : fmt::format("; {}", name_of(finding.cause));
  const std::string file = finding.file.empty() ? "" : finding.file + ": ";
  return fmt::format("{}offset {}: {} ({}){}", file, finding.offset, finding.text, finding.rule,
                     cause);
}

std::string hex(std::uint64_t value) {
  return fmt::format("{:016x}", value);
}

void Findings::add(Finding finding) {
  const bool damage = finding.severity == Severity::damage;
  ++(damage ? damage_ : warnings_);
  if (kept_.size() < keep_) kept_.push_back(std::move(finding));
  if (damage && fail_fast_) throw StopVerifying();
}

bool Findings::append(const Findings& others) {
  const std::uint64_t all = others.damage_ + others.warnings_, kept = others.kept_.size();
  if (kept < all && kept < keep_ - kept_.size()) return false;
  const std::uint64_t damage = damage_ + others.damage_, warnings = warnings_ + others.warnings_;
  for (const Finding& finding : others.kept_) add(finding);
  damage_ = damage;
  warnings_ = warnings;
  return true;
}

}  // namespace ptc
