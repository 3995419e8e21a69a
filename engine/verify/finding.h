// What a verifier finds: where, which rule, and what may have done it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <optional>
#include <string>
#include <vector>

#include "format/error.h"

namespace ptc {

/// What a fault looks like it came from (spec/recovery.md#causes).
enum class Cause : std::uint8_t {
  unknown,     ///< bytes changed, and how cannot be told
  bit_flip,    ///< one bit changed
  zeroed,      ///< whole sectors are zero: a hole, as copies that lose blocks leave
  swapped,     ///< another page of the file lies here
  stale,       ///< a page of another file, or of an earlier version of this one
  unfinished,  ///< the writer never finished
  truncated,   ///< bytes are missing at the end
  appended,    ///< bytes follow the end
  text_mode,   ///< a transfer took the file for text
  unreadable,  ///< the system could not read it
  foreign,     ///< no file of this format
  newer,       ///< a version or feature that this program does not know
  writer,      ///< checksums are right and a rule is broken: so it was written
};

/// The name that --json prints, e.g. "bit-flip".
[[nodiscard]] const char* name_of(Cause cause) noexcept;
/// What happened, in words, e.g. "the end is missing"; empty where the name says it all.
[[nodiscard]] const char* explanation_of(Cause cause) noexcept;

/// What to do about damage; a program says it in words of its own.
enum class Remedy : std::uint8_t {
  replace,        ///< take a good copy, or salvage what is whole
  test_machines,  ///< test memory and disk that it went through, then as replace
  copy_again,     ///< copy it again, or salvage
  write_again,    ///< run its writer again, or salvage what that wrote
  transfer,       ///< transfer it again, or salvage
  transfer_bare,  ///< transfer it again, as binary
  cut,            ///< cut it to the length given, or salvage
  rescue,         ///< copy what can be read elsewhere, then salvage the copy
  other_file,     ///< none: it is another kind of file
  newer_program,  ///< read it with the program that wrote it, or a newer one of this
  report,         ///< write it again with another version of its writer, and report this
};
[[nodiscard]] Remedy remedy_of(Cause cause) noexcept;

enum class Severity : std::uint8_t {
  damage,   ///< the file is not sound
  warning,  ///< it is, but differs from what this program would have written
};

struct Finding {
  Severity severity = Severity::damage;
  Cause cause = Cause::unknown;
  int level = 0;                      ///< of the verification that finds it, 0 to 4
  std::uint64_t offset = 0;           ///< in the file
  std::uint64_t bytes = 0;            ///< that are at fault from there on; 0: not known
  unsigned bit = 0;                   ///< of that byte, for Cause::bit_flip
  std::optional<std::uint32_t> page;  ///< when it lies in one
  std::string rule;                   ///< anchor, e.g. "spec/container.md#page-payload"
  std::string text;
  std::string expected;  ///< empty where the text says it all
  std::string actual;

  [[nodiscard]] Remedy remedy() const noexcept { return remedy_of(cause); }
};

/// The finding that an error of the format amounts to; its cause is to be filled in.
[[nodiscard]] Finding finding_of(const FormatError& error, int level);
/// The stable code of a finding: what follows '#' in its rule.
[[nodiscard]] std::string code_of(const Finding& finding);
/// "offset 4096: TEXT (RULE); bit-flip".
[[nodiscard]] std::string line_of(const Finding& finding);
/// 16 hexadecimal digits.
[[nodiscard]] std::string hex(std::uint64_t value);

/// Thrown through a verification that was to stop at the first finding.
struct StopVerifying : std::exception {};

/// Findings in the order in which they were added; the first ones are kept, the rest counted.
/// Threads: one at a time.
class Findings {
 public:
  Findings(std::size_t keep, bool fail_fast) : keep_(keep), fail_fast_(fail_fast) {}

  /// @throws StopVerifying after the first damage when it was asked for
  void add(Finding finding);

  [[nodiscard]] const std::vector<Finding>& kept() const noexcept { return kept_; }
  [[nodiscard]] std::uint64_t damage() const noexcept { return damage_; }
  [[nodiscard]] std::uint64_t warnings() const noexcept { return warnings_; }

 private:
  std::size_t keep_;
  bool fail_fast_;
  std::vector<Finding> kept_;
  std::uint64_t damage_ = 0;
  std::uint64_t warnings_ = 0;
};

}  // namespace ptc
