// Which failures of a task are worth another try: one rule for this machine and for schedulers.
#pragma once

#include <string>

#include <fmt/format.h>

#include "tools/common.h"

namespace ptc {

/// How often a task is run again.
inline constexpr unsigned kMaxRetries = 2;

/// The exit code of a shell for a process that signal n has ended is this plus n.
inline constexpr int kSignalCode = 128;

/// Says whether a failed task may succeed when it is run again: when the system refused, as for a
/// full disk or for lack of memory, and when a signal has ended it. Bad input, usage errors, caps
/// that are too small and defects come again.
/// @param code  as a shell has it
[[nodiscard]] constexpr bool worth_retry(int code) noexcept {
  return code == kSystem || code > kSignalCode;
}

/// Returns worth_retry() as a condition of a shell. @param code  variable that has the exit code
[[nodiscard]] inline std::string shell_worth_retry(const std::string& code) {
  return fmt::format("[ \"${0}\" -eq {1} ] || [ \"${0}\" -gt {2} ]", code,
                     static_cast<int>(kSystem), kSignalCode);
}

}  // namespace ptc
