// What man pages, completions and help make of texts that mean something to roff and to shells.
#include <catch2/catch.hpp>

#include "tools/completion.h"
#include "tools/help.h"
#include "tools/man_page.h"
#include "tools/option_text.h"

namespace ptc {
namespace {

/// A program whose only option has this text.
std::string option_as(std::string (*write)(const CLI::App&), const std::string& text) {
  CLI::App app("Does nothing.", "ptctest");
  app.set_help_flag();
  int value = 0;
  app.add_option("-v,--value", value, text)->type_name("N");
  return write(app);
}

std::string man_of(const CLI::App& app) {
  return man_page(app, {.description = "", .exit_codes = "0 done: fine"});
}

bool holds(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("man page: what means something to roff is escaped", "[cli]") {
  CHECK(holds(option_as(man_of, ".TP is no macro"), "\n\\&.TP is no macro.\n"));
  CHECK(holds(option_as(man_of, "'quoted' word"), "\n\\&'quoted' word.\n"));
  CHECK(holds(option_as(man_of, "a\\b --c"), "\na\\eb \\-\\-c.\n"));
  // A sentence begins a line, and may begin with a point.
  CHECK(holds(option_as(man_of, "One. .two"), "\nOne.\n\\&.two.\n"));
}

TEST_CASE("completion: what means something to a shell is quoted", "[cli]") {
  CHECK(holds(option_as(zsh_completion, "it's [a]: b"), "=[it'\\''s \\[a\\]\\: b]:N: '"));
  CHECK(holds(option_as(fish_completion, "it's a\\b"), " -d 'it\\'s a\\\\b' -x\n"));
}

TEST_CASE("option text: the first line is the summary, the default leaves it", "[cli]") {
  CLI::App app("Does nothing.", "ptctest");
  app.set_help_flag();
  bool flag = false;
  app.add_flag("--flag", flag, "Do it [default: as before]\nMore of it. And more.");
  const OptionText option = groups_of(app).at(0).options.at(0);
  CHECK(option.names == std::vector<std::string>{"--flag"});
  CHECK(option.summary == "Do it");
  CHECK(option.details == "More of it. And more.");
  CHECK(option.default_value == "as before");
  CHECK(option.value.empty());
}

TEST_CASE("option text: what an option excludes is listed in alphabetical order", "[cli]") {
  CLI::App app("Does nothing.", "ptctest");
  app.set_help_flag();
  bool flag = false;
  std::vector<CLI::Option*> options;
  for (const char* name : {"--c", "--a", "--d", "--b"}) options.push_back(app.add_flag(name, flag));
  CLI::Option* last = app.add_flag("--last", flag);
  for (CLI::Option* option : options) last->excludes(option);
  const OptionText text = groups_of(app).at(0).options.at(4);
  CHECK(text.excludes == std::vector<std::string>{"--a", "--b", "--c", "--d"});
}

TEST_CASE("option text: hidden options are in no group", "[cli]") {
  CLI::App app("Does nothing.", "ptctest");
  app.set_help_flag();
  int value = 0;
  app.add_option("--hidden", value)->group("");
  CHECK(groups_of(app).empty());
}

TEST_CASE("help: a default is never broken over two lines, and long texts are", "[cli]") {
  CLI::App app("Does nothing.", "ptctest");
  app.set_help_flag();
  int value = 0;
  const std::string text =
      "A text of so many words that it and its default need more than one line";
  app.add_option("--value", value, text)->default_str("one two three")->type_name("N");
  const std::string help = HelpFormatter().make_help(&app, "ptctest", CLI::AppFormatMode::Normal);
  CHECK(holds(help, "line\n                 [default: one two three]\n"));
}

TEST_CASE("help: a command shows its own examples, with the comment before each", "[cli]") {
  const std::string footer =
      "  # One\n  ptctest one -x\n  # Two\n  ptctest two\n  ptctest two -y\n";
  CHECK(examples_of(footer, "ptctest two") == "  # Two\n  ptctest two\n  ptctest two -y\n");
  CHECK(examples_of(footer, "ptctest") == footer);
}

}  // namespace ptc
