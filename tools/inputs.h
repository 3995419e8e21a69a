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
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "engine/io/file/file.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/pipeline/run.h"
#include "tools/common.h"

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
  /// Makes the messages of a program say "standard input" for its temporary copy.
  void name_in(Command& command) const;

 private:
  void add(const std::filesystem::path& path);
  void add_directory(const std::filesystem::path& directory);
  void add_matches(const std::filesystem::path& pattern);
  void add_list(const std::filesystem::path& list);
  void add_standard_input(const std::string& format, const std::filesystem::path& directory);

  std::vector<std::filesystem::path> paths_;
  std::string names_;
  std::filesystem::path copy_;  ///< of standard input; empty: it is no input
  std::vector<std::unique_ptr<TemporaryName>> temporary_;
};

/// Says whether a file is a mesh or a cloud that ptcbuild takes: by its ending, or by its bytes.
/// @throws std::system_error when it cannot be read
[[nodiscard]] bool is_build_input(const std::filesystem::path& path);

/// Returns the command that builds a container of a file: "ptcbuild scan.laz -o scan.ptcx".
[[nodiscard]] std::string build_command(const std::filesystem::path& input);

/// Declares --format, the format of standard input.
void add_format(CLI::App& app, std::string& format);

/// The scene of a program that lights one: its arguments SCENE, --format, --points and --up.
class SceneArguments {
 public:
  /// Declares the arguments. This object must outlive the parsing.
  /// @param description  of SCENE, in a line
  void declare(Command& command, const std::string& description);
  /// Sets the scene of a request: the files, their names, and how a container is built of them.
  /// Temporary files exist as long as this object.
  /// @param request   its RunOptions are set already
  /// @param output    as for InputFiles, which says what is thrown
  /// @param progress  gets notes about options that the files leave without effect
  void apply(LightingRequest& request, const std::filesystem::path& output, Progress& progress);
  /// The files of the scene, as they were given.
  [[nodiscard]] const std::vector<std::filesystem::path>& names() const noexcept { return names_; }

 private:
  std::vector<std::filesystem::path> names_;
  std::string format_;
  std::uint64_t points_ = SamplingOptions{}.count;
  std::string up_;
  Command* command_ = nullptr;
  std::optional<InputFiles> files_;
};

}  // namespace ptc
