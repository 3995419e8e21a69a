// Scenes of parts give the answers of one file.
#include "tests/support/parts.h"

#include <cstring>
#include <fstream>

#include <catch2/catch.hpp>

#include "engine/ptc.h"
#include "engine/store/container_points.h"
#include "engine/verify/verify.h"
#include "format/error.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// A city in one file and as a scene of three parts.
struct Both {
  explicit Both(std::uint64_t points = 60'000, std::uint8_t page_shift = 12) {
    Progress silent;
    static_cast<void>(build_container({.city_points = points, .page_shift = page_shift},
                                      dir.path() / "whole.ptcx", silent));
    write_parts(ContainerReader(dir.path() / "whole.ptcx"), 3, dir.path() / "scene.ptcx");
  }
  TemporaryDirectory dir;
  std::filesystem::path whole = dir.path() / "whole.ptcx", scene = dir.path() / "scene.ptcx";
};

std::string refusal(const std::filesystem::path& path) {
  try {
    const ContainerReader reader(path);
  } catch (const FormatError& error) {
    return error.what();
  }
  return {};
}

}  // namespace

TEST_CASE("parts: a scene of parts has the points of one file in the same order",
          "[integration][parts]") {
  const Both files;
  const ContainerReader whole(files.whole), scene(files.scene);
  REQUIRE(scene.parts().size() == 3);
  REQUIRE(scene.superblock().points == whole.superblock().points);
  CHECK(scene.point_pages().size() > whole.point_pages().size());
  ContainerPoints one(whole), many(scene);
  std::vector<PointRecord> a(1000), b(1000);
  while (const std::size_t count = one.next(a)) {
    REQUIRE(many.next(b) == count);
    REQUIRE(std::memcmp(a.data(), b.data(), count * sizeof(PointRecord)) == 0);
  }
  CHECK(many.next(b) == 0);
}

TEST_CASE("parts: a gather over parts gives the bits of one file", "[integration][parts]") {
  const Both files;
  Progress silent;
  for (const BackEnd back_end :
       {BackEnd::pread, BackEnd::mmap, BackEnd::direct, BackEnd::io_uring}) {
    const auto shaded = [&](const std::filesystem::path& scene) {
      ShadeRequest request;
      request.scene = scene;
      request.count = 500;
      request.back_end = back_end;
      const std::filesystem::path out = files.dir.path() / "out.ply";
      static_cast<void>(shade_container(request, out, silent));
      return bytes_of(out);
    };
    const std::vector<char> bytes = shaded(files.whole);
    REQUIRE(bytes.size() > 10'000);
    CHECK((shaded(files.scene) == bytes));
  }
}

TEST_CASE("parts: a scene of parts becomes one file again", "[integration][parts]") {
  const Both files;
  Progress silent;
  const std::filesystem::path joined = files.dir.path() / "joined.ptcx";
  static_cast<void>(recode_container(ContainerReader(files.scene), joined, {}, silent));
  const ContainerReader whole(files.whole), one(joined);
  CHECK(one.parts().empty());
  CHECK(one.superblock().content_xxh3 != ContainerReader(files.scene).superblock().content_xxh3);
  CHECK(one.superblock().nodes == whole.superblock().nodes);
  CHECK(one.superblock().node_groups == whole.superblock().node_groups);
}

TEST_CASE("parts: a verification of a scene checks its parts and the tree over them",
          "[integration][parts]") {
  const Both files;
  Progress silent;
  const auto verified = [&](const std::filesystem::path& path) {
    return verify_container(path, {.level = VerifyLevel::rebuild}, silent);
  };
  const VerifyReport whole = verified(files.whole), scene = verified(files.scene);
  CHECK(scene.sound());
  for (const Finding& finding : scene.findings) UNSCOPED_INFO(line_of(finding));
  CHECK(scene.damage == 0);
  CHECK(scene.points == whole.points);
  REQUIRE(whole.tree_digest);
  CHECK(scene.tree_digest == whole.tree_digest);

  // A flipped byte of a part is found, with the part's name.
  const std::filesystem::path part = files.dir.path() / "parts" / "1.ptcx";
  std::vector<char> bytes = bytes_of(part);
  bytes[4096 + 64 + 100] ^= 1;
  std::ofstream(part, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  const VerifyReport damaged = verified(files.scene);
  REQUIRE(damaged.damage == 1);
  CHECK(damaged.findings.front().file == part.string());
  CHECK(damaged.findings.front().rule == "spec/container.md#page-payload");
}

TEST_CASE("parts: a part that is missing, replaced or nested is refused by its name",
          "[integration][parts]") {
  const Both files;
  const std::filesystem::path part = files.dir.path() / "parts" / "1.ptcx";
  std::filesystem::rename(part, files.dir.path() / "kept");
  CHECK_THAT(refusal(files.scene), Catch::Contains(part.string()) &&
                                       Catch::Contains("there is no such file") &&
                                       Catch::Contains("spec/parts.md#parts-file"));
  std::filesystem::copy_file(files.whole, part);
  CHECK_THAT(refusal(files.scene), Catch::Contains("it has another uuid"));
  std::filesystem::remove(part);
  std::filesystem::copy_file(files.scene, part);
  CHECK_THAT(refusal(files.scene), Catch::Contains(part.string()));
  std::filesystem::remove(part);
  std::filesystem::rename(files.dir.path() / "kept", part);
  CHECK(refusal(files.scene).empty());
}
