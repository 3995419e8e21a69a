// Files that an experiment needs while it runs.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <string>

#include "engine/io/file/file.h"

namespace ptc::bench {

/// A name in a directory that no other process takes. Its file goes when this ends, or when a
/// signal ends the process.
class WorkFile {
 public:
  WorkFile(const std::filesystem::path& directory, const std::string& ending)
      : path_(directory / (".ptcbench-" + std::to_string(::getpid()) + ending)), name_(path_) {}
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
  TemporaryName name_;
};

}  // namespace ptc::bench
