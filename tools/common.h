// What every program shares: common options, checks of files, exit codes, output, and the texts
// that the build asks each program for: man pages and completions of shells.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "engine/base/progress.h"
#include "engine/ptc.h"
#include "format/error.h"
#include "tools/man_page.h"

namespace ptc {

/// The meaning of a program's exit code (spec/errors.md#exit-codes).
enum ExitCode : int {
  kDone = 0,
  kInvalidData = 1,  ///< an input is missing, damaged or not what it should be; data differ
  kUsage = 2,        ///< the command line asks for something impossible
  kSystem = 3,       ///< the system refused: a full disk, no memory
  kUnsupported = 4,  ///< a version or feature of the format that this program does not know
  kLimit = 5,        ///< a cap that the user set is too small
  kUnfinished = 6,   ///< ptcverify: the file is unfinished or truncated
  kInternal = 7,     ///< a defect of the program: a precondition of the engine was broken
};
/// Returns kUnsupported for a version or feature that this program lacks, kInvalidData for damage.
[[nodiscard]] ExitCode exit_code_of(const FormatError& error);

/// The result of a program.
struct Outcome {
  nlohmann::ordered_json facts;  ///< for machines, printed with --json
  std::string summary;           ///< for people, printed otherwise; lines end with '\n'
  /// With any other code than kDone the summary goes to standard error, also with --json or
  /// --quiet.
  ExitCode exit_code = kDone;
  /// With --json these are printed before the facts, one line each; the facts then take one line,
  /// too.
  std::optional<std::vector<nlohmann::ordered_json>> lines = std::nullopt;
};

/// The exit codes for the man page: a line each, "CODE NAME: meaning".
inline constexpr char kExitCodes[] =
    "0 done: the program did what was asked\n"
    "1 data invalid or different: an input is missing, damaged or not what it should be\n"
    "2 usage: the command line asks for something impossible\n"
    "3 system: the system refused, for example because the disk is full\n"
    "4 format not supported: the file needs a newer version of the program\n"
    "5 limit too small: a cap such as --memory is too small; the message names the smallest that "
    "works\n"
    "7 internal error: the program has a defect; please report the message";

/// A command line program: declare options on app(), then run().
///
/// run() adds the common options --memory, --threads, --temp, --progress, --quiet, --json,
/// --version and --help, and one that --help does not show: "--generate man|bash|zsh|fish" prints
/// the program's man page, or its completion for a shell.
class Command {
 public:
  /// @param purpose     first line: a sentence on what the program does, "Builds ..."; further
  ///                    lines: paragraphs for the man page, with empty lines between them
  /// @param examples    lines of the form "  COMMAND LINE", each of which may have a line
  ///                    "  # Comment" before it; they end --help
  /// @param exit_codes  lines as in kExitCodes: they replace its lines of the same code, or are
  ///                    added to them
  Command(const std::string& name, const std::string& purpose, const std::string& examples,
          const std::string& exit_codes = "");

  [[nodiscard]] CLI::App& app() noexcept { return app_; }
  /// The values of --memory, --threads and --temp, which are known once the body runs.
  [[nodiscard]] const RunOptions& run_options() const noexcept { return run_options_; }

  /// Makes messages call a file by another name: the temporary copy of standard input, for example.
  void show_as(const std::filesystem::path& path, std::string name);

  /// Declares a file that is read. It is opened before the body runs: a file that cannot be opened
  /// or is empty is invalid data.
  /// @param name     as CLI11 takes it: "SCENE" is positional, "--mesh" is an option
  /// @param endings  endings that shells propose, such as ".ply"; others are taken, too
  CLI::Option* add_input(const std::string& name, std::filesystem::path& path,
                         const std::vector<std::string>& endings, const std::string& description);
  /// Declares files that are read, checked as by add_input(). An option takes one path each time
  /// that it is given.
  CLI::Option* add_inputs(const std::string& name, std::vector<std::filesystem::path>& paths,
                          const std::vector<std::string>& endings, const std::string& description);
  /// Declares a file that is written. It is required until required(false) is called on it. Its
  /// directory must exist when the body runs.
  /// @param name     "-o,--output" for an option, or positional
  /// @param endings  endings that are allowed, such as ".exr"; any other is a usage error
  CLI::Option* add_output(const std::string& name, std::filesystem::path& path,
                          const std::vector<std::string>& endings, const std::string& description);
  /// Declares files that are written, at least one of them. The option takes one path each time
  /// that it is given.
  CLI::Option* add_outputs(const std::string& name, std::vector<std::filesystem::path>& paths,
                           const std::vector<std::string>& endings, const std::string& description);

  /// Parses the command line, calls the body with the progress that was asked for, prints its
  /// outcome, and turns every exception into a message on standard error.
  /// @return the exit code
  [[nodiscard]] int run(int argc, char** argv, const std::function<Outcome(Progress&)>& body);

 private:
  void add_common_options();
  /// The text that --generate prints.
  [[nodiscard]] std::string generated(const std::string& kind) const;
  /// A message with the names of show_as().
  [[nodiscard]] std::string renamed(std::string text) const;
  void check_files() const;
  /// Returns false when nothing is left to do: after --help, --version and usage errors.
  [[nodiscard]] bool parse(int argc, char** argv, int& exit_code);
  [[nodiscard]] int perform(const std::function<Outcome(Progress&)>& body) const;
  [[nodiscard]] int report(const CLI::ParseError& error) const;

  CLI::App app_;
  ManText man_text_;
  RunOptions run_options_;
  bool progress_ = false;
  bool quiet_ = false;
  bool json_ = false;
  std::vector<std::pair<std::filesystem::path, std::string>> shown_names_;
  using Paths = std::vector<std::filesystem::path>;
  std::vector<const std::filesystem::path*> inputs_;
  std::vector<const Paths*> input_lists_;
  std::vector<const std::filesystem::path*> outputs_;
  std::vector<const Paths*> output_lists_;
};

/// Refuses a file that cannot be opened or is empty.
/// @throws DataError when the file is at fault; std::system_error when the system is: it has no
///         memory or descriptors left, or the disk does not answer
void check_input(const std::filesystem::path& path);

/// True when the name of a file ends in `ending`, in upper or lower case, and is longer.
[[nodiscard]] bool has_ending(const std::filesystem::path& path, const std::string& ending);

}  // namespace ptc
