// The words of a progress report: pure functions of what was counted, and a report to any file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "engine/base/progress.h"

namespace ptc {

/// Three significant digits with K, M, G, T, P or E behind: "950", "12.3 M".
[[nodiscard]] std::string format_count(double count);

/// "0:07", "12:34", "1:02:03"; "--:--" when it is not finite, negative or beyond 100 hours.
[[nodiscard]] std::string format_duration(double seconds);

/// How far a stage has come.
struct StageState {
  std::string stage;
  std::string unit;         ///< plural noun
  std::uint64_t total = 0;  ///< 0 when it is not known
  std::uint64_t done = 0;
  double elapsed_seconds = 0;

  /// Units a second so far; 0 before any time has passed.
  [[nodiscard]] double rate() const noexcept;
  /// Seconds left at that rate; infinite when nothing was done or the total is not known.
  [[nodiscard]] double seconds_left() const noexcept;
};

/// "sort: 45 %, 12.3 M of 27.1 M points, 4.10 M/s, 0:03 left"
[[nodiscard]] std::string progress_line(const StageState& state);
/// "sort [####......]  45 % 12.3 M of 27.1 M points, 4.10 M/s, 0:03 left": the bar takes what is
/// left of `columns`; a line that is too long is cut.
[[nodiscard]] std::string progress_bar(const StageState& state, std::size_t columns);
/// "sort: 27.1 M points in 6.6 s, 4.10 M/s"
[[nodiscard]] std::string progress_summary(const StageState& state);

/// Seconds from some fixed moment, never falling.
using Clock = std::function<double()>;

/// What make_stderr_progress() gives, to the open file `fd`, which it does not own.
/// @param terminal  whether to draw a bar
[[nodiscard]] std::unique_ptr<Progress> make_progress(int fd, bool terminal, Clock clock);

}  // namespace ptc
