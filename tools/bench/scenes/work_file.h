// Names of files that an experiment needs while it runs.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <string>

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

}  // namespace ptc::bench
