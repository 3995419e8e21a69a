// The experiment `ptcbench verify`: time and memory of a verification at each level, compared with
// reading the file.
#include <array>
#include <fstream>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/disk_space.h"
#include "engine/parallel/thread_pool.h"
#include "engine/verify/verify.h"
#include "tools/bench/experiments/disk_reads.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/growth.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

constexpr char kVerifyReading[] =
    "Verification of a sound container of the procedural city at each level: 0 checks header and "
    "superblocks, 1 also directory and page headers, 2 also the checksum of every byte, 3 also the "
    "content of pages and every node against its points, 4 also builds the tree again and compares "
    "it bit by bit. Read: one thread reads the file from end to end. Warm: the file is in the "
    "system's cache; cold: it is not. Peak memory is what a run adds to the program.";

constexpr std::array kLevels{VerifyLevel::commit, VerifyLevel::directory, VerifyLevel::payload,
                             VerifyLevel::content, VerifyLevel::rebuild};

/// What `ptcbench verify` measures.
struct VerifyBenchOptions {
  std::uint64_t points = 20'000'000;  ///< points of the city
  unsigned repeats = 5;
};

/// One level, or reading, with a warm or cold cache.
struct VerifyRow {
  std::string work;    ///< "level N", or "read"
  std::string system;  ///< "warm" or "cold"
  std::uint64_t points = 0, file_bytes = 0;
  unsigned threads = 0;
  std::uint64_t memory_bytes = 0;  ///< cap; 0 for reading
  Spread wall, cpu;                ///< seconds
  std::uint64_t resident_bytes = 0;
};

const Columns<VerifyRow>& verify_columns() {
  using R = VerifyRow;
  static const Columns<R> columns{
      {"work", {"work"}, &R::work},
      {"system", {"system's cache"}, &R::system},
      {"points", {"points"}, &R::points},
      {"file_bytes", {"file MB", "{:.1f}", 1e6}, &R::file_bytes},
      {"threads", {"threads"}, &R::threads},
      {"memory_bytes",
       {"cap MiB", "{:.0f}", kMebi},
       [](const R& r) { return when(r.memory_bytes > 0, r.memory_bytes); }},
      {"wall_seconds", {"wall s", "{:.4f}"}, &R::wall},
      {"cpu_seconds", {"CPU s", "{:.4f}"}, &R::cpu},
      {"bytes_per_second",
       {"file GB/s", "{:.2f}", kGiga},
       [](const R& r) { return static_cast<double>(r.file_bytes) / r.wall.median; }},
      {"resident_bytes", {"peak memory MiB", "{:.1f}", kMebi}, &R::resident_bytes}};
  return columns;
}

/// Reads a file from end to end.
void read_through(const std::filesystem::path& path) {
  std::vector<char> block(std::size_t{1} << 20);
  std::ifstream file(path, std::ios::binary);
  while (file.read(block.data(), static_cast<std::streamsize>(block.size()))) {
  }
}

/// One kind of work on a container, and the times of its runs.
class VerifyRun {
 public:
  /// @param level  none: the file is only read
  /// @param cold   the file leaves the system's cache before each run
  VerifyRun(const std::filesystem::path& container, std::optional<VerifyLevel> level, bool cold,
            const RunOptions& run)
      : container_(container), level_(level), cold_(cold), run_(run) {}

  void run(const Superblock& expected) {
    if (cold_) forget(InputFile(container_));
    Progress silent;
    VerifyReport report;
    times_.run([&] {
      if (!level_) return read_through(container_);
      const VerifyOptions options{
          .level = *level_, .memory_bytes = run_.memory_bytes, .threads = run_.threads};
      report = verify_container(container_, options, silent);
    });
    const bool counts = level_ >= VerifyLevel::content;
    if (!report.sound() || (counts && report.points != expected.points))
      throw DataError("the container that was built is not sound");
  }

  [[nodiscard]] VerifyRow row(const Superblock& container) const {
    return {.work = level_ ? fmt::format("level {}", static_cast<int>(*level_)) : "read",
            .system = cold_ ? "cold" : "warm",
            .points = container.points,
            .file_bytes = container.file_bytes,
            .threads = level_ ? ThreadPool(run_.threads).threads() : 1,
            .memory_bytes = level_ ? run_.memory_bytes : 0,
            .wall = spread_of(times_.wall),
            .cpu = spread_of(times_.cpu),
            .resident_bytes = times_.resident};
  }

 private:
  const std::filesystem::path& container_;
  std::optional<VerifyLevel> level_;
  bool cold_;
  const RunOptions& run_;
  TimedRuns times_;
};

Report measure(const VerifyBenchOptions& options, const Bench& bench) {
  // Build the container
  require_room({&bench.work, 1}, build_disk_bytes(options.points),
               fmt::format("{} points", options.points));
  const WorkFile file(bench.work, ".ptcx");
  const Superblock container = build_container({.city_points = options.points, .run = bench.run},
                                               file.path(), bench.progress)
                                   .superblock;
  // Run all levels in turn, warm and cold
  std::vector<VerifyRun> runs;
  for (const bool cold : {false, true}) {
    for (const VerifyLevel level : kLevels) runs.emplace_back(file.path(), level, cold, bench.run);
    runs.emplace_back(file.path(), std::nullopt, cold, bench.run);
  }
  bench.progress.begin("verify", options.repeats * runs.size(), "runs");
  read_through(file.path());
  for (unsigned repeat = 0; repeat < options.repeats; ++repeat) {
    for (VerifyRun& run : runs) {
      run.run(container);
      bench.progress.advance(1);
    }
  }
  bench.progress.end();
  std::vector<VerifyRow> rows;
  for (const VerifyRun& run : runs) rows.push_back(run.row(container));
  return {.name = "verify",
          .title = "Time and memory of a verification at each level",
          .reading = kVerifyReading,
          .runs = options.repeats,
          .tables = {tabulate<VerifyRow>({.name = "rows"}, verify_columns(), rows)}};
}

}  // namespace

Experiment make_verify_experiment() {
  const auto options = std::make_shared<VerifyBenchOptions>();
  const auto declare = [options](Declaration& d) {
    d.city_points(options->points, "20M", 200'000);
    d.repeats(options->repeats, 3);
  };
  return {
      .name = "verify",
      .purpose = "Time and memory of a verification at each level, compared with reading the file",
      .quick = "A few seconds: 200k points, 3 runs",
      .declare = declare,
      .run = [options](const Bench& bench) { return measure(*options, bench); }};
}

}  // namespace ptc::bench
