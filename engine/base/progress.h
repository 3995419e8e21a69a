// What a long run tells the one who waits for it.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace ptc {

/// Receives progress; the base class is silent. advance() may be called from any thread, begin()
/// and end() from one.
class Progress {
 public:
  virtual ~Progress() = default;
  /// @param total  0 when it is not known
  /// @param unit   plural noun, e.g. "points"
  virtual void begin(const std::string& /*stage*/, std::uint64_t /*total*/,
                     const std::string& /*unit*/) {}
  virtual void advance(std::uint64_t /*count*/) {}
  virtual void end() {}
  /// Something to know, e.g. the room that long work takes or a texture that is missing. A stage
  /// that is under way ends.
  virtual void note(const std::string& /*text*/) {}
};

/// On a terminal a bar with rate and time left, redrawn at most 10 times a second; otherwise one
/// plain line at the start and end of a stage and every 10 s between.
[[nodiscard]] std::unique_ptr<Progress> make_stderr_progress();

/// Nothing but notes, a line each that begins with the program's name.
[[nodiscard]] std::unique_ptr<Progress> make_stderr_notes();

}  // namespace ptc
