// Writes NAME, SYNOPSIS, DESCRIPTION, COMMANDS, OPTIONS, EXIT STATUS, EXAMPLES and SEE ALSO in
// roff:
//
//   .SS Sampling                              a heading
//   .TP                                       the next line is a label, its text follows
//   \fB\-\-points\fR \fICOUNT\fR              names in bold, values in italics
//   Number of surfels on the meshes. Default: 2M.
//
// A backslash, and a point or an apostrophe at the beginning of a line, mean something to roff and
// are escaped; a hyphen that users type is written \-, so that it can be copied from the page.
#include "tools/man_page.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>
#include <vector>

#include "tools/help.h"
#include "tools/option_text.h"

namespace ptc {
namespace {

constexpr char kDate[] = "2026-11-28";  // when these texts were last revised

constexpr std::size_t kRoffWidth = 80;  // of a line

/// The programs that are installed, each of which has a manual page.
constexpr std::array<std::string_view, 9> kPrograms{"ptcbake",   "ptcbuild", "ptcconvert",
                                                    "ptcfarm",   "ptcinfo",  "ptclight",
                                                    "ptcrender", "ptcshade", "ptcverify"};

/// A text as roff takes it, without any markup.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const bool begins_line = out.empty() || out.back() == '\n';
    if (begins_line && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c;
    }
  }
  return out;
}

std::string bold(const std::string& text) {
  return "\\fB" + roff(text) + "\\fR";
}

std::string italic(const std::string& text) {
  return "\\fI" + roff(text) + "\\fR";
}

/// A text as lines of roff: each sentence begins a line, as roff expects, and no line is longer
/// than kRoffWidth unless it is one word.
std::string filled(const std::string& text) {
  std::string lines;
  std::string line;
  for (const std::string& word : split(text, ' ')) {
    const std::string next = roff(line.empty() ? word : line + " " + word);
    if (!line.empty() && (line.ends_with('.') || next.size() > kRoffWidth)) {
      lines += roff(line) + "\n";
      line.clear();
    }
    line += (line.empty() ? "" : " ") + word;
  }
  return lines + roff(line) + "\n";
}

std::string heading(const std::string& title) {
  return ".SH " + title + "\n";
}

/// A summary as the part of NAME behind the dash: no capital, no full stop.
std::string phrase_of(std::string summary) {
  summary.front() = static_cast<char>(std::tolower(static_cast<unsigned char>(summary.front())));
  if (summary.ends_with('.')) summary.pop_back();
  return summary;
}

std::string synopsis_of(const CLI::App& app, const std::string& name) {
  std::string text = bold(name);
  for (const std::string& word : split(usage_of(app), ' ')) {
    const bool is_option = word.starts_with('-');
    const bool is_value = std::isupper(static_cast<unsigned char>(word.front())) != 0;
    text += " " + (is_option ? bold(word) : is_value ? italic(word) : roff(word));
  }
  return text + "\n";
}

std::string option_entry(const OptionText& option) {
  std::string label;
  for (const std::string& name : option.names) label += (label.empty() ? "" : ", ") + bold(name);
  if (!option.value.empty()) label += (label.empty() ? "" : " ") + italic(option.value);
  if (option.positional() && option.repeatable) label += "...";

  std::string text = option.summary + ".";
  if (!option.details.empty()) text += " " + option.details;
  if (!option.choices.empty() && option.details.empty()) {
    text += " Values: " + join(option.choices, ", ") + ".";
  }
  if (!option.default_value.empty()) text += " Default: " + option.default_value + ".";
  if (!option.needs.empty()) text += " Requires " + join(option.needs, " and ") + ".";
  if (!option.excludes.empty()) {
    text += " Cannot be combined with " + join(option.excludes, " or ") + ".";
  }
  return ".TP\n" + label + "\n" + filled(text);
}

std::string options_section(const std::vector<OptionGroup>& groups) {
  std::string text;
  for (const OptionGroup& group : groups) {
    text += ".SS " + roff(group.title) + "\n";
    for (const OptionText& option : group.options) text += option_entry(option);
  }
  return text;
}

/// Each command with its own options; those of the program follow under OPTIONS.
std::string commands_section(const CLI::App& app) {
  const std::vector<const CLI::App*> commands = commands_of(app);
  if (commands.empty()) return "";
  const std::vector<OptionGroup> shared = groups_of(app);
  std::string text = heading("COMMANDS");
  for (const CLI::App* command : commands) {
    text += ".SS " + roff(command->get_name()) + "\n";
    text += filled(command->get_description() + ".");
    text += ".PP\n" + synopsis_of(*command, app.get_name() + " " + command->get_name());
    for (const OptionGroup& group : groups_of(*command)) {
      if (std::ranges::find(shared, group.title, &OptionGroup::title) != shared.end()) continue;
      for (const OptionText& option : group.options) text += option_entry(option);
    }
  }
  return text;
}

std::string exit_section(const std::string& exit_codes) {
  std::string text = heading("EXIT STATUS");
  for (const std::string& line : split(exit_codes, '\n')) {
    const std::size_t blank = line.find(' ');
    if (blank == std::string::npos) continue;
    text += ".TP\n" + bold(line.substr(0, blank)) + "\n" + filled(line.substr(blank + 1) + ".");
  }
  return text;
}

std::string examples_section(const std::string& footer) {
  std::string text = heading("EXAMPLES");
  bool first = true;
  for (const std::string& line : split(footer, '\n')) {
    if (line.starts_with("  # ")) {
      text += (first ? "" : ".PP\n") + filled(line.substr(4) + ":");
    } else if (line.size() > 2) {
      text += ".PP\n.RS 4\n.EX\n" + roff(line.substr(2)) + "\n.EE\n.RE\n";
    }
    first = false;
  }
  return text;
}

std::string see_also_section(const std::string& name) {
  std::vector<std::string> others;
  for (const std::string_view program : kPrograms) {
    if (program != name) others.push_back(".BR " + std::string(program) + " (1)");
  }
  return heading("SEE ALSO") + join(others, ",\n") + "\n";
}

}  // namespace

std::string man_page(const CLI::App& app, const ManText& text) {
  const std::string& name = app.get_name();
  const std::string version = PTC_VERSION;
  std::string page =
      ".TH " + upper_case(name) + " 1 " + kDate + " \"PTCX " + version + "\" \"PTCX Manual\"\n";
  page += heading("NAME") + name + " \\- " + roff(phrase_of(app.get_description())) + "\n";
  page += heading("SYNOPSIS") + synopsis_of(app, name);

  page += heading("DESCRIPTION") + filled(app.get_description());
  for (const std::string& line : split(text.description, '\n')) {
    page += line.empty() ? ".PP\n" : filled(line);
  }
  if (const std::string suffixes = suffixes_text(app); !suffixes.empty()) {
    page += ".PP\n" + roff(suffixes);
  }

  page += commands_section(app) + heading("OPTIONS") + options_section(groups_of(app));
  page += exit_section(text.exit_codes) + examples_section(app.get_footer());
  return page + see_also_section(name);
}

}  // namespace ptc
