// Appending points to a container.
#include "engine/pipeline/build/append.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include <catch2/catch.hpp>
#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/octree/merge.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/ptc.h"
#include "engine/verify/verify.h"
#include "format/error.h"
#include "tests/store/forge.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Writes surfels as XYZ, with positions that a float holds exactly.
void write_cloud(const std::filesystem::path& path, const std::vector<Surfel>& surfels,
                 const glm::dvec3& moved = glm::dvec3(0)) {
  std::ofstream out(path);
  out.precision(17);
  out << "# x y z nx ny nz radius\n";
  for (const Surfel& s : surfels) {
    const glm::dvec3 p = glm::dvec3(glm::vec3(s.position + moved));
    out << p.x << ' ' << p.y << ' ' << p.z << ' ' << s.normal.x << ' ' << s.normal.y << ' '
        << s.normal.z << ' ' << s.radius << '\n';
  }
}

/// Sorts surfels by radius and normal, so that equal sets can be compared one by one.
void arrange(std::vector<Surfel>& surfels) {
  std::ranges::sort(surfels, {}, [](const Surfel& s) {
    return std::array{s.radius, s.normal.x, s.normal.y, s.normal.z};
  });
}

/// Checks that two sets have the same points, with positions within `tolerance` radii.
void check_same(std::vector<Surfel> a, std::vector<Surfel> b, double tolerance) {
  REQUIRE(a.size() == b.size());
  arrange(a);
  arrange(b);
  double worst = 0;
  bool rest = true;
  for (std::size_t i = 0; i < a.size(); ++i) {
    worst = std::max(worst,
                     glm::length(a[i].position - b[i].position) / static_cast<double>(a[i].radius));
    rest = rest && a[i].radius == b[i].radius && a[i].normal == b[i].normal &&
           a[i].radiance == b[i].radiance;
  }
  CHECK(worst <= tolerance);
  CHECK(rest);
}

struct Place {
  TemporaryDirectory dir;
  Progress silent;
  std::vector<Surfel> first = random_surfels(9000, 1), second = random_surfels(7000, 2);

  BuildReport build(const char* target, const std::vector<std::filesystem::path>& inputs,
                    Profile profile, const char* append = nullptr) {
    BuildRequest request{.inputs = inputs, .profile = profile};
    if (append) request.append = dir / append;
    BuildReport report = build_container(request, dir / target, silent);
    CHECK(verify_container(dir / target, {}, silent).sound());
    return report;
  }
};

}  // namespace

TEST_CASE("append: a scene with appended points has the points of one build of both",
          "[integration][append]") {
  for (const Profile profile : {Profile::exact, Profile::compact}) {
    for (const glm::dvec3& moved : {glm::dvec3(0), glm::dvec3(0.25, 5, -40)}) {
      Place place;
      write_cloud(place.dir / "a.xyz", place.first);
      write_cloud(place.dir / "b.xyz", place.second, moved);
      place.build("a.ptcx", {place.dir / "a.xyz"}, profile);
      const std::vector<char> old = bytes_of(place.dir / "a.ptcx");
      place.build("ab.ptcx", {place.dir / "b.xyz"}, profile, "a.ptcx");
      place.build("both.ptcx", {place.dir / "a.xyz", place.dir / "b.xyz"}, profile);
      const double rounding = profile == Profile::exact ? 1e-6 : 2 * kRoundedPosition;
      check_same(points_of(place.dir / "ab.ptcx"), points_of(place.dir / "both.ptcx"), rounding);
      CHECK(bytes_of(place.dir / "a.ptcx") == old);
      const ContainerReader ab(place.dir / "ab.ptcx"), both(place.dir / "both.ptcx");
      CHECK(ab.superblock().area == Approx(both.superblock().area));
      CHECK(ab.meta().text.at("inputs") == "a.xyz b.xyz");
      CHECK(ab.meta().text.contains("rounding") == (profile == Profile::compact));
    }
  }
}

TEST_CASE(
    "append: old points keep their bytes when the cube stays, and nothing new changes no byte",
    "[integration][append]") {
  Place place;
  write_cloud(place.dir / "a.xyz", place.first);
  std::ofstream none(place.dir / "none.ply");
  none << "ply\nformat ascii 1.0\nelement vertex 0\n";
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"})
    none << "property float " << name << "\n";
  none << "end_header\n";
  none.close();
  place.build("a.ptcx", {place.dir / "a.xyz"}, Profile::compact);
  place.build("same.ptcx", {place.dir / "none.ply"}, Profile::compact, "a.ptcx");
  CHECK(ContainerReader(place.dir / "same.ptcx").superblock().points == 9000);
  // Compare all pages but the meta page.
  const ContainerReader a(place.dir / "a.ptcx"), same(place.dir / "same.ptcx");
  REQUIRE(a.page_count() == same.page_count());
  for (std::uint32_t page = 0; page < a.page_count(); ++page) {
    if (page != a.meta_page()) REQUIRE(a.entry(page).payload_xxh3 == same.entry(page).payload_xxh3);
  }
}

TEST_CASE("append: twice, in place, under other caps or interrupted, the points are the same",
          "[integration][append]") {
  Place place;
  write_cloud(place.dir / "a.xyz", place.first);
  write_cloud(place.dir / "b.xyz", place.second, {3, 0, 0});
  write_cloud(place.dir / "c.xyz", random_surfels(2000, 9), {0, -9, 1});
  place.build("s.ptcx", {place.dir / "a.xyz"}, Profile::compact);
  place.build("s.ptcx", {place.dir / "b.xyz"}, Profile::compact, "s.ptcx");
  std::filesystem::copy_file(place.dir / "s.ptcx", place.dir / "two.ptcx");
  place.build("s.ptcx", {place.dir / "c.xyz"}, Profile::compact, "s.ptcx");
  place.build("all.ptcx", {place.dir / "a.xyz", place.dir / "b.xyz", place.dir / "c.xyz"},
              Profile::compact);
  check_same(points_of(place.dir / "s.ptcx"), points_of(place.dir / "all.ptcx"),
             2 * kRoundedPosition);

  BuildRequest request{.inputs = {place.dir / "c.xyz"},
                       .append = place.dir / "two.ptcx",
                       .resume = true,
                       .checkpoint_points = 1};
  request.run.threads = 1;
  build_container(request, place.dir / "again.ptcx", place.silent);
  CHECK(bytes_of(place.dir / "again.ptcx") == bytes_of(place.dir / "s.ptcx"));
  CHECK_THROWS_AS(build_container(request, place.dir / "two.ptcx", place.silent), RequestError);
}

TEST_CASE("append: a damaged, shaded or distant input is refused, and the old file stays",
          "[integration][append]") {
  Place place;
  write_cloud(place.dir / "a.xyz", place.first);
  write_cloud(place.dir / "far.xyz", place.second, {0, 1e9, 0});
  place.build("a.ptcx", {place.dir / "a.xyz"}, Profile::compact);
  const std::vector<char> old = bytes_of(place.dir / "a.ptcx");
  BuildRequest request{.inputs = {place.dir / "far.xyz"}, .append = place.dir / "a.ptcx"};
  CHECK_THROWS_WITH(build_container(request, place.dir / "a.ptcx", place.silent),
                    Catch::Contains("build the whole scene again"));

  std::vector<char> damaged = old;
  damaged[damaged.size() / 3] = static_cast<char>(damaged[damaged.size() / 3] ^ 1);
  std::ofstream(place.dir / "a.ptcx", std::ios::binary)
      .write(damaged.data(), static_cast<std::streamsize>(damaged.size()));
  request.inputs = {place.dir / "a.xyz"};
  CHECK_THROWS_AS(build_container(request, place.dir / "a.ptcx", place.silent), FormatError);
  CHECK(bytes_of(place.dir / "a.ptcx") == damaged);

  std::ofstream(place.dir / "a.ptcx", std::ios::binary)
      .write(old.data(), static_cast<std::streamsize>(old.size()));
  const RunOptions run{.memory_bytes = std::uint64_t{256} << 20, .threads = 2};
  shade_container({{.scene = place.dir / "a.ptcx", .run = run}}, place.dir / "lit.ptcx",
                  place.silent);
  request.append = place.dir / "lit.ptcx";
  CHECK_THROWS_WITH(build_container(request, place.dir / "b.ptcx", place.silent),
                    Catch::Contains("lit.ptcx: the appended points would have no occlusion"));
  CHECK(std::distance(std::filesystem::directory_iterator(place.dir.path()), {}) == 4);
}

TEST_CASE("append: a scene whose points descend from page to page is refused",
          "[integration][append]") {
  Place place;
  write_cloud(place.dir / "a.xyz", place.first);
  BuildRequest request{.inputs = {place.dir / "a.xyz"}, .page_shift = 14, .profile = Profile::raw};
  build_container(request, place.dir / "a.ptcx", place.silent);
  Forgery forged(place.dir / "a.ptcx");
  const ContainerReader scene(place.dir / "a.ptcx");
  const auto pages = scene.point_pages();
  REQUIRE(pages.size() > 3);
  std::swap(forged.pages[pages[1]].stored, forged.pages[pages[2]].stored);
  const std::vector<std::byte> bytes = forged.bytes();
  std::ofstream(place.dir / "a.ptcx", std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  const auto refused = [&](auto&& make) {
    const std::string place_of_it =
        fmt::format("a.ptcx: offset {}: ", forged.pages[pages[2]].offset + kPageHeaderBytes);
    CHECK_THROWS_WITH(
        make(), Catch::Contains(place_of_it) && Catch::Contains("spec/points.md#point-order"));
    CHECK_FALSE(std::filesystem::exists(place.dir / "b.ptcx"));
  };
  for (const Profile profile : {Profile::exact, Profile::compact}) {
    request.append = place.dir / "a.ptcx";
    request.profile = profile;
    refused([&] { build_container(request, place.dir / "b.ptcx", place.silent); });
    const ContainerReader descending(place.dir / "a.ptcx");
    refused([&] {
      recode_container(descending, place.dir / "b.ptcx", {.profile = profile, .page_shift = 12},
                       place.silent);
    });
  }
}

TEST_CASE("append: profile, page size and leaves are taken from the scene",
          "[integration][append]") {
  Place place;
  write_cloud(place.dir / "a.xyz", place.first);
  for (const Profile profile : {Profile::raw, Profile::exact, Profile::fast, Profile::compact}) {
    BuildRequest request{.inputs = {place.dir / "a.xyz"}, .page_shift = 13, .profile = profile};
    request.tree.leaf_points = 7;
    build_container(request, place.dir / "a.ptcx", place.silent);
    BuildRequest other;
    const ContainerReader scene(place.dir / "a.ptcx");
    adopt_profile(other, scene);
    adopt_page_size(other, scene);
    adopt_leaves(other, scene);
    CHECK(other.profile == profile);
    CHECK(other.page_shift == 13);
    CHECK(other.tree.leaf_points == 7);
  }
}

TEST_CASE("append: the cube grows by doublings that keep positions and the order of keys",
          "[build][append]") {
  const std::array<double, 3> low{0.3, -7, 1000}, high{5, -6.5, 1001};
  const Frame old = frame_around(low, high);
  std::vector<MortonKey> keys;
  for (const Surfel& s : random_surfels(2000, 4)) {
    keys.push_back(encode_morton(
        old.to_lattice({s.position.x * 8 + 0.3, s.position.y * 8 - 7, s.position.z * 8 + 1000})));
  }
  std::ranges::sort(keys);
  for (const double reach : {0.0, 1.0, 9.0, 300.0, 50'000.0}) {
    for (const double side : {-1.0, 1.0}) {
      std::array<double, 3> box_low = low, box_high = high;
      (side < 0 ? box_low : box_high)[1] += side * reach;
      (side < 0 ? box_high : box_low)[0] -= side * reach * 0.5;
      if (box_low[0] > box_high[0]) std::swap(box_low[0], box_high[0]);
      const Frame grown = grow_frame(old, box_low, box_high);
      CHECK(grown.to_position(grown.to_lattice(box_low))[1] ==
            Approx(box_low[1]).margin(grown.unit()));
      CHECK(grown.to_position(grown.to_lattice(box_high))[1] ==
            Approx(box_high[1]).margin(grown.unit()));
      const LatticeMove move(old, grown);
      CHECK(move.moves() == (grown.edge != old.edge));
      CHECK(move.moves() == (reach > 0));
      MortonKey before;
      double worst = 0;
      for (const MortonKey& key : keys) {
        const MortonKey moved = move(key);
        REQUIRE(before <= moved);
        before = moved;
        const auto was = old.to_position(decode_morton(key)),
                   is = grown.to_position(decode_morton(moved));
        for (std::size_t k = 0; k < 3; ++k) worst = std::max(worst, std::abs(was[k] - is[k]));
      }
      CHECK(worst < grown.unit());
    }
  }
  CHECK_THROWS_AS(grow_frame(old, {0.3, -7, 1000}, {5e8, -6.5, 1001}), RequestError);
}
