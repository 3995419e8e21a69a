// The input is written once for each size; then builds and the floor take turns, so that they share
// whatever else the disk does at the time:
//
//   run 1:  compact   fast   floor      run 2:  compact   fast   floor      ...
//
//   build   input file -> ExternalSorter -> round_points -> build_pages -> container
//   floor   input file -> a file of the spilled bytes -> a file of the container's bytes
#include "tools/bench/experiments/build_bench.h"

#include <array>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/disk_space.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/run.h"
#include "engine/store/reader.h"
#include "engine/store/writer.h"
#include "engine/verify/verify.h"
#include "tools/bench/experiments/bench_run.h"
#include "tools/bench/experiments/stored_bytes.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/scenes/record_file.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

/// The records of a city in a file, and what a build must know about them.
struct Input {
  RecordFile file;
  Frame frame;
  std::vector<MortonKey> sample;
};

/// The sizes and the content of one build.
struct Built {
  std::uint64_t spilled = 0, file_bytes = 0, nodes = 0;
  std::array<std::uint64_t, 2> content{};  ///< digest (Superblock::content_xxh3)
  StoredBytes stored;
};

/// Runs all builds that were asked for.
class BuildRun : BenchRun<BuildBenchOptions, BuildRow> {
 public:
  using BenchRun::BenchRun;

  std::vector<BuildRow> measure() {
    for (const std::uint64_t points : options_.points) {
      const Input input = make_input(points);
      for (const std::string& panel : options_.panels) {
        if (panel == "points") at_cap(panel, input, run_.memory_bytes);
        if (panel == "points" || points != options_.points.back()) continue;
        for (const std::uint64_t cap : options_.caps) at_cap(panel, input, cap);
      }
    }
    return std::move(rows_);
  }

 private:
  [[nodiscard]] Input make_input(std::uint64_t points) {
    // Room for the input, the spilled records and the container; a city has up to 5 % more points
    constexpr std::uint64_t kFiles = 3;
    require_room({&work_, 1}, kFiles * points * sizeof(PointRecord) * 21 / 20,
                 fmt::format("{} records", points));
    Input input{.file = RecordFile(work_), .frame = {}, .sample = {}};
    RecordWriter writer(input.file);
    progress_.begin("write input", points, "records");
    input.frame = for_each_city_record(points, [&](std::span<const PointRecord> block) {
      writer.write(block);
      progress_.advance(block.size());
    });
    writer.finish();
    progress_.end();
    input.sample = sample_of(input.file);
    return input;
  }

  /// Runs all profiles and the floor under one cap, and adds their rows.
  void at_cap(const std::string& panel, const Input& input, std::uint64_t cap) {
    // Run profiles and floor in turn
    std::map<std::string, std::pair<TimedRuns, Built>> methods;
    TimedRuns floor;
    progress_.begin("build", options_.repeats * options_.profiles.size(), "runs");
    for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
      for (const std::string& profile : options_.profiles) {
        auto& [times, built] = methods[profile];
        Built now;
        times.run(
            [&] { now = build(input, profile == "fast" ? Profile::fast : Profile::compact, cap); });
        if (repeat == 0) require_right(input, profile, built = now);
        std::filesystem::remove(target_);
        progress_.advance(1);
      }
      const Built& moved = methods.begin()->second.second;
      floor.run([&] {
        RecordFile between(work_), output(work_);
        if (moved.spilled > 0) input.file.copy_to(between, moved.spilled);
        (moved.spilled > 0 ? between : input.file).copy_to(output, moved.file_bytes);
      });
    }
    progress_.end();
    // Add a row for each profile, and one for the floor
    for (const auto& [profile, result] : methods) {
      const auto& [times, built] = result;
      BuildRow& row = add_row(panel, profile, input, times);
      row.memory_bytes = cap;
      row.moved_bytes = input.file.bytes() + 2 * built.spilled + built.file_bytes;
      row.nodes = built.nodes;
      row.bytes_per_point = built.stored.per_point;
      row.bytes_per_node = built.stored.per_node;
    }
    const Built& moved = methods.begin()->second.second;
    add_row(panel, "floor", input, floor).moved_bytes =
        input.file.bytes() + 2 * moved.spilled + moved.file_bytes;
    report();
  }

  BuildRow& add_row(const std::string& panel, const std::string& method, const Input& input,
                    const TimedRuns& times) {
    return rows_.emplace_back(BuildRow{.panel = panel,
                                       .method = method,
                                       .points = input.file.records(),
                                       .threads = executor_.threads(),
                                       .wall = spread_of(times.wall),
                                       .cpu = spread_of(times.cpu),
                                       .input_bytes = input.file.bytes(),
                                       .resident_bytes = times.peak});
  }

  /// Builds a container at target_ under a cap.
  [[nodiscard]] Built build(const Input& input, Profile profile, std::uint64_t cap) {
    // Sort the input
    Built built;
    const MemoryBudget budget = budget_of(cap, "this build");
    ExternalSorter sorter({.memory_bytes = budget.rest("the sort", kMinSortBytes),
                           .temp_dirs = {work_},
                           .expected = input.file.records()},
                          executor_, input.sample);
    {
      RecordReader reader(input.file);
      for (std::span<const PointRecord> block = reader.next(); !block.empty();
           block = reader.next())
        sorter.add(block);
    }
    // Build the tree and write the container
    ContainerWriter writer(target_, {.codec = codec_of(profile), .frame = input.frame});
    const std::unique_ptr<PointStream> sorted = sorter.finish();
    const std::unique_ptr<PointStream> rounded =
        round_points(*sorted, input.frame.unit(), executor_);
    Progress silent;
    const Superblock superblock =
        writer.finish({}, build_pages(*rounded, writer, {}, executor_, silent));
    built.spilled = sorter.statistics().spilled_bytes;
    built.file_bytes = superblock.file_bytes;
    built.nodes = superblock.nodes;
    built.content = superblock.content_xxh3;
    return built;
  }

  /// Checks that the container is sound, has all points and has the content of other caps; records
  /// the bytes of its pages.
  /// @throws DataError otherwise
  void require_right(const Input& input, const std::string& profile, Built& built) {
    const VerifyLevel level =
        input.file.records() <= kVerifiedWhole ? VerifyLevel::rebuild : VerifyLevel::payload;
    Progress silent;
    const VerifyReport report =
        verify_container(target_, {.level = level, .threads = run_.threads}, silent);
    if (!report.sound())
      throw DataError(fmt::format("{}: the container that was built is not sound", profile));
    if (report.superblock->points != input.file.records())
      throw DataError(
          fmt::format("{}: the container has another number of points than the input", profile));
    const auto [known, is_new] =
        contents_.try_emplace({input.file.records(), profile}, built.content);
    if (known->second != built.content)
      throw DataError(fmt::format("{}: another cap gave another container", profile));

    built.stored = stored_bytes(ContainerReader(target_));
  }

  WorkFile file_{work_, ".ptcx"};
  const std::filesystem::path& target_ = file_.path();
  ThreadPool executor_{run_.threads};
  std::map<std::pair<std::uint64_t, std::string>, std::array<std::uint64_t, 2>> contents_;
};

}  // namespace

std::vector<BuildRow> measure_build(
    const BuildBenchOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<BuildRow>&)>& report) {
  return BuildRun(options, work, run, progress, report).measure();
}

}  // namespace ptc::bench
