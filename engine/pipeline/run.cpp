#include "engine/pipeline/run.h"

#include <new>

#include "engine/io/file/disk_space.h"
#include "engine/io/file/file.h"

namespace ptc {

Stage::Stage(StageSeconds& seconds, Progress& progress, std::string name, std::uint64_t total,
             const char* unit)
    : seconds_(seconds), progress_(progress), name_(std::move(name)) {
  seconds_.reserve(seconds_.size() + 1);  // the destructor must not allocate
  progress_.begin(name_, total, unit);
}

// The destructor may run while std::bad_alloc unwinds the stack: a progress report that needs
// memory is left out then, because a second exception would end the program.
Stage::~Stage() {
  try {
    progress_.end();
  } catch (const std::bad_alloc&) {
  }
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start_;
  seconds_.emplace_back(std::move(name_), passed.count());
}

std::vector<std::filesystem::path> temp_dirs(const RunOptions& run,
                                             const std::filesystem::path& target) {
  if (!run.temp_dirs.empty()) return run.temp_dirs;
  return {directory_of(target)};
}

std::filesystem::path roomiest_temp_dir(const RunOptions& run,
                                        const std::filesystem::path& target) {
  return roomiest(temp_dirs(run, target));
}

}  // namespace ptc
