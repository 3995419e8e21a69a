// Names and hints of causes (engine/verify/finding.h).
#include "engine/verify/finding.h"

#include <array>
#include <utility>

#include <fmt/format.h>

namespace ptc {
namespace {

struct CauseText {
  const char* name;
  const char* hint;
};

constexpr char kCopyOrSalvage[] =
    "take a good copy of the file, or keep what is whole with --salvage";

constexpr std::array kCauses{
    CauseText{"unknown", kCopyOrSalvage},
    CauseText{
        "bit-flip",
        "test memory and disk of the machines it went through; take a good copy, or use --salvage"},
    CauseText{"zeroed",
              "blocks were lost in a copy or by the disk: copy the file again, or use --salvage"},
    CauseText{"swapped",
              "blocks were written to the wrong place: copy the file again, or use --salvage"},
    CauseText{"stale", "blocks of an older or other file: copy the file again, or use --salvage"},
    CauseText{"unfinished",
              "its writer was stopped: run it again, or keep what it wrote with --salvage"},
    CauseText{"truncated", "the end is missing: transfer the file again, or use --salvage"},
    CauseText{"appended", "cut the file to the length given, or use --salvage"},
    CauseText{"text-mode", "transfer the file again, as binary"},
    CauseText{"unreadable",
              "the disk fails: copy what can be read elsewhere, then use --salvage on the copy"},
    CauseText{"foreign", "this is another kind of file"},
    CauseText{"newer", "use the program that wrote it, or a newer one of this"},
    CauseText{
        "writer",
        "the file is as its writer made it: write it again with another version, and report this"},
};

}  // namespace

const char* name_of(Cause cause) noexcept {
  return kCauses[static_cast<std::size_t>(cause)].name;
}

const char* hint_of(Cause cause) noexcept {
  return kCauses[static_cast<std::size_t>(cause)].hint;
}

Finding finding_of(const FormatError& error, int level) {
  return {.level = level, .offset = error.offset(), .rule = error.clause(), .text = error.text()};
}

std::string code_of(const Finding& finding) {
  return finding.rule.substr(finding.rule.find('#') + 1);
}

std::string line_of(const Finding& finding) {
  const std::string cause =
      finding.cause == Cause::unknown ? "" : fmt::format("; {}", name_of(finding.cause));
  return fmt::format("offset {}: {} ({}){}", finding.offset, finding.text, finding.rule, cause);
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

}  // namespace ptc
