// Names, values, defaults and relations of options, as CLI11 keeps them.
#include "tools/option_text.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <string_view>
#include <utility>

namespace ptc {
namespace {

constexpr std::string_view kDefaultText = " [default: ";

/// Names in alphabetical order: CLI11 orders by address, which differs from run to run.
std::vector<std::string> names_of(const std::set<CLI::Option*>& options) {
  std::vector<std::string> names;
  for (const CLI::Option* option : options) {
    names.push_back(option->nonpositional() ? option->get_name() : option->get_name(true));
  }
  std::ranges::sort(names);
  return names;
}

OptionText text_of(const CLI::Option& option) {
  OptionText text;
  for (const std::string& name : option.get_snames()) text.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) text.names.push_back("--" + name);
  if (option.get_items_expected_max() > 0) text.value = option.get_type_name();
  if (text.positional() && text.value == "FILE") text.value = upper_case(option.get_name(true));

  const std::string& description = option.get_description();
  const std::size_t end = std::min(description.find('\n'), description.size());
  text.summary = description.substr(0, end);
  text.details = description.substr(std::min(end + 1, description.size()));
  text.default_value = option.get_default_str();
  if (const std::size_t bracket = text.summary.find(kDefaultText);
      bracket != std::string::npos && text.summary.ends_with(']')) {
    text.default_value = text.summary.substr(bracket + kDefaultText.size());
    text.default_value.pop_back();
    text.summary.resize(bracket);
  }

  for (const std::string& value : split(option.get_option_text(), '|')) {
    (value.starts_with('.') ? text.endings : text.choices).push_back(value);
  }
  text.needs = names_of(option.get_needs());
  text.excludes = names_of(option.get_excludes());
  text.required = option.get_required();
  text.repeatable = option.get_expected_max() > 1;
  return text;
}

/// Appends the options that an application declares itself.
void add_groups(const CLI::App& app, std::vector<OptionGroup>& groups) {
  for (const bool positional : {true, false}) {
    for (const CLI::Option* option : app.get_options()) {
      if (option->get_group().empty() || option->get_positional() != positional) continue;
      auto group = std::ranges::find(groups, option->get_group(), &OptionGroup::title);
      if (group == groups.end()) group = groups.insert(group, {option->get_group(), {}});
      group->options.push_back(text_of(*option));
    }
  }
}

}  // namespace

bool OptionText::takes_file() const noexcept {
  return !endings.empty() || value.find("FILE") != std::string::npos ||
         (positional() && !takes_directory());
}

CLI::Option* offer(CLI::Option* option, const std::vector<std::string>& values) {
  return option->option_text(join(values, "|"));
}

std::vector<OptionGroup> groups_of(const CLI::App& app) {
  std::vector<OptionGroup> groups;
  add_groups(app, groups);
  if (app.get_parent() != nullptr) add_groups(*app.get_parent(), groups);
  std::ranges::stable_partition(
      groups, [](const OptionGroup& group) { return group.title != kExpertGroup; });
  return groups;
}

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

std::string usage_of(const CLI::App& app) {
  std::string usage = "[OPTION]...";
  std::string operands;
  if (!commands_of(app).empty()) return "COMMAND " + usage;
  for (const OptionGroup& group : groups_of(app)) {
    for (const OptionText& option : group.options) {
      if (option.positional()) {
        operands += option.required ? " " + option.value : " [" + option.value + "]";
        if (option.repeatable) operands += "...";
      } else if (option.required) {
        usage += " " + option.names.front() + " " + option.value;
      }
    }
  }
  return usage + operands;
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  while (!text.empty() && begin <= text.size()) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

std::string upper_case(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text;
}

std::string join(const std::vector<std::string>& parts, const std::string& separator) {
  std::string text;
  for (const std::string& part : parts) text += (text.empty() ? "" : separator) + part;
  return text;
}

}  // namespace ptc
