// The scale experiment: its measurements, and that wrong answers are found.
#include <cstring>
#include <fstream>
#include <limits>
#include <system_error>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/point_writer.h"
#include "engine/sort/spill.h"
#include "tests/support/scenes.h"
#include "tools/bench/experiments/scale_answers.h"
#include "tools/bench/experiments/scale_bench.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

const std::vector<std::string> kStages{"build",       "verify",       "shade",
                                       "build floor", "verify floor", "memcpy"};

ScaleOptions small() {
  return {.points = {20'000, 60'000}, .receivers = 500, .repeats = 2};
}

/// Changes the files of a bench after one of its stages, and collects its notes.
class Meddler : public Progress {
 public:
  explicit Meddler(std::uint64_t stage = 0, std::function<void()> meddle = {})
      : stage_(stage), meddle_(std::move(meddle)) {}
  void begin(const std::string&, std::uint64_t total, const std::string&) override {
    total_ += total;
  }
  void advance(std::uint64_t count) override {
    done_ += count;
    if (done_ == stage_) meddle_();
  }
  void note(const std::string& text) override {
    CHECK(total_ == 0);  // before any work
    notes_ += text;
  }
  [[nodiscard]] const std::string& notes() const { return notes_; }
  [[nodiscard]] std::uint64_t total() const { return total_; }
  [[nodiscard]] std::uint64_t done() const { return done_; }

 private:
  std::uint64_t stage_, total_ = 0, done_ = 0;
  std::function<void()> meddle_;
  std::string notes_;
};

std::filesystem::path file_in(const std::filesystem::path& directory, const char* ending) {
  for (const auto& file : std::filesystem::directory_iterator(directory)) {
    if (file.path().extension() == ending) return file.path();
  }
  throw std::logic_error("no such file");
}

/// Checks that a bench whose files are changed says what is wrong and leaves nothing.
/// @param stage  stage after which they are changed; a run has six
void require_found(std::uint64_t stage,
                   const std::function<void(const std::filesystem::path& file)>& meddle,
                   const std::string& what, const char* ending = ".ptcx") {
  const test::TemporaryDirectory dir;
  Meddler meddler(stage, [&] { meddle(file_in(dir.path(), ending)); });
  ScaleOptions options = small();
  options.points = {20'000};
  CHECK_THROWS_WITH(measure_scale(options, dir.path(), {.threads = 2}, meddler),
                    Catch::Contains(what));
  CHECK(std::filesystem::is_empty(dir.path()));
}

void build_city(const std::filesystem::path& target, std::uint64_t points,
                std::uint32_t leaf_points = BuildOptions{}.leaf_points) {
  Progress silent;
  build_container({.city_points = points, .tree = {.leaf_points = leaf_points}}, target, silent);
}

void damage(const std::filesystem::path& container) {
  std::fstream stream(container, std::ios::in | std::ios::out | std::ios::binary);
  const auto middle = static_cast<std::streamoff>(std::filesystem::file_size(container) / 2);
  stream.seekg(middle);
  const char other = static_cast<char>(stream.get() ^ 1);
  stream.seekp(middle);
  stream.put(other);
}

/// Makes the last value of a binary PLY a NaN.
void spoil(const std::filesystem::path& ply) {
  std::fstream stream(ply, std::ios::in | std::ios::out | std::ios::binary);
  const float none = std::numeric_limits<float>::quiet_NaN();
  stream.seekp(-static_cast<std::streamoff>(sizeof none), std::ios::end);
  stream.write(reinterpret_cast<const char*>(&none), sizeof none);
}

/// Writes a PLY of two points with a channel of floats.
std::filesystem::path write_values(const std::filesystem::path& target, float second) {
  const std::vector<Surfel> surfels(
      2, Surfel{.position = {1, 2, 3}, .normal = {0, 0, 1}, .radius = 1});
  const std::vector<float> values{1, second};
  const auto writer = create_points(target, OutputFormat::ply,
                                    {.count = 2,
                                     .channels = {{.name = "light", .type = ChannelType::f32}},
                                     .has_normals = true,
                                     .has_radius = true});
  writer->write(surfels, std::as_bytes(std::span(values)));
  writer->finish();
  return target;
}

VerifyReport report_of(std::uint64_t points) {
  VerifyReport report;
  report.superblock.emplace().points = points;
  return report;
}

}  // namespace

TEST_CASE("scale: there is a row for every stage and limit of every size", "[bench][scale]") {
  const test::TemporaryDirectory dir;
  Meddler progress;
  std::size_t reported = 0;
  const std::vector<ScaleRow> rows =
      measure_scale(small(), dir.path(), {.threads = 2}, progress,
                    [&](const std::vector<ScaleRow>& r) { reported = r.size(); });
  CHECK(std::filesystem::is_empty(dir.path()));
  CHECK_THAT(progress.notes(), Catch::Contains("GB free") && Catch::Contains(dir.path().string()));
  CHECK(progress.done() == progress.total());
  REQUIRE(rows.size() == 12);
  CHECK(reported == 12);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const ScaleRow& row = rows[i];
    INFO(row.stage << " " << row.points);
    CHECK(row.stage == kStages[i % 6]);
    CHECK(row.points == Approx(i < 6 ? 20'000 : 60'000).epsilon(0.05));
    CHECK(row.wall.low > 0);
    CHECK(row.wall.high > row.wall.low);  // two runs
    CHECK((row.memory_bytes > 0) == (i % 6 < 3));
    CHECK((row.receivers == 500) == (row.stage == "shade"));
    CHECK(row.items() == (row.stage == "shade" ? 500 : row.points));
  }
  for (std::size_t size = 0; size < 12; size += 6) {
    const ScaleRow &build = rows[size], &verify = rows[size + 1], &shade = rows[size + 2];
    CHECK(build.spilled_bytes == 0);
    CHECK(build.moved_bytes == build.file_bytes);
    CHECK(build.bytes_per_point > 6);
    CHECK(build.bytes_per_point < 12);
    CHECK(build.bytes_per_node < 40);
    CHECK(static_cast<double>(build.points) * build.bytes_per_point +
              static_cast<double>(build.nodes) * build.bytes_per_node <
          static_cast<double>(build.file_bytes));
    CHECK(verify.moved_bytes == build.file_bytes);
    CHECK(verify.rebuilt);
    CHECK(shade.hits > 1000);
    CHECK(shade.misses > 0);
    CHECK(shade.moved_bytes > 0);
    CHECK(shade.moved_bytes <= build.file_bytes);
    CHECK(shade.cap_share == 1);
    CHECK(rows[size + 3].moved_bytes == build.moved_bytes);
    CHECK(rows[size + 4].moved_bytes == build.file_bytes);
    CHECK(rows[size + 5].moved_bytes == 80 * build.points);
    if (rows[size + 4].disk_bytes == 0) continue;  // the system does not count this disk
    CHECK(verify.disk_bytes > build.file_bytes / 2);
    CHECK(shade.disk_bytes > shade.moved_bytes / 2);
  }
}

TEST_CASE("scale: points beyond the cap are spilled, and every stage stays below it",
          "[bench][scale]") {
  const test::TemporaryDirectory dir;
  Progress silent;
  const ScaleOptions options{.points = {1'500'000}, .receivers = 100, .repeats = 1};
  const RunOptions run{.memory_bytes = std::uint64_t{116} << 20, .threads = 2};
  const std::vector<ScaleRow> rows = measure_scale(options, dir.path(), run, silent);
  REQUIRE(rows.size() == 6);
  CHECK(rows[0].spilled_bytes >=
        kSpilledBytes * rows[0].points);  // and the padding of the last blocks on the disk
  CHECK(rows[0].spilled_bytes == Approx(kSpilledBytes * rows[0].points).epsilon(0.001));
  CHECK(rows[0].moved_bytes == 2 * rows[0].spilled_bytes + rows[0].file_bytes);
  CHECK(rows[3].moved_bytes == rows[0].moved_bytes);
  if (rows[3].disk_bytes > 0)
    CHECK(rows[3].disk_bytes == Approx(rows[0].spilled_bytes).epsilon(0.02));
  if (rows[4].disk_bytes > 0) CHECK(rows[4].disk_bytes == Approx(rows[0].file_bytes).epsilon(0.02));
  CHECK(rows[2].cap_share < 1);
  for (std::size_t i = 0; i < 3; ++i) CHECK(rows[i].resident_bytes < run.memory_bytes);
}

TEST_CASE("scale: a disk too small for the largest size is refused before anything is built",
          "[bench][scale]") {
  const test::TemporaryDirectory dir;
  Meddler progress;
  ScaleOptions options = small();
  options.points.push_back(std::uint64_t{1} << 46);
  CHECK_THROWS_AS(measure_scale(options, dir.path(), {.threads = 1}, progress), std::system_error);
  CHECK_THROWS_WITH(measure_scale(options, dir.path(), {.threads = 1}, progress),
                    Catch::Contains(dir.path().string()) && Catch::Contains("GB free") &&
                        Catch::Contains("`run.temp_dirs`"));
  CHECK(progress.total() == 0);
  CHECK(std::filesystem::is_empty(dir.path()));
}

TEST_CASE("scale: damaged or exchanged files are found, and none is left", "[bench][scale]") {
  require_found(1, damage, "not sound");
  require_found(2, damage, "not sound");  // by the verification at level 4
  require_found(7, damage, "not sound");  // in the second run
  require_found(3, spoil, "is not finite", ".ply");
  require_found(
      1, [](const auto& file) { build_city(file, 22'000); }, "went through the sort");
  require_found(
      7, [](const auto& file) { build_city(file, 20'000, 3); }, "another container");
  require_found(
      8, [](const auto& file) { build_city(file, 22'000); }, "other values");
}

TEST_CASE("scale: answers that differ are found", "[bench][scale]") {
  const ScaleAnswers first{.points = 1, .content = {2, 3}, .values = 4};
  CHECK_NOTHROW(require_same(first, first));
  CHECK_THROWS_WITH(require_same(first, {2, {2, 3}, 4}),
                    Catch::Contains("another number of points"));
  CHECK_THROWS_WITH(require_same(first, {1, {2, 4}, 4}), Catch::Contains("another container"));
  CHECK_THROWS_WITH(require_same(first, {1, {2, 3}, 5}), Catch::Contains("other values"));
}

TEST_CASE("scale: a city has the requested number of points within 5 %", "[bench][scale]") {
  for (const std::uint64_t points :
       {std::uint64_t{9'500}, std::uint64_t{10'000}, std::uint64_t{10'500}}) {
    CHECK_NOTHROW(require_whole(report_of(points), 10'000, points));
  }
  for (const std::uint64_t points : {std::uint64_t{9'499}, std::uint64_t{10'501}}) {
    CHECK_THROWS_AS(require_whole(report_of(points), 10'000, points), DataError);
  }
  CHECK_THROWS_WITH(require_whole(report_of(10'000), 10'000, 10'001),
                    Catch::Contains("10001 went through the sort"));
  VerifyReport damaged = report_of(10'000);
  damaged.damage = 1;
  damaged.findings.emplace_back();
  CHECK_THROWS_WITH(require_whole(damaged, 10'000, 10'000), Catch::Contains("not sound"));
}

TEST_CASE("scale: values must be finite and complete, and different values have different digests",
          "[bench][scale]") {
  const test::TemporaryDirectory dir;
  const std::filesystem::path file = dir / "values.ply";
  const std::uint64_t one = digest_of_values(write_values(file, 1), 2);
  CHECK(digest_of_values(write_values(file, 1), 2) == one);
  CHECK(digest_of_values(write_values(file, 1.0000001F), 2) != one);
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    CHECK_THROWS_WITH(digest_of_values(write_values(file, bad), 2),
                      Catch::Contains("values.ply: point 1: light is not finite"));
  }
  write_values(file, 1);
  for (const std::uint64_t count : {std::uint64_t{1}, std::uint64_t{3}}) {
    CHECK_THROWS_WITH(digest_of_values(file, count),
                      Catch::Contains("values.ply: not the values of"));
  }
  std::ofstream(dir / "none.ply") << "ply\n";
  CHECK_THROWS_WITH(digest_of_values(dir / "none.ply", 0), Catch::Contains("no end_header"));
}
