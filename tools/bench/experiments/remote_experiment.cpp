// The experiment `ptcbench remote`: requests and bytes that views of a container take when it is
// read in ranges.
#include <memory>

#include <fmt/format.h>

#include "engine/io/file/disk_space.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/growth.h"
#include "tools/bench/experiments/remote.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

constexpr char kRemoteReading[] =
    "Views of the procedural city, read in ranges as over a network by a reader that keeps nothing "
    "of the file but what it asked for. A row counts all requests since the file was opened. A "
    "round is a set of requests that can be sent together. Outside: the eye is 1.05 diagonals from "
    "the centre and sees the whole city. Inside: the eye is in the city's middle and sees a cone "
    "of "
    "57 degrees. Nodes that look largest are divided first; none that stays whole looks more than "
    "1.4 times as large as the smallest that was divided. Whole directory: what a reader asks for "
    "that opens the file with every rule. The counts are exact: no row has a spread.";

/// What `ptcbench remote` measures.
struct RemoteOptions {
  std::uint64_t points = 200'000'000;  ///< points of the city
  std::vector<std::size_t> nodes{500, 10'000, 50'000};
};

/// What it took until a view had as many nodes as asked.
struct RemoteRow {
  std::string view;
  std::size_t asked = 0, chosen = 0;  ///< nodes; 0: the file was opened, no more
  std::uint64_t requests = 0, bytes = 0;
  unsigned rounds = 0;
  std::uint64_t points = 0, node_pages = 0, file_bytes = 0;
  std::uint64_t directory = 0;  ///< bytes of the directory
};

const Columns<RemoteRow>& remote_columns() {
  using R = RemoteRow;
  static const Columns<R> columns{
      {"view", {"view"}, &R::view},
      {"asked", {"nodes asked"}, &R::asked},
      {"nodes", {"nodes"}, &R::chosen},
      {"requests", {"requests"}, &R::requests},
      {"rounds", {"rounds"}, &R::rounds},
      {"bytes", {"KB", "{:.1f}", 1e3}, &R::bytes},
      {"points", {"points"}, &R::points},
      {"node_pages", {"node pages"}, &R::node_pages},
      {"file_bytes", {"file MB", "{:.1f}", 1e6}, &R::file_bytes},
      {"directory_bytes", {"whole directory KB", "{:.1f}", 1e3}, &R::directory}};
  return columns;
}

std::vector<RemoteRow> rows_of(const std::filesystem::path& container,
                               const RemoteOptions& options) {
  const InputFile file(container);
  FileRanges ranges(file);
  std::vector<RemoteRow> rows;
  const auto add = [&](const Superblock& s, const CountingRanges& source, RemoteRow row) {
    row.requests = source.requests();
    row.bytes = source.bytes();
    row.points = s.points;
    row.node_pages = s.node_pages;
    row.file_bytes = s.file_bytes;
    row.directory = directory_bytes(s.header, s.page_count);
    rows.push_back(std::move(row));
  };
  CountingRanges opening(ranges);
  const PartialReader opened(opening);
  add(opened.superblock(), opening, {.view = "opened", .rounds = opened.rounds()});
  for (const ConeView& view : views_of(opened.superblock())) {
    CountingRanges source(ranges);
    PartialReader scene(source);
    ViewChoice choice(scene, view);
    for (const std::size_t nodes : options.nodes) {
      const std::size_t chosen = choice.choose(nodes);
      add(scene.superblock(), source,
          {.view = view.name, .asked = nodes, .chosen = chosen, .rounds = scene.rounds()});
    }
  }
  return rows;
}

Report measure(const RemoteOptions& options, const Bench& bench) {
  require_room({&bench.work, 1}, build_disk_bytes(options.points),
               fmt::format("{} points", options.points));
  const WorkFile file(bench.work, ".ptcx");
  static_cast<void>(build_container({.city_points = options.points, .run = bench.run}, file.path(),
                                    bench.progress));
  return {.name = "remote",
          .title = "Requests and bytes of views that are read in ranges",
          .reading = kRemoteReading,
          .runs = 1,
          .tables = {tabulate<RemoteRow>({.name = "rows"}, remote_columns(),
                                         rows_of(file.path(), options))}};
}

}  // namespace

Experiment make_remote_experiment() {
  const auto options = std::make_shared<RemoteOptions>();
  const auto declare = [options](Declaration& d) {
    d.city_points(options->points, "200M", 1'000'000);
  };
  return {.name = "remote",
          .purpose = "Requests and bytes that views of a container take when it is read in ranges",
          .quick = "A few seconds: 1M points",
          .declare = declare,
          .run = [options](const Bench& bench) { return measure(*options, bench); }};
}

}  // namespace ptc::bench
