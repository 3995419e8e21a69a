// Scenes of parts give the answers of one file.
#include "tests/support/parts.h"

#include <algorithm>
#include <cstring>
#include <fstream>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/ptc.h"
#include "engine/store/container_points.h"
#include "engine/verify/salvage.h"
#include "engine/verify/verify.h"
#include "format/error.h"
#include "format/point_page.h"
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
  CHECK(damaged.damaged_pages == 1);

  // Faults of a part that are not kept are counted all the same.
  bytes = bytes_of(part);
  bytes[4096 + 64 + 1000] ^= 1;
  bytes[4096 + 64 + 2000] ^= 1;
  std::ofstream(part, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  const VerifyReport few = verify_container(files.scene, {.keep_findings = 1}, silent);
  const VerifyReport all = verify_container(files.scene, {}, silent);
  CHECK(all.damage >= 2);
  CHECK(few.damage == all.damage);
  CHECK(few.findings.size() == 1);
}

TEST_CASE("parts: a salvage of a scene makes one file of what is whole in its parts",
          "[integration][parts]") {
  const Both files;
  Progress silent;
  const std::filesystem::path kept = files.dir.path() / "kept.ptcx";
  const auto part = [&](int i) {
    return files.dir.path() / "parts" / (std::to_string(i) + ".ptcx");
  };
  const auto change = [](const std::filesystem::path& path, std::size_t at, std::size_t bytes) {
    std::vector<char> content = bytes_of(path);
    std::fill_n(content.begin() + static_cast<std::ptrdiff_t>(at), bytes, '\x55');
    std::ofstream(path, std::ios::binary)
        .write(content.data(), static_cast<std::streamsize>(content.size()));
  };
  const std::uint64_t points = ContainerReader(files.whole).superblock().points;
  const std::uint64_t of_part = ContainerReader(part(1)).superblock().points;
  const std::uint64_t last = ContainerReader(part(2)).superblock().points;
  const std::uint64_t page = points_per_page(ContainerReader(part(1)).header());
  const auto pages = [&](std::uint64_t count) { return (count + page - 1) / page; };

  // Of a whole scene everything is kept, and the tree is that of one file.
  SalvageReport report = salvage_container(files.scene, kept, {}, silent);
  CHECK(report.points == points);
  CHECK(report.points_before == points);
  CHECK(report.point_pages == report.point_pages_before);
  CHECK(report.area_share == Approx(1));
  const auto digest = [&](const std::filesystem::path& path) {
    return verify_container(path, {.level = VerifyLevel::rebuild}, silent).tree_digest;
  };
  CHECK(digest(kept) == digest(files.whole));

  // A damaged page of a part costs its points; a part with no superblock costs nothing.
  change(part(1), 4096 + 64, 100);
  change(part(0), static_cast<std::size_t>(std::filesystem::file_size(part(0))) - 8192, 8192);
  report = salvage_container(files.scene, kept, {}, silent);
  CHECK(report.points == points - page);
  CHECK(report.point_pages + 1 == report.point_pages_before);
  CHECK(verify_container(kept, {}, silent).sound());

  // So does the end of the scene's own file, but that it said how many points there were.
  const std::vector<char> scene = bytes_of(files.scene);
  change(files.scene, scene.size() - 8192, 8192);
  report = salvage_container(files.scene, kept, {}, silent);
  CHECK(report.points == points - page);
  CHECK_FALSE(report.points_before);
  std::ofstream(files.scene, std::ios::binary)
      .write(scene.data(), static_cast<std::streamsize>(scene.size()));

  // A part that is missing, or another file of that name, costs its points.
  std::filesystem::remove(part(2));
  report = salvage_container(files.scene, kept, {}, silent);
  CHECK(report.points == points - page - last);
  CHECK(report.point_pages_before == report.point_pages + 1 + pages(last));
  std::filesystem::copy_file(files.whole, part(2));
  CHECK(salvage_container(files.scene, kept, {}, silent).points == points - page - last);
  CHECK_THROWS_AS(salvage_container(files.scene, part(1), {}, silent), RequestError);
  CHECK(ContainerReader(part(0).parent_path() / "1.ptcx").superblock().points == of_part);
}

TEST_CASE("parts: a salvage keeps the channels of the parts", "[integration][parts]") {
  const TemporaryDirectory dir;
  Progress silent;
  const std::filesystem::path scene = PTC_SOURCE_DIR "/spec/vectors/good/three-parts.ptcx";
  const SalvageReport report = salvage_container(scene, dir / "kept.ptcx", {}, silent);
  CHECK(report.attribute_pages == 4);
  CHECK(report.attribute_pages_before == 4);
  REQUIRE(ContainerReader(dir / "kept.ptcx").meta().channels.size() == 1);
  container_to_points(ContainerReader(scene), dir / "scene.ply", {}, silent);
  container_to_points(ContainerReader(dir / "kept.ptcx"), dir / "kept.ply", {}, silent);
  CHECK(bytes_of(dir / "kept.ply") == bytes_of(dir / "scene.ply"));
}

TEST_CASE("parts: a flipped bit, a cut and a zeroed sector of any file of a scene are found",
          "[integration][parts]") {
  const Both files(3'000);
  Progress silent;
  for (const std::filesystem::path& file : {files.scene, files.dir.path() / "parts" / "0.ptcx",
                                            files.dir.path() / "parts" / "2.ptcx"}) {
    CAPTURE(file.string());
    const std::vector<char> whole = bytes_of(file);
    std::size_t tried = 0, found = 0;
    const auto try_bytes = [&](const std::vector<char>& changed) {
      if (changed == whole) return;
      std::ofstream(file, std::ios::binary).write(changed.data(), std::ssize(changed));
      ++tried;
      found += verify_container(files.scene, {.flip_budget = 0}, silent).sound() ? 0U : 1U;
    };
    const std::size_t step = whole.size() / 250;
    for (std::size_t at = 0; at < whole.size(); at += step) {
      std::vector<char> changed = whole;
      changed[at] = static_cast<char>(changed[at] ^ (1 << at % 8));
      try_bytes(changed);
      changed = whole;
      std::fill_n(changed.begin() + static_cast<std::ptrdiff_t>(at - at % 512), 512, '\0');
      try_bytes(changed);
      if (at % 3 == 0) try_bytes({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(at)});
    }
    CHECK(tried > 400);
    CHECK(found == tried);
    std::ofstream(file, std::ios::binary).write(whole.data(), std::ssize(whole));
  }
  CHECK(verify_container(files.scene, {}, silent).sound());
}

TEST_CASE("parts: a part that is missing, replaced or nested is refused by its name",
          "[integration][parts]") {
  const Both files;
  const std::filesystem::path part = files.dir.path() / "parts" / "1.ptcx";
  std::filesystem::rename(part, files.dir.path() / "kept");
  CHECK_THAT(refusal(files.scene), Catch::Contains(part.string()) &&
                                       Catch::Contains("there is no such file") &&
                                       Catch::Contains("spec/parts.md#parts-file"));
  Progress silent;
  const auto cause = [&] { return verify_container(files.scene, {}, silent).findings.at(0).cause; };
  CHECK(cause() == Cause::part);
  std::filesystem::copy_file(files.whole, part);
  CHECK_THAT(refusal(files.scene), Catch::Contains("it has another uuid"));
  CHECK(cause() == Cause::part);
  std::filesystem::remove(part);
  std::filesystem::copy_file(files.scene, part);
  CHECK_THAT(refusal(files.scene), Catch::Contains(part.string()));
  std::filesystem::remove(part);
  std::filesystem::rename(files.dir.path() / "kept", part);
  CHECK(refusal(files.scene).empty());
}
