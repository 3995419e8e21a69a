// Which failures of a task are worth another try: one rule for this machine and for schedulers.
#pragma once

#include <csignal>
#include <string>

#include <fmt/format.h>

#include "tools/common.h"

namespace ptc {

/// How often a task is run again.
inline constexpr unsigned kMaxRetries = 2;

/// The exit code of a shell for a process that signal n has ended is this plus n.
inline constexpr int kSignalCode = 128;

/// Says whether a failed task may succeed when it is run again: when the system refused, as for a
/// full disk or for lack of memory, and when a signal has ended it, but for SIGHUP, SIGINT, SIGQUIT
/// and SIGTERM, by which somebody ends it on purpose. Bad input, usage errors, caps that are too
/// small and defects come again.
/// @param code  as a shell has it
[[nodiscard]] constexpr bool worth_retry(int code) noexcept {
  for (const int wish : {SIGHUP, SIGINT, SIGQUIT, SIGTERM}) {
    if (code == kSignalCode + wish) return false;
  }
  return code == kSystem || code > kSignalCode;
}

/// Returns worth_retry() as a condition of a shell. @param code  variable that has the exit code
[[nodiscard]] inline std::string shell_worth_retry(const std::string& code) {
  std::string never;
  for (int i = 0; i < 256; ++i) {
    const bool as_the_rest = i == kSystem || i > kSignalCode;
    if (worth_retry(i) != as_the_rest) never += fmt::format("{}{}", never.empty() ? "" : "|", i);
  }
  return fmt::format("case ${0} in {3}) false ;; *) [ ${0} -eq {1} ] || [ ${0} -gt {2} ] ;; esac",
                     code, static_cast<int>(kSystem), kSignalCode, never);
}

}  // namespace ptc
