// Findings of a verification: where a fault lies, which rule it breaks, and what may have caused
// it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <optional>
#include <string>
#include <vector>

#include "format/error.h"

namespace ptc {

/// The likely cause of a fault (spec/recovery.md#causes).
enum class Cause : std::uint8_t {
  unknown,     ///< bytes changed in a way that fits no other cause
  bit_flip,    ///< one bit changed
  zeroed,      ///< whole sectors are zero, as after a copy that lost blocks
  swapped,     ///< another page of this file lies in this place
  stale,       ///< a page of another file, or of an earlier version of this one, lies here
  unfinished,  ///< the writer stopped before it published the file
  truncated,   ///< bytes are missing at the end
  appended,    ///< bytes follow the end of the container
  text_mode,   ///< a transfer treated the file as text
  unreadable,  ///< the system could not read the bytes (EIO)
  foreign,     ///< the file is not of this format
  newer,       ///< the file has a version or a feature that this program does not know
  part,        ///< a part of the scene is missing, or is another file than the scene was made of
  writer,      ///< all checksums are right but a rule is broken: the file was written that way
};

/// Returns the stable name of a cause for machine-readable output, e.g. "bit-flip".
[[nodiscard]] const char* name_of(Cause cause) noexcept;
/// Returns in words what probably happened, e.g. "the end of the file is missing"; empty where the
/// text of the finding says it already.
[[nodiscard]] const char* explanation_of(Cause cause) noexcept;

/// What a user can do about damage. Each program puts it into its own words and options.
enum class Remedy : std::uint8_t {
  replace,        ///< use an undamaged copy, or salvage what is intact
  test_machines,  ///< test memory and disks of all machines on the way; then as Remedy::replace
  copy_again,     ///< copy the file again, or salvage what is intact
  write_again,    ///< run the program that wrote the file again, or salvage what it wrote
  transfer,       ///< transfer the file again, or salvage what is intact
  transfer_bare,  ///< transfer the file again, in binary mode
  cut,            ///< truncate the file to the length that the finding expects, or salvage
  copy_parts,     ///< copy the scene again with all of its parts
  rescue,         ///< copy the readable bytes to another disk, then salvage that copy
  other_file,     ///< nothing: the file is of another kind
  newer_program,  ///< read the file with the program that wrote it, or a newer version of this one
  report,         ///< write the file again with another version of its writer, and report the fault
};
/// Returns the remedy for faults of one cause.
[[nodiscard]] Remedy remedy_of(Cause cause) noexcept;

/// Whether a finding makes the file invalid.
enum class Severity : std::uint8_t {
  damage,   ///< the file is not sound
  warning,  ///< the file is sound but differs from what this program would have written
};

/// One fault of a file, as users and scripts see it.
struct Finding {
  Severity severity = Severity::damage;
  Cause cause = Cause::unknown;
  int level = 0;                      ///< lowest verification level that finds it, 0 to 4
  std::uint64_t offset = 0;           ///< file offset of the fault, bytes
  std::uint64_t bytes = 0;            ///< length of the faulty part from `offset` on; 0: not known
  unsigned bit = 0;                   ///< the flipped bit at `offset`, for Cause::bit_flip
  std::optional<std::uint32_t> page;  ///< the page that the fault lies in; empty outside pages
  std::string file;                   ///< a part of the file, by its path; empty: the file itself
  std::string rule;                   ///< anchor, e.g. "spec/container.md#page-payload"
  std::string text;                   ///< what is wrong, in words
  std::string expected;               ///< the right value; empty where the text says it
  std::string actual;                 ///< the value in the file; empty where the text says it

  /// Returns what a user can do about this fault.
  [[nodiscard]] Remedy remedy() const noexcept { return remedy_of(cause); }
};

/// Returns the finding that reports a format error. Its cause is Cause::unknown until the caller
/// sets it.
[[nodiscard]] Finding finding_of(const FormatError& error, int level);
/// Returns the stable code of a finding: the part of its rule that follows '#'.
[[nodiscard]] std::string code_of(const Finding& finding);
/// Returns a finding as one line of text, e.g. "offset 4096: TEXT (RULE); bit-flip".
[[nodiscard]] std::string line_of(const Finding& finding);
/// Returns a number as 16 hexadecimal digits.
[[nodiscard]] std::string hex(std::uint64_t value);

/// Unwinds a verification that has to stop at the first finding.
struct StopVerifying : std::exception {};

/// Collects findings in the order in which they are added; keeps the first ones and counts the
/// rest. Threads: not thread-safe.
class Findings {
 public:
  /// @param keep       findings that are kept; later ones are only counted
  /// @param fail_fast  stop the verification at the first damage
  Findings(std::size_t keep, bool fail_fast) : keep_(keep), fail_fast_(fail_fast) {}

  /// Adds a finding.
  /// @throws StopVerifying after the first damage when the constructor was given `fail_fast`
  void add(Finding finding);

  /// Returns a collection without findings, for a check whose findings may be appended later. It
  /// keeps as many as this one still does, and stops as this one does.
  [[nodiscard]] Findings next() const { return {keep_ - kept_.size(), fail_fast_}; }

  /// Appends the findings of a check that followed.
  /// @return  false, and appends nothing, when the other check did not keep some that this one
  /// keeps
  /// @throws StopVerifying as add() does
  [[nodiscard]] bool append(const Findings& others);

  /// Counts findings that another check found and did not keep.
  void count(std::uint64_t damage, std::uint64_t warnings) noexcept {
    damage_ += damage;
    warnings_ += warnings;
  }

  [[nodiscard]] const std::vector<Finding>& kept() const noexcept { return kept_; }
  /// Returns the number of findings of Severity::damage, including those not kept.
  [[nodiscard]] std::uint64_t damage() const noexcept { return damage_; }
  /// Returns the number of findings of Severity::warning, including those not kept.
  [[nodiscard]] std::uint64_t warnings() const noexcept { return warnings_; }

 private:
  std::size_t keep_;
  bool fail_fast_;
  std::vector<Finding> kept_;
  std::uint64_t damage_ = 0;
  std::uint64_t warnings_ = 0;
};

}  // namespace ptc
