// Writes completions in the languages of three shells. Each proposes the same:
//
//   where                              what
//   after an option that takes a value  its words, files with its endings, directories, or nothing
//   after a dash                        options
//   elsewhere                           commands, or files that fit a positional argument
#include "tools/completion.h"

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "tools/option_text.h"

namespace ptc {
namespace {

std::string replaced(const std::string& text, char letter, std::string_view by) {
  std::string out;
  for (const char c : text) {
    if (c == letter) {
      out += by;
    } else {
      out += c;
    }
  }
  return out;
}

/// A text as one word of bash and zsh.
std::string quoted(const std::string& text) {
  return "'" + replaced(text, '\'', "'\\''") + "'";
}

/// A text as one word of fish, which reads escapes between single quotes.
std::string fish_quoted(const std::string& text) {
  return "'" + replaced(replaced(text, '\\', "\\\\"), '\'', "\\'") + "'";
}

std::vector<OptionText> options_of(const CLI::App& app) {
  std::vector<OptionText> options;
  for (const OptionGroup& group : groups_of(app)) {
    options.insert(options.end(), group.options.begin(), group.options.end());
  }
  return options;
}

/// Endings of the files that some positional argument takes, in order and each once.
std::vector<std::string> operand_endings(const std::vector<OptionText>& options) {
  std::vector<std::string> endings;
  for (const OptionText& option : options) {
    if (!option.positional()) continue;
    for (const std::string& ending : option.endings) {
      if (std::ranges::find(endings, ending) == endings.end()) endings.push_back(ending);
    }
  }
  return endings;
}

bool takes_operands(const std::vector<OptionText>& options) {
  return std::ranges::any_of(options, &OptionText::positional);
}

std::string header(const CLI::App& app, const char* shell) {
  return fmt::format("# {} completion for {}, written by: {} --generate {}\n", shell,
                     app.get_name(), app.get_name(), shell);
}

// ---- bash ----

/// A command that proposes words.
std::string bash_words(const std::vector<std::string>& words) {
  return "mapfile -t COMPREPLY < <(compgen -W " + quoted(join(words, " ")) + " -- \"$current\")";
}

/// A command that proposes files with these endings, or all files, and directories.
std::string bash_files(const std::string& function, const std::vector<std::string>& endings) {
  return function + "_files \"$current\"" + (endings.empty() ? "" : " " + join(endings, " "));
}

/// Commands that propose the value of an option; empty when nothing can be proposed.
std::string bash_value(const OptionText& option, const std::string& function) {
  if (!option.choices.empty()) {
    const bool open = option.choices.front().ends_with('=');  // the word goes on behind it
    return bash_words(option.choices) + "\n" +
           (open ? "      compopt -o nospace 2>/dev/null\n" : "");
  }
  if (option.takes_file()) return bash_files(function, option.endings) + "\n";
  if (!option.takes_directory()) return "";
  return "mapfile -t COMPREPLY < <(compgen -d -- \"$current\")\n"
         "      compopt -o filenames 2>/dev/null\n";
}

/// Branches on the word before the cursor: an option, or a choice that ends with "=" and goes on
/// with the name of a file. Words with the same proposals share a branch.
std::string bash_cases(const std::vector<OptionText>& options, const std::string& function) {
  std::vector<std::pair<std::string, std::vector<std::string>>> branches;  // commands, words
  const auto add = [&](const std::string& commands, const std::vector<std::string>& words) {
    auto branch = std::ranges::find(branches, commands, [](const auto& b) { return b.first; });
    if (branch == branches.end()) branch = branches.insert(branch, {commands, {}});
    branch->second.insert(branch->second.end(), words.begin(), words.end());
  };
  for (const OptionText& option : options) {
    if (option.positional() || option.value.empty()) continue;
    add(bash_value(option, function), option.names);
    if (!option.choices.empty() && option.choices.front().ends_with('=')) {
      add(bash_files(function, option.endings) + "\n", option.choices);
    }
  }
  std::string text;
  for (const auto& [commands, names] : branches) {
    text += fmt::format("    {})\n{}      return\n      ;;\n", join(names, " | "),
                        commands.empty() ? "" : "      " + commands);
  }
  return text;
}

/// A function that proposes what may follow in one command of a program.
std::string bash_function(const CLI::App& app, const std::string& name,
                          const std::string& function) {
  const std::vector<OptionText> options = options_of(app);
  std::vector<std::string> names;
  for (const OptionText& option : options) {
    names.insert(names.end(), option.names.begin(), option.names.end());
  }
  std::vector<std::string> commands;
  for (const CLI::App* command : commands_of(app)) commands.push_back(command->get_name());
  std::string operands = ":";
  if (!commands.empty()) {
    operands = bash_words(commands);
  } else if (takes_operands(options)) {
    operands = bash_files(function, operand_endings(options));
  }
  return fmt::format(
      "{}() {{\n"
      "  local current=$1 previous=$2\n"
      "  case $previous in\n"
      "{}"
      "  esac\n"
      "  if [[ $current == -* ]]; then\n"
      "    {}\n"
      "  else\n"
      "    {}\n"
      "  fi\n"
      "}}\n\n",
      name, bash_cases(options, function), bash_words(names), operands);
}

// ---- zsh ----

/// A text inside a specification of _arguments, where brackets and colons have a meaning.
std::string zsh_text(const std::string& text) {
  std::string out = replaced(text, '\\', "\\\\");
  for (const char c : {':', '[', ']'}) out = replaced(out, c, std::string("\\") + c);
  return out;
}

/// The part ":MESSAGE:ACTION" of a specification.
std::string zsh_action(const OptionText& option) {
  std::string action = " ";
  if (!option.choices.empty()) {
    action = "(" + join(option.choices, " ") + ")";
  } else if (option.takes_file() && option.endings.empty()) {
    action = "_files";
  } else if (option.takes_file()) {
    std::vector<std::string> bare;
    for (const std::string& ending : option.endings) bare.push_back(ending.substr(1));
    // One word in brackets at the end of a pattern would be taken for qualifiers.
    const std::string all = join(bare, "|");
    action = "_files -g \"*." + (bare.size() > 1 ? "(" + all + ")" : all) + "\"";
  } else if (option.takes_directory()) {
    action = "_files -/";
  }
  return ":" + zsh_text(option.value) + ":" + action;
}

/// Arguments of _arguments, a line each.
std::string zsh_specifications(const CLI::App& app) {
  std::string lines;
  for (const OptionText& option : options_of(app)) {
    const std::string prefix = option.repeatable ? "*" : "";
    if (option.positional()) {
      lines += " \\\n  " + quoted(prefix + zsh_action(option));
      continue;
    }
    const std::string action = option.value.empty() ? "" : zsh_action(option);
    const std::string others =
        option.repeatable || option.names.size() < 2 ? "" : "(" + join(option.names, " ") + ")";
    for (const std::string& name : option.names) {
      const char* joined = name.starts_with("--") ? "=" : "+";
      lines += " \\\n  " + quoted(others + prefix + name + (action.empty() ? "" : joined) + "[" +
                                  zsh_text(option.summary) + "]" + action);
    }
  }
  return lines;
}

// ---- fish ----

/// The words that propose a value, behind the -d of a fish completion.
std::string fish_value(const OptionText& option) {
  if (option.value.empty()) return "";
  if (!option.choices.empty()) return " -x -a " + fish_quoted(join(option.choices, " "));
  if (option.takes_file() && option.endings.empty()) return " -r -F";
  if (option.takes_file()) {
    std::string files;
    for (const std::string& ending : option.endings) {
      files += (files.empty() ? "" : "; ") + ("__fish_complete_suffix " + ending);
    }
    return " -x -k -a " + fish_quoted("(" + files + ")");
  }
  return option.takes_directory() ? " -x -a '(__fish_complete_directories)'" : " -x";
}

/// A line for each option that an application declares. @param condition  " -n '...'" or empty
std::string fish_lines(const CLI::App& app, const std::string& program,
                       const std::string& condition) {
  std::string lines;
  for (const OptionText& option : options_of(app)) {
    lines += "complete -c " + program + condition;
    for (const std::string& name : option.names) {
      lines += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
    }
    if (!option.positional()) lines += " -d " + fish_quoted(option.summary);
    lines += fish_value(option) + "\n";
  }
  return lines;
}

}  // namespace

std::string bash_completion(const CLI::App& app) {
  const std::string& program = app.get_name();
  const std::string function = "_" + program;
  std::string text = header(app, "bash");
  text += fmt::format(
      "\n# Proposes directories, and files with one of the endings $2... or all files.\n"
      "{}_files() {{\n"
      "  local ending\n"
      "  compopt -o filenames 2>/dev/null\n"
      "  mapfile -t COMPREPLY < <(\n"
      "    compgen -d -- \"$1\"\n"
      "    [[ $# -gt 1 ]] || compgen -f -- \"$1\"\n"
      "    for ending in \"${{@:2}}\"; do compgen -f -X \"!*$ending\" -- \"$1\"; done\n"
      "  )\n"
      "}}\n\n",
      function);
  text += bash_function(app, function + "_options", function);

  std::string cases;
  for (const CLI::App* command : commands_of(app)) {
    const std::string own = function + "_" + command->get_name();
    text += bash_function(*command, own, function);
    cases += fmt::format(
        "      {})\n        {} \"$current\" \"$previous\"\n        return\n        ;;\n",
        command->get_name(), own);
  }
  const std::string choose =
      cases.empty() ? ""
                    : "  for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do\n    case $word in\n" +
                          cases + "    esac\n  done\n";
  return text + fmt::format(
                    "{}() {{\n"
                    "  local current=${{COMP_WORDS[COMP_CWORD]}}{}\n"
                    "  local previous=${{COMP_WORDS[COMP_CWORD-1]}}\n"
                    "  COMPREPLY=()\n"
                    "  # Bash splits --option=value and word=value into three words.\n"
                    "  if [[ $current == = ]]; then\n"
                    "    current=\n"
                    "    [[ $previous == -* ]] || previous+==\n"
                    "  elif [[ $previous == = ]]; then\n"
                    "    previous=${{COMP_WORDS[COMP_CWORD-2]}}\n"
                    "    [[ $previous == -* ]] || previous+==\n"
                    "  fi\n"
                    "{}"
                    "  {}_options \"$current\" \"$previous\"\n"
                    "}}\n"
                    "complete -F {} {}\n",
                    function, choose.empty() ? "" : " word", choose, function, function, program);
}

std::string zsh_completion(const CLI::App& app) {
  const std::vector<const CLI::App*> commands = commands_of(app);
  std::string text = "#compdef " + app.get_name() + "\n" + header(app, "zsh") + "\n";
  if (commands.empty()) return text + "_arguments -s -S" + zsh_specifications(app) + "\n";

  std::string names;
  std::string cases;
  for (const CLI::App* command : commands) {
    names += "\n  " + quoted(zsh_text(command->get_name()) + ":" + command->get_description());
    cases += fmt::format("  {})\n_arguments -s -S{}\n  ;;\n", command->get_name(),
                         zsh_specifications(*command));
  }
  return text + fmt::format(
                    "local context state state_descr line\n"
                    "typeset -A opt_args\n"
                    "local -a commands=({}\n)\n"
                    "_arguments -C -s -S{} \\\n"
                    "  '1:COMMAND:->command' \\\n"
                    "  '*::ARGUMENT:->argument' && return\n"
                    "case $state in\n"
                    "command) _describe command commands ;;\n"
                    "argument)\n"
                    "  case $words[1] in\n{}  esac\n"
                    "  ;;\n"
                    "esac\n",
                    names, zsh_specifications(app), cases);
}

std::string fish_completion(const CLI::App& app) {
  const std::string& program = app.get_name();
  const std::vector<const CLI::App*> commands = commands_of(app);
  std::string text = header(app, "fish") + "complete -c " + program + " -f\n";
  if (commands.empty()) return text + fish_lines(app, program, "");

  text += fish_lines(app, program, " -n __fish_use_subcommand");
  for (const CLI::App* command : commands) {
    const std::string& name = command->get_name();
    text += fmt::format("complete -c {} -n __fish_use_subcommand -a {} -d {}\n", program, name,
                        fish_quoted(command->get_description()));
    text +=
        fish_lines(*command, program, " -n " + fish_quoted("__fish_seen_subcommand_from " + name));
  }
  return text;
}

}  // namespace ptc
