// Lays out --help:
//
//   Builds a container from meshes.                  summary
//   Usage: ptcbuild [OPTION]... -o FILE [INPUT]...   usage
//   Input and output:                                a group
//     -o, --output FILE  Container to write          an option: names and value, text
//   Examples:                                        command lines, each under its comment
#include "tools/help.h"

#include <algorithm>
#include <sstream>
#include <vector>

#include "tools/option_text.h"

namespace ptc {
namespace {

constexpr std::size_t kWidth = 100;      // columns of a line
constexpr std::size_t kMaxLabel = 30;    // wider labels have a line of their own
constexpr std::size_t kLongIndent = 6;   // of options without a short name
constexpr std::size_t kShortIndent = 2;  // of all else

constexpr char kNoBreak = '\x1f';  // a blank at which no line may end

/// Breaks a text between words into lines; all but the first begin with `indent` blanks.
std::string wrapped(const std::string& text, std::size_t indent) {
  std::string lines;
  std::size_t column = indent;
  for (const std::string& word : split(text, ' ')) {
    const bool first = column == indent;
    if (!first && column + 1 + word.size() > kWidth) {
      lines += "\n" + std::string(indent, ' ');
      column = indent;
    } else if (!first) {
      lines += " ";
      ++column;
    }
    lines += word;
    column += word.size();
  }
  std::ranges::replace(lines, kNoBreak, ' ');
  return lines;
}

/// A label and a text in two columns; the text begins at `column`.
std::string line_of(const std::string& label, const std::string& text, std::size_t column) {
  const bool fits = label.size() + 2 <= column;
  return label +
         (fits ? std::string(column - label.size(), ' ') : "\n" + std::string(column, ' ')) +
         wrapped(text, column) + "\n";
}

/// Names and value of an option, indented so that all long names stand in one column.
std::string label_of(const OptionText& option) {
  if (option.positional()) {
    return std::string(kShortIndent, ' ') + option.value + (option.repeatable ? "..." : "");
  }
  const bool is_long = option.names.front().starts_with("--");
  std::string label(is_long ? kLongIndent : kShortIndent, ' ');
  label += join(option.names, ", ");
  return option.value.empty() ? label : label + " " + option.value;
}

/// The column at which texts begin: behind the widest label, but for those that are very wide.
std::size_t text_column(const std::vector<std::string>& labels) {
  std::size_t widest = 0;
  for (const std::string& label : labels) {
    if (label.size() <= kMaxLabel) widest = std::max(widest, label.size());
  }
  return widest + 2;
}

std::string commands_text(const CLI::App& app) {
  const std::vector<const CLI::App*> commands = commands_of(app);
  if (commands.empty()) return "";
  std::vector<std::string> labels;
  for (const CLI::App* command : commands) labels.push_back("  " + command->get_name());
  std::string text = "\nCommands:\n";
  for (std::size_t i = 0; i < commands.size(); ++i) {
    text += line_of(labels[i], commands[i]->get_description(), text_column(labels));
  }
  return text;
}

std::string options_text(const CLI::App& app) {
  const std::vector<OptionGroup> groups = groups_of(app);
  std::vector<std::string> labels;
  for (const OptionGroup& group : groups) {
    for (const OptionText& option : group.options) labels.push_back(label_of(option));
  }
  std::string text;
  for (const OptionGroup& group : groups) {
    text += "\n" + group.title + ":\n";
    for (const OptionText& option : group.options) {
      std::string preset =
          option.default_value.empty() ? "" : "[default: " + option.default_value + "]";
      std::ranges::replace(preset, ' ', kNoBreak);
      text += line_of(label_of(option), option.summary + (preset.empty() ? "" : " ") + preset,
                      text_column(labels));
    }
  }
  return text;
}

}  // namespace

std::string suffixes_text(const CLI::App& app) {
  bool counts = false;
  bool sizes = false;
  bool lights = false;
  for (const OptionGroup& group : groups_of(app)) {
    for (const OptionText& option : group.options) {
      counts = counts || option.value == "COUNT";
      sizes = sizes || option.value == "SIZE";
      lights = lights || option.value.ends_with("LIGHT");
    }
  }
  std::string text;
  if (counts) text += "COUNT takes the suffixes k, M and G (powers of 1000).\n";
  if (sizes) text += "SIZE takes the suffixes K, M, G and T (powers of 1024).\n";
  if (lights) {
    text +=
        "LIGHT is R,G,B or one number, in W/sr, or with a unit: W as in Blender, cd as in glTF, or "
        "lm.\n";
  }
  return text;
}

std::string examples_of(const std::string& footer, const std::string& name) {
  std::string text;
  std::string comment;
  for (const std::string& line : split(footer, '\n')) {
    const bool is_comment = line.starts_with("  #");
    if (!is_comment && line.starts_with("  " + name)) text += comment + line + "\n";
    comment = is_comment ? line + "\n" : "";
  }
  return text;
}

std::string HelpFormatter::make_help(const CLI::App* app, std::string name,
                                     CLI::AppFormatMode /*mode*/) const {
  const CLI::App& root = app->get_parent() == nullptr ? *app : *app->get_parent();
  std::string text = wrapped(app->get_description(), 0) + "\n\nUsage: " + name + " " +
                     usage_of(*app) + "\n" + commands_text(*app) + options_text(*app);
  if (const std::string suffixes = suffixes_text(*app); !suffixes.empty()) text += "\n" + suffixes;
  const std::string examples = examples_of(root.get_footer(), name);
  return examples.empty() ? text : text + "\nExamples:\n" + examples;
}

}  // namespace ptc
