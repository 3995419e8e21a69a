// What every long run is given, and the clock of its stages.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/progress.h"

namespace ptc {

/// Resources of a run. None of them changes a result.
struct RunOptions {
  /// Cap on resident bytes, caches included.
  std::uint64_t memory_bytes = std::uint64_t{2} << 30;
  /// Number of threads; 0 means as many as the machine has cores.
  unsigned threads = 0;
  /// Temporary files are spread over these directories; the output's directory when there are none.
  std::vector<std::filesystem::path> temp_dirs;
};

/// Seconds of wall time by stage, in the order in which the stages ran.
using StageSeconds = std::vector<std::pair<std::string, double>>;

/// Times one stage and reports its progress, from construction to destruction.
class Stage {
 public:
  /// @param seconds  gets a row when the stage ends; must outlive it
  /// @param total    number of units of work, 0 when it is not known
  /// @param unit     plural noun, e.g. "points"
  Stage(StageSeconds& seconds, Progress& progress, std::string name, std::uint64_t total,
        const char* unit);
  ~Stage();
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

 private:
  StageSeconds& seconds_;
  Progress& progress_;
  std::string name_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Directories for temporary files: those of the run, else the target's own.
[[nodiscard]] std::vector<std::filesystem::path> temp_dirs(const RunOptions& run,
                                                           const std::filesystem::path& target);

/// The directory among temp_dirs() with the most free bytes, for a file that lies in one piece.
[[nodiscard]] std::filesystem::path roomiest_temp_dir(const RunOptions& run,
                                                      const std::filesystem::path& target);

}  // namespace ptc
