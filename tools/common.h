// What every program shares: the common options, the way from errors to exit codes, the result.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "engine/base/progress.h"
#include "engine/ptc.h"

namespace ptc {

/// What a program's exit code says (spec/errors.md#exit-codes).
enum ExitCode : int {
  kDone = 0,
  kInvalidData = 1,  ///< an input is missing, damaged or not what it should be; data differ
  kUsage = 2,        ///< the command line asks for what cannot be
  kSystem = 3,       ///< the machine refused: disk full, no memory
  kUnsupported = 4,  ///< a version or feature of the format that this program does not know
  kLimit = 5,        ///< a cap that the user set is too small
  kUnfinished = 6,   ///< ptcverify: the file is unfinished or truncated
  kInternal = 7,     ///< a defect of the program: a precondition of the engine was broken
};

/// What a program tells when it is done.
struct Outcome {
  nlohmann::ordered_json facts;  ///< for machines, printed with --json
  std::string summary;           ///< for people, printed otherwise; lines end with '\n'
  ExitCode exit_code =
      kDone;  ///< any other: the summary goes to standard error, whatever was asked for
  /// Printed with --json, a line each, before the facts, which then take one line too.
  std::optional<std::vector<nlohmann::ordered_json>> lines = std::nullopt;
};

/// What the exit codes mean, for --help.
inline constexpr char kExitCodes[] =
    "0 done, 1 data invalid or different, 2 usage, 3 system, 4 format not supported,\n"
    "5 limit too small, 7 internal error.";

/// A command line program: declare options on app(), then run().
class Command {
 public:
  /// @param examples  lines of the form "  COMMAND LINE", shown at the end of --help
  Command(const std::string& name, const std::string& purpose, const std::string& examples,
          const std::string& exit_codes = kExitCodes);

  [[nodiscard]] CLI::App& app() noexcept { return app_; }
  /// --memory, --threads and --temp, once the body runs.
  [[nodiscard]] const RunOptions& run_options() const noexcept { return run_options_; }

  /// Declares a file that is read: it is opened before the body runs, and a file that cannot be is
  /// bad data. `name` as CLI11 takes it: "scene" is positional, "--mesh" an option.
  CLI::Option* add_input(const std::string& name, std::filesystem::path& path,
                         const std::string& description);
  /// The same, any number of times; an option takes one path each time.
  CLI::Option* add_inputs(const std::string& name, std::vector<std::filesystem::path>& paths,
                          const std::string& description);
  /// Declares what is written, "-o,--output" or positional, required unless that is taken back. Its
  /// directory must exist when the body runs.
  /// @param endings  those allowed, e.g. ".exr"; what belongs to none is a usage error
  CLI::Option* add_output(const std::string& name, std::filesystem::path& path,
                          const std::vector<std::string>& endings, const std::string& description);
  /// The same, any number of times but at least once.
  CLI::Option* add_outputs(const std::string& name, std::vector<std::filesystem::path>& paths,
                           const std::vector<std::string>& endings, const std::string& description);

  /// Parses, calls the body with the progress that was asked for, prints its outcome, and turns
  /// whatever is thrown into a message on stderr and an exit code.
  [[nodiscard]] int run(int argc, char** argv, const std::function<Outcome(Progress&)>& body);

 private:
  void add_common_options();
  void check_files() const;
  /// False when there is nothing left to do: help, version, usage errors.
  [[nodiscard]] bool parse(int argc, char** argv, int& exit_code);
  [[nodiscard]] int perform(const std::function<Outcome(Progress&)>& body) const;
  [[nodiscard]] int report(const CLI::ParseError& error) const;

  CLI::App app_;
  RunOptions run_options_;
  bool progress_ = false;
  bool quiet_ = false;
  bool json_ = false;
  using Paths = std::vector<std::filesystem::path>;
  std::vector<const std::filesystem::path*> inputs_;
  std::vector<const Paths*> input_lists_;
  std::vector<const std::filesystem::path*> outputs_;
  std::vector<const Paths*> output_lists_;
};

/// Refuses a file that cannot be opened or is empty. Whatever keeps it from being opened is the
/// file's fault, unless the machine is out of means.
/// @throws DataError, std::system_error
void check_input(const std::filesystem::path& path);

/// True when the name ends so, in upper or lower case.
[[nodiscard]] bool has_ending(const std::filesystem::path& path, const std::string& ending);

}  // namespace ptc
