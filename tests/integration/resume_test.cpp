// Builds that are interrupted and continued.
#include <chrono>
#include <fstream>
#include <utility>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/ptc.h"
#include "engine/sort/spill.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

struct Interrupted {};

/// Ends the build when this many points were reported in all stages together.
class Interrupt : public Progress {
 public:
  explicit Interrupt(std::uint64_t after) : left_(static_cast<std::int64_t>(after)) {}
  void advance(std::uint64_t count) override {
    if ((left_ -= static_cast<std::int64_t>(count)) < 0) throw Interrupted();
  }

 private:
  std::int64_t left_;
};

std::size_t entries(const std::filesystem::path& directory) {
  return static_cast<std::size_t>(
      std::distance(std::filesystem::directory_iterator(directory), {}));
}

void write_cloud(const std::filesystem::path& path, std::size_t count) {
  std::ofstream out(path);
  out << "# x y z nx ny nz\n";
  for (const Surfel& s : random_surfels(count, 5)) {
    out << s.position.x << ' ' << s.position.y << ' ' << s.position.z << " 0 0 1\n";
  }
}

/// Writes pairs of a point that is not rounded and one that rounding must not move in front of it;
/// blocks of a build begin with the second of a pair.
void write_pairs(const std::filesystem::path& path, std::size_t count) {
  std::ofstream out(path);
  out.precision(17);
  out << "# x y z nx ny nz radius\n-1e-3 -1e-3 -1e-3 0 0 1 1e-30\n";
  for (const Surfel& s : random_surfels(count / 2, 5)) {
    for (const auto& [step, radius] : {std::pair(0.0, 1e-30), std::pair(1e-9, 0.5)}) {
      out << s.position.x + step << ' ' << s.position.y + step << ' ' << s.position.z + step
          << " 0 0 1 " << radius << '\n';
    }
  }
}

/// Writes points of which every third emits light.
void write_lamps(const std::filesystem::path& path, std::size_t count) {
  std::vector<Surfel> surfels = random_surfels(count, 5);
  for (std::size_t i = 0; i < count; i += 3) surfels[i].emission = {3, 2, 1};
  write_ply(path, surfels, true);
}

enum class Kind { city, cloud, pairs, lamps };

/// A city, or a cloud of the same size whose radii are estimated or known or whose points emit
/// light, with temporary files in two directories.
struct Place {
  TemporaryDirectory dir;
  BuildRequest request;
  std::filesystem::path out = dir / "o.ptcx";
  std::vector<char> whole;
  std::uint64_t points = 0;
  std::size_t before = 0;  // number of files before the build

  explicit Place(Kind kind) {
    std::filesystem::create_directory(dir / "t1");
    std::filesystem::create_directory(dir / "t2");
    if (kind == Kind::cloud) write_cloud(dir / "c.xyz", 300'000);
    if (kind == Kind::pairs) write_pairs(dir / "c.xyz", 300'000);
    if (kind == Kind::city) request.city_points = 300'000;
    if (kind == Kind::lamps) write_lamps(dir / "c.ply", 300'000);
    if (kind == Kind::cloud || kind == Kind::pairs) request.inputs = {dir / "c.xyz"};
    if (kind == Kind::lamps) request.inputs = {dir / "c.ply"};
    request.run = {.memory_bytes = std::uint64_t{300} << 20,
                   .threads = 2,
                   .temp_dirs = {dir / "t1", dir / "t2"}};
    Progress silent;
    points = build_container(request, dir / "whole.ptcx", silent).superblock.points;
    before = entries(dir.path());
    whole = bytes_of(dir / "whole.ptcx");
    request.resume = true;
    request.checkpoint_points = 1;
  }

  [[nodiscard]] bool made_whole() const { return bytes_of(out) == whole; }
  [[nodiscard]] bool clean() const {
    const std::size_t made = std::filesystem::exists(out) ? 1 : 0;
    return entries(dir / "t1") + entries(dir / "t2") == 0 && entries(dir.path()) == before + made;
  }
  void interrupt(std::uint64_t after) {
    Interrupt progress(after);
    CHECK_THROWS_AS(build_container(request, out, progress), Interrupted);
  }
};

}  // namespace

TEST_CASE("resume: a build that is interrupted anywhere continues to the same bytes",
          "[integration][resume]") {
  for (const Kind kind : {Kind::city, Kind::cloud, Kind::pairs, Kind::lamps}) {
    Place place(kind);
    // A cloud whose radii are estimated passes twice more over its sorted points before they are
    // built
    const std::uint64_t scanned = kind == Kind::cloud ? 2 * place.points : 0;
    const std::uint64_t passes =  // points reported before the ones that are built
        (kind == Kind::city ? 1 : 2) * place.points + scanned;
    Progress silent;
    for (const std::uint64_t after :
         {100'000u, 299'000u}) {  // nothing is kept of an interrupted sort
      place.interrupt(after);
      CHECK(place.clean());
    }
    for (const std::uint64_t after : {10'000u, 140'000u, 230'000u}) {
      place.request.run.threads = 2;
      place.interrupt(passes + 1000 + after);
      CHECK_FALSE(place.clean());
      place.request.run.threads = 1;
      place.request.run.memory_bytes ^= std::uint64_t{100} << 20;
      const BuildReport report = build_container(place.request, place.out, silent);
      CHECK(report.resumed_points == after / 65'280 * 65'280);
      CHECK(place.made_whole());
      CHECK(place.clean());
      std::filesystem::remove(place.out);
    }
    place.interrupt(passes + 101'000);
    for (unsigned k = 0; k < 3; ++k)
      place.interrupt(scanned + 65'280 * (k + 2) + 10'000);  // points built before count, too
    CHECK(build_container(place.request, place.out, silent).resumed_points == 4 * 65'280);
    CHECK(place.made_whole());
  }
}

TEST_CASE("resume: files of another request or of changed inputs are refused by name",
          "[integration][resume]") {
  Place place(Kind::cloud);
  place.interrupt(4 * place.points + 200'000);
  Progress silent;
  BuildRequest other = place.request;
  other.tree.leaf_points = 9;
  CHECK_THROWS_WITH(build_container(other, place.out, silent),
                    Catch::Contains("`tree.leaf_points` was '16', not '9'") &&
                        Catch::Contains("to start again, remove"));
  other = place.request;
  other.profile = Profile::raw;
  CHECK_THROWS_WITH(build_container(other, place.out, silent),
                    Catch::Contains("`profile` was 'compact', not 'raw'"));
  other = place.request;
  other.inputs.push_back(place.dir / "c.xyz");
  CHECK_THROWS_AS(build_container(other, place.out, silent), DataError);
  const auto cloud = place.dir / "c.xyz";
  const auto changed = std::filesystem::last_write_time(cloud);
  std::filesystem::last_write_time(cloud, changed + std::chrono::seconds(1));
  CHECK_THROWS_WITH(build_container(place.request, place.out, silent), Catch::Contains("c.xyz"));
  std::filesystem::last_write_time(cloud, changed);
  other = place.request;
  other.checkpoint_points = 100'000;  // these change no byte
  other.run.threads = 1;
  other.run.temp_dirs = {place.dir / "t2"};
  CHECK(build_container(other, place.out, silent).resumed_points > 0);
  CHECK(place.made_whole());
  CHECK(place.clean());
}

TEST_CASE("resume: damaged states are refused with the files to remove", "[integration][resume]") {
  Place place(Kind::city);
  place.interrupt(place.points + 200'000);
  Progress silent;
  for (const char* name : {"o.ptcx.resume", "o.ptcx.resume-at"}) {
    const std::vector<char> whole = bytes_of(place.dir / name);
    for (const std::size_t keep :
         {std::size_t{0}, std::size_t{20}, whole.size() / 2, whole.size() - 1}) {
      std::filesystem::resize_file(place.dir / name, keep);
      CHECK_THROWS_WITH(build_container(place.request, place.out, silent), Catch::Contains(name));
      std::ofstream(place.dir / name, std::ios::binary)
          .write(whole.data(), static_cast<std::streamsize>(whole.size()));
    }
  }
  CHECK(build_container(place.request, place.out, silent).resumed_points > 0);
  CHECK(place.made_whole());
}

TEST_CASE("resume: spilled points that changed on the disk are refused with the files to remove",
          "[integration][resume]") {
  for (const Kind kind : {Kind::city, Kind::cloud}) {
    Place place(kind);
    place.interrupt((kind == Kind::city ? 1 : 2) * place.points + 200'000);
    std::filesystem::path spill;
    for (const auto& file : std::filesystem::directory_iterator(place.dir / "t1"))
      spill = file.path();
    REQUIRE(!spill.empty());
    const std::vector<char> whole = bytes_of(spill);
    REQUIRE(whole.size() > 100'000);
    const std::size_t files = entries(place.dir.path());
    Progress silent;
    const auto flip = [&](std::size_t offset, char bits) {
      std::fstream file(spill, std::ios::binary | std::ios::in | std::ios::out);
      file.seekp(static_cast<std::streamoff>(offset));
      file.put(static_cast<char>(whole[offset] ^ bits));
    };
    const std::size_t record =
        (whole.size() - 50'000) / kSpilledBytes * kSpilledBytes;  // not yet read
    for (const std::size_t offset :
         {record + 3, record + 20}) {  // a byte of the key, and one after it
      flip(offset, 0x40);
      for (int again = 0; again < 2; ++again) {
        CHECK_THROWS_WITH(
            build_container(place.request, place.out, silent),
            Catch::StartsWith(spill.string() + ": offset ") &&
                Catch::Contains("points there are not what was written; to start again, remove ") &&
                Catch::Contains("o.ptcx.resume-pages"));
      }
      CHECK_FALSE(std::filesystem::exists(place.out));
      CHECK(entries(place.dir.path()) == files);
      flip(offset, 0);
    }
    std::filesystem::resize_file(spill, whole.size() - 4096);
    CHECK_THROWS_WITH(build_container(place.request, place.out, silent),
                      Catch::Contains("does not have the recorded length; to start again, remove"));
    CHECK_FALSE(std::filesystem::exists(place.out));
  }
}

TEST_CASE("resume: a build without pages yet continues, whatever file has the target's name",
          "[integration][resume]") {
  Place place(Kind::city);
  place.interrupt(place.points + 100);
  std::filesystem::resize_file(place.dir / "o.ptcx.resume-pages",
                               0);  // as a power cut may leave it
  std::ofstream(place.out) << "what was there before";
  Progress silent;
  CHECK(build_container(place.request, place.out, silent).resumed_points == 0);
  CHECK(place.made_whole());
  CHECK(place.clean());
}

TEST_CASE("resume: a build that was killed after publication is complete and cleans up",
          "[integration][resume]") {
  Place place(Kind::city);
  place.interrupt(place.points + 200'000);
  std::filesystem::copy_file(place.dir / "whole.ptcx", place.out);
  std::filesystem::remove(place.dir / "o.ptcx.resume-pages");
  Progress silent;
  const BuildReport report = build_container(place.request, place.out, silent);
  CHECK(report.resumed_points == report.superblock.points);
  CHECK(place.made_whole());
  CHECK(place.clean());
}
