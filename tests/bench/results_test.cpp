// Files of results: what they say about the measurement, and how they are written.
#include "tools/bench/report/results.h"

#include <fstream>

#include <catch2/catch.hpp>

#include "tests/support/scenes.h"
#include "tests/support/slurp.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

Report report(unsigned runs) {
  Table table{.caption = {.name = "rows"},
              .headings = {{"scene", {"scene"}}, {"us", {"us", "{:.1f}"}}}};
  table.rows = {{std::string("city"), Spread{2, 1, 4}}, {std::string("dark"), kNoSpread}};
  ChartPanel panel{.title = "Panel", .x_label = "x", .y_label = "y"};
  series_of(panel, "line", false).points = {{.x = 1, .y = 2}, {.x = 2, .y = 3}};
  Chart chart{.title = "A chart"};
  add_panel(chart, panel);
  return {.name = "sample",
          .title = "A sample",
          .reading = "One thing against another.",
          .runs = runs,
          .tables = {table},
          .notes = {"A note."},
          .figures = {{.part = "city", .chart = chart}}};
}

Circumstances circumstances(bool changed) {
  return {.processor = "Processor 9000",
          .cores = 2,
          .memory_bytes = std::uint64_t{24} << 30,
          .system = "Linux 6.1.0 x86_64",
          .instructions = "AVX3",
          .load = 0.25,
          .commit = "0123456789ab",
          .changed = changed,
          .date = "2025-01-31 12:00",
          .command = "ptcbench sample -o charts"};
}

std::string command_of(std::vector<std::string> words) {
  std::vector<char*> command;
  for (std::string& word : words) command.push_back(word.data());
  return public_command(command);
}

}  // namespace

TEST_CASE("results: the head has machine, commit, date, command and runs", "[bench][results]") {
  const std::string text = results_text(report(5), circumstances(false));
  CHECK(text.starts_with("# A sample\n\nOne thing against another.\n\n| | |\n|---|---|\n"));
  for (const char* line :
       {"| machine | Processor 9000, 2 cores, 24 GiB |", "| instructions | AVX3 |",
        "| system | Linux 6.1.0 x86_64 |", "| load before | 0.25 running threads |",
        "| commit | 0123456789ab |", "| date | 2025-01-31 12:00 UTC |",
        "| command | `ptcbench sample -o charts` |", "| runs | 5 |"}) {
    CHECK_THAT(text, Catch::Contains(std::string("\n") + line + "\n"));
  }
  CHECK_THAT(text, Catch::Contains("\n| city | 2.0 [1.0, 4.0] |\n| dark | - |\n"));
  CHECK_THAT(text, Catch::Contains("\nA note.\n"));
  CHECK_THAT(text, Catch::Contains("[![A chart](sample-city.svg)](sample-city.png)"));
}

TEST_CASE("results: few runs and a changed tree are stated, and only these", "[bench][results]") {
  const std::string sound = results_text(report(5), circumstances(false));
  CHECK(sound.find("**") == std::string::npos);
  const std::string few = results_text(report(4), circumstances(false));
  CHECK_THAT(few, Catch::Contains("**Fewer than 5 runs (4)**"));
  CHECK(few.find("not committed") == std::string::npos);
  const std::string counted = results_text(report(0), circumstances(false));
  CHECK(counted.find("Fewer") == std::string::npos);
  CHECK_THAT(counted, Catch::Contains("| runs | 1, of counts that do not vary |"));
  const std::string changed = results_text(report(5), circumstances(true));
  CHECK_THAT(changed, Catch::Contains("| commit | 0123456789ab with changes |") &&
                          Catch::Contains("not committed"));
  CHECK(changed.find("Fewer") == std::string::npos);
}

TEST_CASE("results: a command keeps only the file names of paths", "[bench][results]") {
  CHECK(command_of({"/usr/bin/ptcbench", "error", "/home/me/dragon.ply.gz+backdrop", "--points",
                    "200k", "-o", "/tmp/charts/", "--temp=/scratch/mine", "-o/tmp/charts"}) ==
        "ptcbench error dragon.ply.gz+backdrop --points 200k -o charts --temp=mine -ocharts");
  CHECK(command_of({"ptcbench", "error", "/home/me/my scan.ply"}) ==
        "ptcbench error 'my scan.ply'");
}

TEST_CASE("results: the circumstances name the machine, but not the host", "[bench][results]") {
  std::string program = "ptcbench";
  char* const command[] = {program.data()};
  const Circumstances found = circumstances_of(command, "given");
  CHECK(!found.processor.empty());
  CHECK(found.cores > 0);
  CHECK(found.memory_bytes > 0);
  CHECK(!found.instructions.empty());
  CHECK(found.commit.find("dirty") == std::string::npos);
  CHECK(!found.commit.empty());
  CHECK_THAT(found.date, Catch::Matches("[0-9]{4}-[0-9]{2}-[0-9]{2} [0-9]{2}:[0-9]{2}"));
  CHECK(found.command == "ptcbench");
  CHECK_THAT(found.system, Catch::StartsWith("Linux "));
}

TEST_CASE("results: the file and its charts are written whole, even over an older one",
          "[bench][results]") {
  const test::TemporaryDirectory dir;
  std::ofstream(dir / "sample.md") << "older";
  write_results(dir.path(), report(5), circumstances(false));
  CHECK(slurp(dir / "sample.md") == results_text(report(5), circumstances(false)));
  CHECK_THAT(slurp(dir / "sample-city.svg"), Catch::Contains("</svg>"));
  CHECK(slurp(dir / "sample-city.png").starts_with("\x89PNG"));
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(dir.path())) {
    static_cast<void>(entry);
    ++files;
  }
  CHECK(files == 3);
}

TEST_CASE("results: pictures are written beside the text, which shows them", "[bench][results]") {
  const test::TemporaryDirectory dir;
  Report seen = report(5);
  seen.sheets = {{.part = "room", .caption = "A room.", .image = {2, 1, {{1, 0, 0}, {0, 1, 0}}}}};
  write_results(dir.path(), seen, circumstances(false));
  CHECK_THAT(slurp(dir / "sample.md"),
             Catch::Contains("\nA room.\n\n![A room.](sample-room.png)\n"));
  const Image image = read_image(dir / "sample-room.png");
  REQUIRE(image.width == 2);
  CHECK(image.pixels == seen.sheets[0].image.pixels);
}

TEST_CASE("results: a part of the report without values is left out", "[bench][results]") {
  Report empty = report(5);
  empty.tables.push_back(
      {.caption = {.name = "laws", .title = "Laws"}, .headings = {{"exponent", {"exponent"}}}});
  CHECK(results_text(empty, circumstances(false)).find("Laws") == std::string::npos);
  CHECK(text_of(empty).find("Laws") == std::string::npos);
  CHECK(facts_of(empty).at("laws").empty());
}
