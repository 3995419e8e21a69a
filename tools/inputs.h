// The inputs of a command line: files, directories of tiles, patterns, lists and standard input.
//
//   scan.laz           the file
//   tiles/             all meshes and clouds in the directory, by name
//   'tiles/*_3.laz'    files whose names match, by name; for shells that do not expand it
//   @tiles.txt         the files that a text names, one on each line
//   -                  standard input, which is kept in a temporary file
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "engine/io/file/file.h"
#include "engine/pipeline/run.h"

namespace ptc {

/// The files that arguments stand for. Temporary ones are removed with this object.
class InputFiles {
 public:
  /// @param arguments  as they were given; every file that they stand for is checked by
  ///                   check_input()
  /// @param format     ending of standard input, such as "las"; empty: its bytes tell
  /// @param run        where temporary files go
  /// @param output     next to which they go when `run` names no directory
  /// @throws DataError when a file is missing or empty, or nothing matches; std::system_error
  InputFiles(const std::vector<std::filesystem::path>& arguments, const std::string& format,
             const RunOptions& run, const std::filesystem::path& output);

  [[nodiscard]] const std::vector<std::filesystem::path>& paths() const noexcept { return paths_; }
  /// The names of the files for a record, separated by spaces; standard input is "stdin".
  [[nodiscard]] const std::string& names() const noexcept { return names_; }

 private:
  void add(const std::filesystem::path& path);
  void add_directory(const std::filesystem::path& directory);
  void add_matches(const std::filesystem::path& pattern);
  void add_list(const std::filesystem::path& list);
  void add_standard_input(const std::string& format, const std::filesystem::path& directory);

  std::vector<std::filesystem::path> paths_;
  std::string names_;
  std::vector<std::unique_ptr<TemporaryName>> temporary_;
};

}  // namespace ptc
