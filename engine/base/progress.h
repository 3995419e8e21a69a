// Progress reports of long runs for the user who waits for them.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace ptc {

/// Receives the progress of a run, which consists of stages. The base class ignores it.
///
/// Threads: advance() may be called from any thread; all other calls come from one thread.
class Progress {
 public:
  virtual ~Progress() = default;
  /// Begins a stage and ends the one before it, if that has not ended.
  /// @param stage  a short name, e.g. "sort"
  /// @param total  units of work in the stage; 0 when that is not known
  /// @param unit   plural noun, e.g. "points"
  virtual void begin(const std::string& /*stage*/, std::uint64_t /*total*/,
                     const std::string& /*unit*/) {}
  /// Adds `count` finished units to the stage.
  virtual void advance(std::uint64_t /*count*/) {}
  /// Ends the stage; without a stage it does nothing.
  virtual void end() {}
  /// Reports something that the user should know, such as the disk space that the run needs or a
  /// missing texture. It ends the stage that is under way.
  /// @param text  one line, without its line end
  virtual void note(const std::string& /*text*/) {}
};

/// Returns a report to standard error. On a terminal it draws a bar with rate and time left, at
/// most 10 times a second. Otherwise it writes one plain line at the start and at the end of each
/// stage, and one every 10 s in between.
[[nodiscard]] std::unique_ptr<Progress> make_stderr_progress();

/// Returns a report to standard error that draws the bar of make_stderr_progress() on a terminal
/// and erases it when its stage ends, so that only notes stay. Without a terminal it writes only
/// notes, as make_stderr_notes() does.
[[nodiscard]] std::unique_ptr<Progress> make_stderr_bar();

/// Returns a report to standard error that writes only notes, each as a line that begins with the
/// name of the program.
[[nodiscard]] std::unique_ptr<Progress> make_stderr_notes();

}  // namespace ptc
