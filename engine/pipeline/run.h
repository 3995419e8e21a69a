// The resources that every long run is given, and the clock of its stages.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/progress.h"

namespace ptc {

/// The resources of a run. They decide how long it takes, not what it gives: the output is the
/// same, byte for byte, for every cap, number of threads and choice of directories. There is one
/// exception: meshes that do not fit under the cap are sampled from the disk in smaller patches,
/// lit by rays at the surfels (spec/shading.md#streamed-meshes), and seen by a camera as surfels.
struct RunOptions {
  /// Maximum of resident bytes, caches included. A run that cannot keep to it throws LimitError,
  /// whose text names the least cap that works.
  std::uint64_t memory_bytes = std::uint64_t{2} << 30;
  /// Number of threads; 0 means as many as the machine has cores.
  unsigned threads = 0;
  /// Directories over which temporary files are spread; when empty, the output's directory.
  std::vector<std::filesystem::path> temp_dirs;

  /// Lowers the cap by what a caller holds while another run works for it, to no less than a byte.
  void hold(std::uint64_t bytes) noexcept {
    memory_bytes = memory_bytes > bytes ? memory_bytes - bytes : 1;
  }
};

/// Wall time of each stage: name and seconds, in the order in which the stages ended.
using StageSeconds = std::vector<std::pair<std::string, double>>;

/// Times one stage and reports its progress, from construction to destruction.
class Stage {
 public:
  /// Starts the clock and announces the stage.
  /// @param seconds   gets a row when the stage ends; must outlive it
  /// @param progress  gets the beginning and the end of the stage; must outlive it
  /// @param name      what is done, e.g. "sort and build"; reports use it as a key
  /// @param total     number of units of work, 0 when it is not known
  /// @param unit      plural noun, e.g. "points"
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

/// Returns the directories for temporary files: RunOptions::temp_dirs or, when there are none, the
/// directory of the target.
[[nodiscard]] std::vector<std::filesystem::path> temp_dirs(const RunOptions& run,
                                                           const std::filesystem::path& target);

/// Returns the directory among temp_dirs() that has the most free bytes, for a temporary file that
/// cannot be spread over several of them.
[[nodiscard]] std::filesystem::path roomiest_temp_dir(const RunOptions& run,
                                                      const std::filesystem::path& target);

}  // namespace ptc
