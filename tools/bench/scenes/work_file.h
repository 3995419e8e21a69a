// Names of files, and directories, that an experiment needs while it runs.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <string>
#include <system_error>

#include "engine/io/file/file.h"

namespace ptc::bench {

/// A hidden name in a directory that no other process takes. Its file is deleted when this object
/// ends, or when a signal ends the process.
class WorkFile {
 public:
  /// @param ending  of the name; distinguishes several files of one process
  WorkFile(const std::filesystem::path& directory, const std::string& ending)
      : path_(directory / (".ptcbench-" + std::to_string(::getpid()) + ending)), name_(path_) {}
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
  TemporaryName name_;
};

/// A directory of temporary files, which is deleted with all that is in it when this object ends.
class WorkDirectory {
 public:
  explicit WorkDirectory(const std::filesystem::path& path) : path_(path) {
    std::filesystem::create_directories(path_);
  }
  ~WorkDirectory() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  WorkDirectory(const WorkDirectory&) = delete;
  WorkDirectory& operator=(const WorkDirectory&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  /// Deletes all that is in it.
  void clear() const {
    for (const auto& entry : std::filesystem::directory_iterator(path_))
      std::filesystem::remove_all(entry.path());
  }

 private:
  std::filesystem::path path_;
};

}  // namespace ptc::bench
