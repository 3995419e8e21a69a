// verify_container() and files: good ones pass, and every damaged byte is found.
#include "engine/verify/verify.h"

#include <fcntl.h>
#include <unistd.h>

#include <string>

#include <catch2/catch.hpp>

#include "engine/store/reader.h"
#include "tests/support/scenes.h"
#include "tests/verify/damage.h"

namespace ptc::test {
namespace {

VerifyReport verify(const std::filesystem::path& path, const VerifyOptions& options = {}) {
  Progress silent;
  return verify_container(path, options, silent);
}

class OneByteFile {
 public:
  explicit OneByteFile(const std::filesystem::path& path) : fd_(::open(path.c_str(), O_WRONLY)) {
    REQUIRE(fd_ >= 0);
  }
  ~OneByteFile() { ::close(fd_); }
  void set(std::size_t offset, std::byte value) const {
    REQUIRE(::pwrite(fd_, &value, 1, static_cast<off_t>(offset)) == 1);
  }

 private:
  int fd_;
};

}  // namespace

TEST_CASE("verify: whole files of every shape pass and are counted", "[verify]") {
  const TemporaryDirectory directory;
  const auto path = directory / "scene.ptcx";
  const std::vector<Surfel> room = small_scene();
  std::vector<Surfel> heap(1000, room.front());  // coincident points
  heap.insert(heap.end(), room.begin(), room.end());
  for (const std::size_t count : {0U, 1U, 2U, 8U, 9U, 20U, 1000U}) {
    for (const std::uint32_t leaf : {1U, 8U, 300U}) {
      for (const std::uint8_t shift : {std::uint8_t{12}, std::uint8_t{16}}) {
        const auto cloud = random_surfels(count, count + 1);
        write_scene(path, cloud, {.leaf_points = leaf}, shift, Codec::zstd);
        const VerifyReport report = verify(path);
        CHECK(report.points == count);
        CHECK(report.nodes == ContainerReader(path).superblock().nodes);
        CHECK(report.file_bytes == std::filesystem::file_size(path));
      }
    }
  }
  for (const int streams : {1, 4, 63}) {
    write_scene(path, heap, {.leaf_points = 4, .levels_per_stream = streams}, 12, Codec::raw);
    CHECK(verify(path).levels > kLatticeBits);
  }
}

TEST_CASE("verify: numbers at the ends of their ranges pass", "[verify]") {
  const TemporaryDirectory directory;
  const auto path = directory / "scene.ptcx";
  std::vector<Surfel> surfels = random_surfels(300, 5);
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    constexpr std::array<float, 6> kRadii{0, 1e-38F, 1e-20F, 1, 1e20F, 3e38F};
    surfels[i].radius = kRadii[i % kRadii.size()];
    surfels[i].radiance *= i % 3 == 0 ? 0.0F : i % 3 == 1 ? 65504.0F : 1e-7F;
  }
  for (const double offset : {0.0, 1e7, -3e12}) {
    std::vector<Surfel> moved = surfels;
    for (Surfel& s : moved) s.position += offset;
    write_scene(path, moved, {}, 12, Codec::raw);
    CHECK(fault_of(path) == "");
  }
  for (const float radius : {0.0F, 1e-30F, 3e38F}) {
    for (Surfel& s : surfels) s.radius = radius;
    write_scene(path, surfels, {}, 12, Codec::raw);
    CHECK(fault_of(path) == "");
  }
}

TEST_CASE("verify: every vector gets its verdict", "[verify]") {
  for (const char* kind : {"good", "bad", "verify"}) {
    std::size_t seen = 0;
    for (const auto& entry : std::filesystem::directory_iterator(
             std::filesystem::path(PTC_SOURCE_DIR) / "spec/vectors" / kind)) {
      const std::string name = entry.path().filename().string();
      if (entry.path().extension() != ".ptcx") continue;
      INFO(kind << "/" << name);
      const std::string fault = fault_of(entry.path());
      CHECK(fault_of(entry.path(), 3) == fault);
      ++seen;
      if (std::string(kind) == "good") {
        CHECK(fault == "");
        continue;
      }
      // container-page-magic.variant.ptcx breaks spec/container.md#page-magic.
      const std::size_t dash = name.find('-');
      const std::string rule =
          name.substr(0, dash) + ".md#" + name.substr(dash + 1, name.find('.') - dash - 1);
      CHECK_THAT(fault, Catch::Contains("spec/" + rule + ")"));
    }
    CHECK(seen > 10);
  }
}

TEST_CASE("verify: every flipped byte of a file is found", "[verify]") {
  const TemporaryDirectory directory;
  for (const Codec codec : {Codec::raw, Codec::zstd}) {
    const auto path = directory / "scene.ptcx";
    write_scene(path, small_scene(), {.leaf_points = 4}, 12, codec);
    REQUIRE(fault_of(path) == "");
    const std::vector<std::byte> whole = read_file(path);
    const OneByteFile file(path);
    std::size_t silent = 0;
    for (std::size_t i = 0; i < whole.size(); ++i) {
      file.set(i, whole[i] ^ std::byte{1} << (i % 8));
      silent += fault_of(path).empty();
      file.set(i, whole[i]);
    }
    CHECK(silent == 0);
    CHECK(fault_of(path) == "");
  }
}

TEST_CASE("verify: a file that ends early is found wherever it ends", "[verify]") {
  const TemporaryDirectory directory;
  const auto path = directory / "scene.ptcx";
  write_scene(path, small_scene(), {}, 12, Codec::raw);
  const std::size_t whole = std::filesystem::file_size(path);
  for (std::size_t size = whole; size-- > 0;) {
    if (size < whole - 2 * kBlockBytes - 100 && size % 256 != 0) continue;
    std::filesystem::resize_file(path, size);
    CHECK(fault_of(path) != "");
  }
}

TEST_CASE("verify: the error names where the flipped byte lies", "[verify]") {
  const TemporaryDirectory directory;
  const auto path = directory / "scene.ptcx";
  write_scene(path, small_scene(), {}, 12, Codec::raw);
  const std::vector<std::byte> whole = read_file(path);
  std::vector<std::array<std::uint64_t, 2>> parts{{0, kBlockBytes}};  // start, bytes
  {
    const ContainerReader container(path);
    for (std::uint32_t page = 0; page < container.page_count(); ++page) {
      const DirectoryEntry& entry = container.entry(page);
      parts.push_back(
          {entry.offset, round_up(kPageHeaderBytes + entry.stored_bytes, kSectorBytes)});
    }
    parts.push_back({container.superblock().directory_offset, kBlockBytes});
    parts.push_back({whole.size() - 2 * kBlockBytes, kBlockBytes});
    parts.push_back({whole.size() - kBlockBytes, kBlockBytes});
  }
  const OneByteFile file(path);
  for (const auto& [start, bytes] : parts) {
    for (const std::uint64_t at : {start + 20, start + 70, start + bytes - 1}) {
      file.set(at, whole[at] ^ std::byte{0x10});
      const VerifyReport report = verify(path, {.threads = 2});
      CHECK(report.damage == 1);
      const Finding& finding = report.findings.at(0);
      INFO(line_of(finding));
      CHECK((finding.offset >= start && finding.offset < start + bytes));
      CHECK(finding.rule.starts_with("spec/"));
      CHECK(finding.cause == Cause::bit_flip);
      file.set(at, whole[at]);
    }
  }
}

TEST_CASE("verify: all damaged pages are named in file order, or only the first", "[verify]") {
  const TemporaryDirectory directory;
  const auto path = directory / "scene.ptcx";
  write_scene(path, random_surfels(5000, 9), {.leaf_points = 8}, 12, Codec::raw);
  std::vector<std::byte> bytes = read_file(path);
  std::vector<std::uint64_t> offsets;
  {
    const ContainerReader container(path);
    for (std::uint32_t page = 0; page < container.page_count(); ++page)
      offsets.push_back(container.entry(page).offset);
  }
  std::ranges::sort(offsets);
  REQUIRE(offsets.size() > 90);
  std::vector<std::uint64_t> damaged;
  for (std::size_t page = 40; page < 90; page += 3) {
    damaged.push_back(offsets[page] + 100);
    bytes[damaged.back()] ^= std::byte{1};
  }
  write_file(path, bytes);
  for (const unsigned threads : {1U, 2U, 4U, 4U, 4U}) {
    const VerifyReport report = verify(path, {.threads = threads});
    std::vector<std::uint64_t> found;
    for (const Finding& finding : report.findings) found.push_back(finding.offset);
    CHECK(found == damaged);
    CHECK(report.damaged_pages == damaged.size());
    CHECK_FALSE(report.tree_checked);
    const VerifyReport first = verify(path, {.threads = threads, .fail_fast = true});
    REQUIRE(first.findings.size() == 1);
    CHECK(first.findings[0].offset == damaged[0]);
  }
  const VerifyReport few = verify(path, {.keep_findings = 3});
  CHECK(few.findings.size() == 3);
  CHECK(few.damage == damaged.size());
}

TEST_CASE("verify: bytes that belong to no page and are not zero are found", "[verify]") {
  const TemporaryDirectory directory;
  const auto path = directory / "scene.ptcx";
  write_scene(path, small_scene(), {}, 12, Codec::zstd);
  std::vector<std::byte> bytes = read_file(path);
  const ContainerReader container(path);
  const DirectoryEntry& first = container.entry(0);
  const std::size_t end = first.offset + kPageHeaderBytes + first.stored_bytes;
  REQUIRE(end % kSectorBytes != 0);
  bytes[end] = std::byte{1};
  write_file(path, bytes);
  CHECK_THAT(fault_of(path),
             Catch::Contains("offset " + std::to_string(end)) && Catch::Contains("padding"));
}

}  // namespace ptc::test
