// One place for parsing, checks of files, errors and output of all programs.
#include "tools/common.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <new>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/base/memory.h"
#include "engine/io/file/file.h"
#include "engine/io/text/text.h"
#include "format/error.h"
#include "format/text.h"
#include "tools/field_names.h"
#include "tools/values.h"

namespace ptc {
namespace {

/// A version or feature that is too new is another thing than damage.
ExitCode exit_code_of(const FormatError& error) {
  const bool newer =
      error.clause().ends_with("#header-version") || error.clause().ends_with("#header-features");
  return newer ? kUnsupported : kInvalidData;
}

/// Long work is not begun for an output that cannot be written.
void check_output(const std::filesystem::path& path) {
  const auto refuse = [&](std::errc code) {
    throw std::system_error(std::make_error_code(code), "open " + path.string());
  };
  const std::filesystem::path parent = path.parent_path();
  if (!parent.empty() && !std::filesystem::exists(parent)) {
    refuse(std::errc::no_such_file_or_directory);
  }
  if (!parent.empty() && !std::filesystem::is_directory(parent)) refuse(std::errc::not_a_directory);
  if (path.filename().empty() || std::filesystem::is_directory(path)) {
    refuse(std::errc::is_a_directory);
  }
}

/// @throws std::system_error when standard output does not take it, e.g. on a full disk
void print(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0) {
    throw std::system_error(errno, std::generic_category(), "write to standard output");
  }
}

/// Refuses names that end in none of `endings`.
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

/// The end of the program when an allocation fails, in whatever thread: destructors of libraries
/// allocate, so that unwinding may end in std::terminate. What began before main() is armed too.
[[noreturn]] void end_without_memory() {
  remove_temporaries();
  std::fprintf(stderr, "%s: out of memory\n", program_invocation_short_name);
  std::_Exit(kSystem);
}

[[maybe_unused]] const std::new_handler before_main = std::set_new_handler(end_without_memory);

}  // namespace

void check_input(const std::filesystem::path& path) {
  try {
    const InputFile file(path);
    if (file.size() == 0) throw DataError(path.string() + ": offset 0: the file is empty");
  } catch (const std::system_error& error) {
    const std::error_code code = error.code();
    if (code == std::errc::too_many_files_open || code == std::errc::not_enough_memory ||
        code == std::errc::too_many_files_open_in_system || code == std::errc::io_error) {
      throw;
    }
    const bool pipe = code == std::errc::invalid_seek;
    throw DataError(path.string() + ": " + (pipe ? "Is not a regular file" : code.message()));
  }
}

bool has_ending(const std::filesystem::path& path, const std::string& ending) {
  std::string name = path.filename().string();
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
  return name.size() > ending.size() && name.ends_with(ending);
}

Command::Command(const std::string& name, const std::string& purpose, const std::string& examples,
                 const std::string& exit_codes)
    : app_(purpose, name) {
  app_.footer("Examples:\n" + examples + "\nExit codes: " + exit_codes);
  app_.get_formatter()->column_width(34);
  app_.set_help_flag();  // declared with the other common options, behind those of the program
}

void Command::add_common_options() {
  constexpr char kGroup[] = "Common options";
  add_size(app_, "--memory", run_options_.memory_bytes,
           "Cap on resident bytes, caches included: 256M, 2G")
      ->group(kGroup);
  add_integer(app_, "--threads", run_options_.threads, 0, 4096, "Threads; 0: as many as cores")
      ->group(kGroup);
  app_.add_option("--temp", run_options_.temp_dirs,
                  "Directory for temporary files, again for more [default: the output's]")
      ->type_name("DIR")
      ->allow_extra_args(false)
      ->check(CLI::Validator(CLI::ExistingDirectory).description(""))
      ->group(kGroup);
  app_.add_flag("--progress", progress_, "Show stages on stderr: on a terminal a bar, else lines")
      ->group(kGroup);
  app_.add_flag("--quiet", quiet_, "No progress and no summary")->group(kGroup);
  app_.add_flag("--json", json_, "Print facts and statistics as JSON, not a summary")
      ->group(kGroup);
  app_.set_version_flag("--version", app_.get_name() + " " PTC_VERSION " (PTCX format 1.0)",
                        "Print the version and exit")
      ->group(kGroup);
  app_.set_help_flag("-h,--help", "Print this help and exit")->group(kGroup);
}

CLI::Option* Command::add_input(const std::string& name, std::filesystem::path& path,
                                const std::string& description) {
  inputs_.push_back(&path);
  return app_.add_option(name, path, description)->type_name("FILE");
}

CLI::Option* Command::add_inputs(const std::string& name, std::vector<std::filesystem::path>& paths,
                                 const std::string& description) {
  input_lists_.push_back(&paths);
  return app_.add_option(name, paths, description)
      ->type_name("FILE")
      ->allow_extra_args(name.front() != '-');
}

CLI::Option* Command::add_output(const std::string& name, std::filesystem::path& path,
                                 const std::vector<std::string>& endings,
                                 const std::string& description) {
  outputs_.push_back(&path);
  return app_.add_option(name, path, description)
      ->type_name("FILE")
      ->required()
      ->check(ends_in(endings));
}

CLI::Option* Command::add_outputs(const std::string& name,
                                  std::vector<std::filesystem::path>& paths,
                                  const std::vector<std::string>& endings,
                                  const std::string& description) {
  output_lists_.push_back(&paths);
  return app_.add_option(name, paths, description)
      ->type_name("FILE")
      ->required()
      ->allow_extra_args(false)
      ->check(ends_in(endings));
}

void Command::check_files() const {
  for (const auto* path : inputs_) {
    if (!path->empty()) check_input(*path);
  }
  for (const auto* paths : input_lists_) std::ranges::for_each(*paths, check_input);
  for (const auto* path : outputs_) {
    if (!path->empty()) check_output(*path);
  }
  for (const auto* paths : output_lists_) std::ranges::for_each(*paths, check_output);
}

int Command::report(const CLI::ParseError& error) const {
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) {
    const bool help = dynamic_cast<const CLI::CallForHelp*>(&error) != nullptr;
    print(help ? app_.help() : std::string(error.what()) + "\n");
    return kDone;
  }
  std::fprintf(stderr, "%s: %s\nTry '%s --help'.\n", app_.get_name().c_str(),
               printable(error.what()).c_str(), app_.get_name().c_str());
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
                                    : make_stderr_notes();
  Outcome outcome = body(*progress);
  if (json_) {
    outcome.facts["peak_resident_bytes"] = peak_resident_bytes();
    outcome.facts["cpu_seconds"] = cpu_seconds();
    constexpr auto kReplace = nlohmann::json::error_handler_t::replace;  // names that are no UTF-8
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
                 printable(with_options(text)).c_str());
    return code;
  };
  try {
    add_common_options();
    remove_temporaries_on_signal();
    std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is an error like a full disk
    int exit_code = kDone;
    return parse(argc, argv, exit_code) ? perform(body) : exit_code;
  } catch (const CLI::ParseError& error) {  // of the body: what only it could judge
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
  } catch (const std::runtime_error& error) {  // std::system_error, and what libraries refuse
    return fail(kSystem, error.what());
  } catch (const std::exception& error) {  // a precondition was broken, by no fault of the user
    return fail(kInternal, std::string("internal error: ") + error.what() +
                               "; this is a defect of the program, please report it");
  }
}

}  // namespace ptc
