// The marks that the completion of a scan leaves, where inputs have their channels already.
#include <array>
#include <fstream>
#include <map>
#include <random>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/point_marks.h"
#include "engine/pipeline/convert/container_source.h"
#include "engine/pipeline/convert/point_files.h"
#include "engine/store/attribute_rows.h"
#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "tests/support/read_points.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Writes a noisy square of points without normals, and one far from it.
std::filesystem::path write_noisy(const std::filesystem::path& path, unsigned seed) {
  std::mt19937 random(seed);
  const auto uniform = [&] { return static_cast<double>(random() % 100'000) / 100'000; };
  std::ofstream out(path);
  out << "# x y z\n" << 20 * seed << " 0 9\n";
  for (int i = 0; i < 4000; ++i)
    out << uniform() + 20 * seed << ' ' << uniform() << ' ' << uniform() / 50 << '\n';
  return path;
}

void build(const std::vector<std::filesystem::path>& inputs, const std::filesystem::path& target,
           const std::filesystem::path& append = {}) {
  BuildRequest request{.inputs = inputs, .profile = Profile::exact};
  if (!append.empty()) request.append = append;
  Progress silent;
  build_container(request, target, silent);
  CHECK(verify_container(target, {}, silent).sound());
}

/// Returns outlier and rise of each point, by the place of the point.
std::map<std::array<float, 3>, std::array<int, 2>> marks_of(const std::filesystem::path& path) {
  const ContainerReader container(path);
  ContainerSource source(container);
  const auto outlier = find_in_row(source.channels(), kOutlierChannel);
  const auto rise = find_in_row(source.channels(), kRiseChannel);
  REQUIRE(outlier);
  REQUIRE(rise);
  const ReadPoints read = read_points(source);
  std::map<std::array<float, 3>, std::array<int, 2>> marks;
  for (std::size_t i = 0; i < read.surfels.size(); ++i) {
    const glm::vec3 p(read.surfels[i].position);
    marks[{p.x, p.y, p.z}] = {read.value<std::uint8_t>(i, outlier->offset),
                              read.value<std::uint8_t>(i, rise->offset)};
  }
  return marks;
}

/// Returns how many points of one file are in another one with the same marks.
std::size_t shared(const std::map<std::array<float, 3>, std::array<int, 2>>& part,
                   const std::map<std::array<float, 3>, std::array<int, 2>>& whole) {
  std::size_t same = 0;
  for (const auto& [place, marks] : part) {
    const auto found = whole.find(place);
    same += found != whole.end() && found->second == marks;
  }
  return same;
}

}  // namespace

TEST_CASE("marks: appended points have the marks that they have alone", "[marks]") {
  const TemporaryDirectory dir;
  const auto first = write_noisy(dir / "first.xyz", 1), second = write_noisy(dir / "second.xyz", 2);
  build({first}, dir / "first.ptcx");
  build({second}, dir / "second.ptcx");
  build({second}, dir / "both.ptcx", dir / "first.ptcx");
  const auto a = marks_of(dir / "first.ptcx"), b = marks_of(dir / "second.ptcx"),
             both = marks_of(dir / "both.ptcx");
  const auto marked = [](const auto& all, std::size_t kind) {
    return std::ranges::count_if(all, [kind](const auto& one) { return one.second[kind] > 0; });
  };
  CHECK(marked(a, 0) == 1);
  CHECK(marked(a, 1) > 3000);
  CHECK(both.size() == a.size() + b.size());
  // Places move with the corner of the larger cube, by less than a float tells for nearly all
  CHECK(shared(a, both) > a.size() * 99 / 100);
  CHECK(shared(b, both) > b.size() * 98 / 100);
}

TEST_CASE("marks: a scan that is appended to points without them marks its own", "[marks]") {
  const TemporaryDirectory dir;
  std::ofstream(dir / "known.xyz") << "# x y z nx ny nz radius\n0 0 0 0 0 1 0.1\n0 1 0 0 0 1 0.1\n";
  build({dir / "known.xyz"}, dir / "known.ptcx");
  build({write_noisy(dir / "noisy.xyz", 1)}, dir / "both.ptcx", dir / "known.ptcx");
  const auto both = marks_of(dir / "both.ptcx");
  CHECK(both.at({0, 0, 0}) == std::array{0, 0});
  CHECK(both.at({20, 0, 9}) == std::array{1, both.at({20, 0, 9})[1]});
}

TEST_CASE("marks: points without marks that are appended to a scan have none", "[marks]") {
  const TemporaryDirectory dir;
  build({write_noisy(dir / "noisy.xyz", 1)}, dir / "noisy.ptcx");
  std::ofstream(dir / "known.xyz") << "# x y z nx ny nz radius\n0 0 0 0 0 1 0.1\n0 1 0 0 0 1 0.1\n";
  build({dir / "known.xyz"}, dir / "both.ptcx", dir / "noisy.ptcx");
  CHECK(marks_of(dir / "both.ptcx").at({0, 0, 0}) == std::array{0, 0});
  const ContainerReader both(dir / "both.ptcx");
  for (const Channel& channel : both.meta().channels) CHECK_FALSE(channel.no_value);
}

TEST_CASE("marks: a scan that was written with its marks is read again", "[marks]") {
  const TemporaryDirectory dir;
  build({write_noisy(dir / "noisy.xyz", 1)}, dir / "a.ptcx");
  Progress silent;
  for (const char* name : {"again.las", "again.ply", "again.pcd"}) {
    CAPTURE(name);
    container_to_points(ContainerReader(dir / "a.ptcx"), dir / name, {}, silent);
    build({dir / name}, dir / "b.ptcx");
    const auto a = marks_of(dir / "a.ptcx"), b = marks_of(dir / "b.ptcx");
    CHECK(a.size() == b.size());
    std::size_t outliers = 0;
    for (const auto& [place, marks] : b) outliers += static_cast<std::size_t>(marks[0]);
    CHECK(outliers == 1);
  }
}

TEST_CASE("marks: a column of another kind with their name stays as it is", "[marks]") {
  const TemporaryDirectory dir;
  std::ofstream out(dir / "risen.xyz");
  out << "# x y z rise\n";
  std::mt19937 random(5);
  for (int i = 0; i < 2000; ++i)
    out << static_cast<double>(random() % 1000) / 1000 << ' '
        << static_cast<double>(random() % 1000) / 1000 << ' '
        << static_cast<double>(random() % 1000) / 50'000 << " 0.75\n";
  out.close();
  build({dir / "risen.xyz"}, dir / "a.ptcx");
  const ContainerReader container(dir / "a.ptcx");
  ContainerSource source(container);
  const auto rise = find_in_row(source.channels(), kRiseChannel);
  REQUIRE(rise);
  CHECK(rise->channel->type == ChannelType::f64);
  const ReadPoints read = read_points(source);
  CHECK(read.value<double>(0, rise->offset) == 0.75);
}
