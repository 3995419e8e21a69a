// Parsing, checks of files, errors and output of all programs:
//
//   run(): common options -> parse -> check files -> body -> print facts or summary -> exit code
//                              |           |          |
//                              +-----------+----------+--> exception -> message -> exit code
#include "tools/common.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <memory>
#include <new>
#include <numeric>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/io/file/file.h"
#include "engine/io/file/url.h"
#include "format/error.h"
#include "format/text.h"
#include "tools/completion.h"
#include "tools/field_names.h"
#include "tools/help.h"
#include "tools/option_text.h"
#include "tools/values.h"

namespace ptc {
namespace {

/// Refuses an output that cannot be written, before long work begins.
/// @throws std::system_error
void check_output(const std::filesystem::path& path) {
  const auto refuse = [&](std::errc code) {
    throw std::system_error(std::make_error_code(code), "open " + path.string());
  };
  if (is_url(path)) refuse(std::errc::read_only_file_system);
  const std::filesystem::path parent = path.parent_path();
  if (!parent.empty() && !std::filesystem::exists(parent)) {
    refuse(std::errc::no_such_file_or_directory);
  }
  if (!parent.empty() && !std::filesystem::is_directory(parent)) refuse(std::errc::not_a_directory);
  if (path.filename().empty() || std::filesystem::is_directory(path)) {
    refuse(std::errc::is_a_directory);
  }
}

/// Writes to standard output.
/// @throws std::system_error when it does not take the text, for example on a full disk
void print(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0) {
    throw std::system_error(errno, std::generic_category(), "write to standard output");
  }
}

/// Checks that a name ends in one of `endings`.
std::function<std::string(const std::string&)> ends_in(const std::vector<std::string>& endings) {
  return [endings](const std::string& name) {
    const auto fits = [&](const std::string& ending) { return has_ending(name, ending); };
    if (std::ranges::any_of(endings, fits)) return std::string();
    std::string text = "the name '" + name + "' must end in ";
    for (const std::string& ending : endings) {
      text += ending == endings.front() ? ending : " or " + ending;
    }
    return text;
  };
}

/// Returns the number of letters to insert, remove or replace to turn `a` into `b` (Levenshtein
/// 1966), row by row of the table of the distances between their beginnings.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = std::exchange(row[j + 1], std::min({row[j], row[j + 1], diagonal}) + 1);
      row[j + 1] = std::min(row[j + 1], replaced);
    }
  }
  return row.back();
}

/// Returns the long option that `typed` was probably meant to be: the one with the fewest letters
/// that differ, at most 2. Empty when there is none.
std::string nearest_option(const CLI::App& app, const std::string& typed) {
  std::size_t fewest = 3;
  std::string nearest;
  for (const OptionGroup& group : groups_of(app)) {
    for (const OptionText& option : group.options) {
      for (const std::string& name : option.names) {
        const std::size_t distance = edit_distance(typed, name);
        if (!name.starts_with("--") || distance >= fewest) continue;
        fewest = distance;
        nearest = name;
      }
    }
  }
  return nearest;
}

/// Says which option is unknown, or which argument is one too many.
std::string message_of_extras(const CLI::App& root) {
  const std::vector<CLI::App*> commands = root.get_subcommands();
  const CLI::App& app = commands.empty() ? root : *commands.front();
  std::vector<std::string> extras = root.remaining(true);
  std::erase(extras, "--");
  const std::string first = extras.empty() ? "" : extras.front();
  if (first.size() > 1 && first.starts_with('-')) {
    const std::string typed = first.substr(0, first.find('='));
    const std::string nearest = nearest_option(app, typed);
    return "unknown option: " + typed + (nearest.empty() ? "" : "; did you mean " + nearest + "?");
  }
  std::vector<std::string> taken;
  for (const OptionGroup& group : groups_of(app)) {
    for (const OptionText& option : group.options) {
      if (option.positional()) taken.push_back("one " + option.value);
    }
  }
  return "takes " + (taken.empty() ? "options alone" : join(taken, " and ")) + ", so '" + first +
         "' is one argument too many";
}

/// A usage error in the words of the help, where CLI11 has words of its own.
std::string message_of(const CLI::App& app, const CLI::ParseError& error) {
  const std::string text = error.what();
  const auto replaced = [](std::string message, std::string_view words, std::string_view by) {
    const std::size_t at = message.find(words);
    return at == message.npos ? message : message.replace(at, words.size(), by);
  };
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr) {
    return message_of_extras(app);
  }
  if (dynamic_cast<const CLI::ExcludesError*>(&error) != nullptr) {
    return replaced(text, " excludes ", " cannot be combined with ");
  }
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) {
    return replaced(text, "A subcommand", "a command");
  }
  if (dynamic_cast<const CLI::ConversionError*>(&error) != nullptr) {  // "--resume = x", a flag
    return replaced(replaced(text, "Could not convert: ", ""), " = ",
                    " does not take the value '") +
           "'";
  }
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) {
    if (const std::size_t twice = text.find(": At Most 1 "); twice != text.npos) {
      return text.substr(0, twice) + " is given more than once";
    }
    return replaced(replaced(text, ": 1 required ", " needs a value: "), " missing", "");
  }
  return text;
}

/// The lines of kExitCodes and of `own`, one for each code: that of `own` where both have one.
std::string exit_codes_with(const std::string& own) {
  std::map<std::string, std::string> by_code;
  for (const std::string& codes : {std::string(kExitCodes), own}) {
    for (const std::string& line : split(codes, '\n')) {
      by_code[line.substr(0, line.find(' '))] = line;
    }
  }
  std::string text;
  for (const auto& [code, line] : by_code) text += (text.empty() ? "" : "\n") + line;
  return text;
}

/// Ends the program when an allocation fails in any thread. Unwinding is no way out: destructors of
/// libraries allocate, so that it may end in std::terminate.
[[noreturn]] void end_without_memory() {
  remove_temporaries();
  std::fprintf(stderr, "%s: out of memory\n", program_invocation_short_name);
  std::_Exit(kSystem);
}

// Installed before main(), so that allocations of static objects are covered, too.
[[maybe_unused]] const std::new_handler before_main = std::set_new_handler(end_without_memory);

/// Passes a progress on, with the names in its notes replaced.
class RenamingProgress : public Progress {
 public:
  using Rename = std::function<std::string(const std::string&)>;
  RenamingProgress(Progress& to, Rename rename) : to_(to), rename_(std::move(rename)) {}

  void begin(const std::string& stage, std::uint64_t total, const std::string& unit) override {
    to_.begin(stage, total, unit);
  }
  void advance(std::uint64_t count) override { to_.advance(count); }
  void end() override { to_.end(); }
  void note(const std::string& text) override { to_.note(rename_(text)); }

 private:
  Progress& to_;
  Rename rename_;
};

}  // namespace

ExitCode exit_code_of(const FormatError& error) {
  for (const char* rule :
       {"#header-version", "#header-draft", "#header-features", "versions.md#features"}) {
    if (error.clause().ends_with(rule)) return kUnsupported;
  }
  return kInvalidData;
}

void check_input(const std::filesystem::path& path) {
  if (path == "-") throw DataError("-: standard input is not taken here; write it to a file first");
  try {
    const InputFile file(path);
    if (file.size() == 0) throw DataError(path.string() + ": offset 0: the file is empty");
  } catch (const std::system_error& error) {
    const std::error_code code = error.code();
    if (code == std::errc::too_many_files_open || code == std::errc::not_enough_memory ||
        code == std::errc::too_many_files_open_in_system || code == std::errc::io_error) {
      throw;
    }
    if (is_net_failure(path, error)) throw;
    const bool pipe = code == std::errc::invalid_seek;
    throw DataError(path.string() + ": " + (pipe ? "Is not a regular file" : code.message()));
  }
}

bool has_ending(const std::filesystem::path& path, const std::string& ending) {
  std::string name = file_name(path);
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
  return name.size() > ending.size() && name.ends_with(ending);
}

Command::Command(const std::string& name, const std::string& purpose, const std::string& examples,
                 const std::string& exit_codes)
    : app_(purpose.substr(0, purpose.find('\n')), name),
      man_text_{.description =
                    purpose.substr(std::min(app_.get_description().size() + 1, purpose.size())),
                .exit_codes = exit_codes_with(exit_codes)} {
  app_.footer(examples);
  app_.formatter(std::make_shared<HelpFormatter>());
  app_.set_help_flag();  // declared with the other common options, behind those of the program
}

void Command::add_common_options() {
  constexpr char kGroup[] = "General";
  add_size(app_, "--memory", run_options_.memory_bytes,
           "Cap on resident memory, caches included, such as 256M")
      ->group(kGroup);
  add_integer(app_, "--threads", run_options_.threads, 0, 4096,
              "Number of threads; 0 means one for each core")
      ->group(kGroup);
  app_.add_option("--temp", run_options_.temp_dirs,
                  "Directory for temporary files; repeatable [default: that of the output]")
      ->type_name("DIR")
      ->allow_extra_args(false)
      ->check(CLI::Validator(CLI::ExistingDirectory).description(""))
      ->group(kGroup);
  app_.add_flag("--progress", progress_,
                "Report each stage on standard error [default: a bar on a terminal]\n"
                "Without this option and without --quiet, a terminal shows a bar that is erased "
                "when its stage ends. With it, each stage leaves a line, on a terminal and "
                "elsewhere.")
      ->group(kGroup);
  app_.add_flag("--quiet", quiet_, "Print neither progress nor a summary")->group(kGroup);
  app_.add_flag("--json", json_, "Print facts and statistics as JSON instead of a summary")
      ->group(kGroup);
  app_.set_version_flag("--version", app_.get_name() + " " PTC_VERSION " (PTCX format 1.0)",
                        "Print the version and exit")
      ->group(kGroup);
  app_.set_help_flag("-h,--help", "Print this help and exit")->group(kGroup);
  const auto generate = [this](const std::string& kind) {
    throw CLI::CallForVersion(generated(kind), static_cast<int>(CLI::ExitCodes::Success));
  };
  app_.add_option_function<std::string>("--generate", generate)->group("");
}

std::string Command::generated(const std::string& kind) const {
  if (kind == "man") return man_page(app_, man_text_);
  if (kind == "bash") return bash_completion(app_);
  if (kind == "zsh") return zsh_completion(app_);
  if (kind == "fish") return fish_completion(app_);
  refuse("--generate", kind, "man, bash, zsh or fish");
}

void Command::show_as(const std::filesystem::path& path, std::string name) {
  shown_names_.emplace_back(path, std::move(name));
}

std::string Command::renamed(std::string text) const {
  for (const auto& [path, name] : shown_names_) {
    for (const std::string& written : {path.string(), path.filename().string()}) {
      for (std::size_t at = 0; (at = text.find(written, at)) != text.npos; at += name.size())
        text.replace(at, written.size(), name);
    }
  }
  return text;
}

CLI::Option* Command::add_input(const std::string& name, std::filesystem::path& path,
                                const std::vector<std::string>& endings,
                                const std::string& description) {
  inputs_.push_back(&path);
  return offer(app_.add_option(name, path, description), endings)
      ->type_name("FILE")
      ->group(kFilesGroup);
}

CLI::Option* Command::add_inputs(const std::string& name, std::vector<std::filesystem::path>& paths,
                                 const std::vector<std::string>& endings,
                                 const std::string& description) {
  input_lists_.push_back(&paths);
  return offer(app_.add_option(name, paths, description), endings)
      ->type_name("FILE")
      ->group(kFilesGroup)
      ->allow_extra_args(name.front() != '-');
}

CLI::Option* Command::add_output(const std::string& name, std::filesystem::path& path,
                                 const std::vector<std::string>& endings,
                                 const std::string& description) {
  outputs_.push_back(&path);
  return offer(app_.add_option(name, path, description), endings)
      ->type_name("FILE")
      ->group(kFilesGroup)
      ->required()
      ->check(ends_in(endings));
}

CLI::Option* Command::add_outputs(const std::string& name,
                                  std::vector<std::filesystem::path>& paths,
                                  const std::vector<std::string>& endings,
                                  const std::string& description) {
  output_lists_.push_back(&paths);
  return offer(app_.add_option(name, paths, description), endings)
      ->type_name("FILE")
      ->group(kFilesGroup)
      ->required()
      ->allow_extra_args(false)
      ->check(ends_in(endings));
}

void Command::check_files() const {
  for (const auto* path : inputs_) {
    if (!path->empty()) check_input(*path);
  }
  for (const auto* paths : input_lists_) {
    std::ranges::for_each(*paths, check_input);
  }
  for (const auto* path : outputs_) {
    if (!path->empty()) check_output(*path);
  }
  for (const auto* paths : output_lists_) std::ranges::for_each(*paths, check_output);
}

int Command::report(const CLI::ParseError& error) const {
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) {
    const bool help = dynamic_cast<const CLI::CallForHelp*>(&error) != nullptr;
    const std::string text = help ? app_.help() : error.what();  // the version, or --generate
    print(text.ends_with('\n') ? text : text + "\n");
    return kDone;
  }
  std::fprintf(stderr, "%s: %s\nTry '%s --help'.\n", app_.get_name().c_str(),
               printable(message_of(app_, error)).c_str(), app_.get_name().c_str());
  return kUsage;
}

bool Command::parse(int argc, char** argv, int& exit_code) {
  try {
    app_.parse(argc, argv);
    return true;
  } catch (const CLI::ParseError& error) {
    exit_code = report(error);
    return false;
  }
}

int Command::perform(const std::function<Outcome(Progress&)>& body) const {
  check_files();
  const auto progress = quiet_      ? std::make_unique<Progress>()
                        : progress_ ? make_stderr_progress()
                                    : make_stderr_bar();
  RenamingProgress renaming(*progress, [this](const std::string& text) { return renamed(text); });
  Outcome outcome = body(renaming);
  if (json_) {
    outcome.facts["memory_bytes"] = run_options_.memory_bytes;
    outcome.facts["peak_resident_bytes"] = peak_resident_bytes();
    outcome.facts["cpu_seconds"] = cpu_seconds();
    constexpr auto kReplace =
        nlohmann::json::error_handler_t::replace;  // of names that are not UTF-8
    const int indent = outcome.lines ? -1 : 2;
    std::string text;
    if (outcome.lines) {
      for (const auto& line : *outcome.lines)
        text += line.dump(indent, ' ', false, kReplace) + "\n";
    }
    print(text + outcome.facts.dump(indent, ' ', false, kReplace) + "\n");
  } else if (!quiet_ && outcome.exit_code == kDone) {
    print(printable(outcome.summary));
  }
  if (outcome.exit_code != kDone) std::fputs(printable(outcome.summary).c_str(), stderr);
  return outcome.exit_code;
}

int Command::run(int argc, char** argv, const std::function<Outcome(Progress&)>& body) {
  const auto fail = [&](ExitCode code, const std::string& text) {
    std::fprintf(stderr, "%s: %s\n", app_.get_name().c_str(),
                 printable(with_options(renamed(text))).c_str());
    return code;
  };
  try {
    // Prepare.
    add_common_options();
    remove_temporaries_on_signal();
    std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files is an error like a full disk
    int exit_code = kDone;
    return parse(argc, argv, exit_code) ? perform(body) : exit_code;
  } catch (const CLI::ParseError& error) {  // of the body, for what only the body can judge
    return report(error);
  } catch (const FormatError& error) {
    return fail(exit_code_of(error), error.what());
  } catch (const DataError& error) {
    return fail(kInvalidData, error.what());
  } catch (const LimitError& error) {
    return fail(kLimit, error.what());
  } catch (const RequestError& error) {
    return fail(kUsage, error.what());
  } catch (const std::bad_alloc&) {
    return fail(kSystem, "out of memory");
  } catch (const std::runtime_error& error) {  // std::system_error, and errors of libraries
    return fail(kSystem, error.what());
  } catch (const std::exception& error) {  // a broken precondition, which no user causes
    return fail(kInternal, std::string("internal error: ") + error.what() +
                               "; this is a defect of the program, please report it");
  }
}

}  // namespace ptc
