// The texts of a progress report as pure functions of the counts, and a report to any file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "engine/base/progress.h"

namespace ptc {

/// Returns a count with three significant digits and a unit of K, M, G, T, P or E: "950", "12.3 M".
[[nodiscard]] std::string format_count(double count);

/// Returns a duration as "0:07", "12:34" or "1:02:03", or as "--:--" when it is not finite,
/// negative or 100 hours or more.
[[nodiscard]] std::string format_duration(double seconds);

/// The state of a stage at the moment of a report.
struct StageState {
  std::string stage;           ///< short name, e.g. "sort"
  std::string unit;            ///< plural noun, e.g. "points"
  std::uint64_t total = 0;     ///< units of work in the stage; 0 when that is not known
  std::uint64_t done = 0;      ///< units of work that are finished
  double elapsed_seconds = 0;  ///< since the stage began

  /// Returns the units finished per second so far; 0 before any time has passed.
  [[nodiscard]] double rate() const noexcept;
  /// Returns the seconds left at that rate; infinite when nothing is finished or the total is not
  /// known.
  [[nodiscard]] double seconds_left() const noexcept;
};

/// Returns a line like "sort: 45 %, 12.3 M of 27.1 M points, 4.10 M/s, 0:03 left".
[[nodiscard]] std::string progress_line(const StageState& state);
/// Returns a line like "sort [####......]  45 % 12.3 M of 27.1 M points, 4.10 M/s, 0:03 left". The
/// bar takes the columns that the words leave; a line of more than `columns` bytes is cut.
[[nodiscard]] std::string progress_bar(const StageState& state, std::size_t columns);
/// Returns the first line of a stage: "sort: 27.1 M points", or "read" when the total is not known.
[[nodiscard]] std::string progress_start(const StageState& state);
/// Returns a line like "sort: 27.1 M points in 6.6 s, 4.10 M/s", or "read: 0.1 s" for a stage that
/// counted nothing.
[[nodiscard]] std::string progress_summary(const StageState& state);

/// A clock that returns the seconds since some fixed moment and never goes back.
using Clock = std::function<double()>;

/// The form of a report.
enum class ReportStyle {
  lines,        ///< plain lines at the start and at the end of a stage, and every 10 s
  bar,          ///< a bar, which a summary of its stage replaces
  passing_bar,  ///< a bar, which is erased when its stage ends
};

/// Returns a report to the open file `fd`, which it does not own.
[[nodiscard]] std::unique_ptr<Progress> make_progress(int fd, ReportStyle style, Clock clock);

}  // namespace ptc
