// For each size, every run goes once through all stages and limits. Container and records are never
// on the disk together:
//
//   build -> scene -> verify -> shade -> values      limits: build floor, verify floor, memcpy
//   |<------- container on the disk ------->|        |<---- records on the disk ---->|
#include "tools/bench/experiments/scale_bench.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include <fmt/format.h>

#include "engine/base/memory.h"
#include "engine/io/file/disk_space.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/build/build_space.h"
#include "engine/sort/spill.h"
#include "engine/verify/verify.h"
#include "tools/bench/experiments/bench_run.h"
#include "tools/bench/experiments/disk_reads.h"
#include "tools/bench/experiments/scale_answers.h"
#include "tools/bench/experiments/stored_bytes.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/scenes/record_file.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

// Bytes of one memcpy, far more than the caches of processors hold.
constexpr std::size_t kCopiedBytes = std::size_t{64} << 20;

/// The runs of one stage, and the bytes read from the disk in the last run.
struct StageRuns {
  TimedRuns times;
  std::uint64_t disk_bytes = 0;

  template <class Body>
  void run(const Body& body) {
    const std::uint64_t before = bench::disk_bytes();
    times.run(body);
    disk_bytes = bench::disk_bytes() - before;
  }
};

/// All runs of one size.
struct SizeRuns {
  StageRuns build, verify, shade, build_floor, verify_floor, copy;
  BuildReport built;
  StoredBytes stored;
  LightingReport shaded;
  bool rebuilt = false;
  ScaleAnswers answers;  ///< answers of the first run
};

/// Runs all sizes that were asked for.
class ScaleRun : BenchRun<ScaleOptions, ScaleRow> {
 public:
  using BenchRun::BenchRun;

  std::vector<ScaleRow> measure() {
    run_.temp_dirs = {work_};
    tell_space(options_.points.back());
    for (const std::uint64_t points : options_.points) {
      SizeRuns runs;
      progress_.begin(fmt::format("{} points", points), 6 * options_.repeats, "stages");
      for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
        const ScaleAnswers answers = run_stages(points, runs, repeat == 0);
        if (repeat == 0) runs.answers = answers;
        require_same(runs.answers, answers);
        run_limits(runs);
      }
      progress_.end();
      add_rows(runs);
      report();
    }
    return std::move(rows_);
  }

 private:
  /// Checks the room for the largest size, and notes it. Spilled records are deleted as the
  /// container grows, so the maximum on the disk is the larger one of both.
  void tell_space(std::uint64_t points) {
    // A city has up to 5 % more points.
    const std::uint64_t spilled = points * kSpilledBytes * 21 / 20;
    require_room({&work_, 1}, spilled, fmt::format("{} points", points));
    progress_.note(
        space_text(require_build_space(points, spilled, Profile::compact, {&work_, 1}, scene_),
                   {&work_, 1}, scene_));
  }

  template <class Body>
  void stage(StageRuns& runs, const Body& body) {
    runs.run(body);
    progress_.advance(1);
  }

  /// Runs the three stages once, and checks the container. @return their answers
  ScaleAnswers run_stages(std::uint64_t points, SizeRuns& runs, bool first) {
    // Build
    Progress silent;
    stage(runs.build, [&] {
      runs.built = build_container({.city_points = points, .run = run_}, scene_, silent);
    });
    // Verify from the disk
    forget(InputFile(scene_));
    VerifyReport report;
    VerifyOptions verification{
        .level = VerifyLevel::payload, .memory_bytes = run_.memory_bytes, .threads = run_.threads};
    stage(runs.verify, [&] { report = verify_container(scene_, verification, silent); });
    require_whole(report, points, runs.built.sort.points);
    const std::uint64_t made = report.superblock->points;
    // Build the tree of the first container again, unless it is large
    if (first) {
      if (made <= kVerifiedWhole) {
        verification.level = VerifyLevel::rebuild;
        report = verify_container(scene_, verification, silent);
        require_whole(report, points, runs.built.sort.points);
        runs.rebuilt = report.tree_digest.has_value();
      }
      runs.stored = stored_bytes(ContainerReader(scene_));
    }
    // Shade from the disk
    forget(InputFile(scene_));
    ShadeRequest request{{.scene = scene_, .run = run_}};
    request.count = options_.receivers;
    stage(runs.shade, [&] { runs.shaded = shade_container(request, lit_, silent); });
    std::filesystem::remove(scene_);
    const std::uint64_t values = digest_of_values(lit_, std::min(options_.receivers, made));
    std::filesystem::remove(lit_);
    return {.points = made, .content = report.superblock->content_xxh3, .values = values};
  }

  /// Runs the limits once: the disk alone and the memory alone, while no container is on the disk.
  void run_limits(SizeRuns& runs) {
    const std::uint64_t spilled = runs.built.sort.spilled_bytes,
                        container = runs.built.superblock.file_bytes;
    RecordFile file(work_);
    stage(runs.build_floor, [&] {
      file.fill((spilled > 0 ? spilled : container) / sizeof(PointRecord));
      if (spilled > 0) file.copy_to(file, container);
    });
    stage(runs.verify_floor, [&] { file.copy_to(file, 0); });
    const Arena from(kCopiedBytes), to(kCopiedBytes);
    for (const Arena* arena : {&from, &to}) std::memset(arena->data(), 1, kCopiedBytes);
    stage(runs.copy, [&] {
      for (std::uint64_t left = runs.answers.points * sizeof(PointRecord); left > 0;) {
        const std::size_t now = std::min<std::uint64_t>(left, kCopiedBytes);
        std::memcpy(to.data(), from.data(), now);
        left -= now;
      }
    });
  }

  ScaleRow& add_row(const char* stage, const SizeRuns& all, const StageRuns& runs,
                    unsigned threads) {
    return rows_.emplace_back(ScaleRow{.stage = stage,
                                       .points = all.answers.points,
                                       .threads = threads,
                                       .wall = spread_of(runs.times.wall),
                                       .cpu = spread_of(runs.times.cpu),
                                       .resident_bytes = runs.times.resident,
                                       .disk_bytes = runs.disk_bytes});
  }

  void add_rows(const SizeRuns& runs) {
    const unsigned threads = ThreadPool(run_.threads).threads();
    const Superblock& made = runs.built.superblock;
    ScaleRow& build = add_row("build", runs, runs.build, threads);
    build.memory_bytes = run_.memory_bytes;
    build.spilled_bytes = runs.built.sort.spilled_bytes;
    build.file_bytes = made.file_bytes;
    build.moved_bytes = 2 * build.spilled_bytes + made.file_bytes;
    build.nodes = made.nodes;
    build.bytes_per_point = runs.stored.per_point;
    build.bytes_per_node = runs.stored.per_node;
    const std::uint64_t moved = build.moved_bytes;
    ScaleRow& verify = add_row("verify", runs, runs.verify, threads);
    verify.memory_bytes = run_.memory_bytes;
    verify.moved_bytes = made.file_bytes;
    verify.rebuilt = runs.rebuilt;
    ScaleRow& shade = add_row("shade", runs, runs.shade, threads);
    shade.memory_bytes = run_.memory_bytes;
    shade.receivers = runs.shaded.receivers;
    const CacheStatistics& cache = runs.shaded.cache;
    shade.moved_bytes = cache.bytes_read;
    shade.hits = cache.lookups - cache.misses;
    shade.misses = cache.misses;
    shade.cap_share = static_cast<double>(cache.frames) / made.page_count;
    add_row("build floor", runs, runs.build_floor, kTransfers).moved_bytes = moved;
    add_row("verify floor", runs, runs.verify_floor, kTransfers).moved_bytes = made.file_bytes;
    add_row("memcpy", runs, runs.copy, 1).moved_bytes =
        2 * runs.answers.points * sizeof(PointRecord);
  }

  WorkFile scene_file_{work_, ".ptcx"}, lit_file_{work_, ".ply"};
  const std::filesystem::path &scene_ = scene_file_.path(), &lit_ = lit_file_.path();
};

}  // namespace

std::vector<ScaleRow> measure_scale(
    const ScaleOptions& options, const std::filesystem::path& work, const RunOptions& run,
    Progress& progress, const std::function<void(const std::vector<ScaleRow>&)>& report) {
  return ScaleRun(options, work, run, progress, report).measure();
}

}  // namespace ptc::bench
