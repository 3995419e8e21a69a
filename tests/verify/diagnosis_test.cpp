// The cause of damage that a verification reports, and how far it looks past the damage.
#include <algorithm>
#include <functional>
#include <string>

#include <catch2/catch.hpp>

#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "format/node_page.h"
#include "tests/support/scenes.h"
#include "tests/verify/damage.h"

namespace ptc::test {
namespace {

using Bytes = std::vector<std::byte>;

VerifyReport verify(const std::filesystem::path& path, const VerifyOptions& options = {}) {
  Progress silent;
  return verify_container(path, options, silent);
}

/// A container of some dozens of small pages, and the places of these pages.
struct Subject {
  TemporaryDirectory directory;
  std::filesystem::path path = directory / "scene.ptcx";
  Bytes whole;
  std::vector<DirectoryEntry> entries;
  Superblock superblock;

  explicit Subject(Codec codec = Codec::zstd, std::size_t points = 4000) {
    write_scene(path, random_surfels(points, 1), {}, 12, codec);
    whole = read_file(path);
    const ContainerReader container(path);
    entries.assign(container.entries().begin(), container.entries().end());
    superblock = container.superblock();
  }

  VerifyReport after(const std::function<void(Bytes&)>& damage,
                     const VerifyOptions& options = {}) const {
    Bytes bytes = whole;
    damage(bytes);
    write_file(path, bytes);
    return verify(path, options);
  }
  [[nodiscard]] std::ptrdiff_t at(std::size_t page) const {
    return static_cast<std::ptrdiff_t>(entries[page].offset);
  }
  [[nodiscard]] std::ptrdiff_t sectors(std::size_t page) const {
    return static_cast<std::ptrdiff_t>(
        round_up(kPageHeaderBytes + entries[page].stored_bytes, kSectorBytes));
  }
};

void check_one(const VerifyReport& report, Cause cause, const std::string& code) {
  REQUIRE(report.damage == 1);
  INFO(line_of(report.findings[0]));
  CHECK(report.findings[0].cause == cause);
  CHECK(code_of(report.findings[0]) == code);
}

/// Replaces line ends, as a transfer in text mode does.
Bytes with_line_ends(const Bytes& bytes) {
  Bytes out;
  for (const std::byte b : bytes) {
    if (b == std::byte{'\n'}) out.push_back(std::byte{'\r'});
    out.push_back(b);
  }
  return out;
}

}  // namespace

TEST_CASE("diagnosis: a flipped bit is named wherever it is", "[verify]") {
  const Subject subject;
  const std::size_t size = subject.whole.size();
  const std::array<std::pair<std::size_t, const char*>, 7> places{{
      {44, "header-checksum"},
      {subject.entries[3].offset + 20, "page-checksum"},
      {subject.entries[5].offset + 300, "page-payload"},
      {subject.superblock.directory_offset + 30, "page-checksum"},
      {subject.superblock.directory_offset + 500, "directory-pages"},
      {size - 2 * kBlockBytes + 130, "superblock-checksum"},
      {size - kBlockBytes + 4090, "superblock-checksum"},
  }};
  for (const auto& [place, code] : places) {
    const VerifyReport report = subject.after([at = place](Bytes& b) { b[at] ^= std::byte{0x20}; });
    check_one(report, Cause::bit_flip, code);
    CHECK(report.findings[0].offset == place);
    CHECK(report.findings[0].bytes == 1);
    CHECK(report.findings[0].text.find("bit 5 of the byte") != std::string::npos);
  }
}

TEST_CASE("diagnosis: typical faults of copies and transfers are distinguished", "[verify]") {
  const Subject subject;
  const auto all = static_cast<std::ptrdiff_t>(subject.whole.size());
  const auto cut = [&](std::ptrdiff_t left) {
    return subject.after([&](Bytes& b) { b.resize(static_cast<std::size_t>(left)); });
  };
  SECTION("the end is missing") {
    const VerifyReport report = cut(all - 100);
    check_one(report, Cause::truncated, "superblock-length");
    CHECK(report.findings[0].expected == std::to_string(all));
    check_one(cut(all - 8192), Cause::truncated, "superblock-magic");
    check_one(cut(100), Cause::truncated, "header-length");
  }
  SECTION("the writer was stopped") {
    const VerifyReport report =
        cut(static_cast<std::ptrdiff_t>(subject.superblock.directory_offset));
    check_one(report, Cause::unfinished, "superblock-magic");
    CHECK(report.pages == subject.entries.size() - subject.superblock.tail.size());  // by headers
  }
  SECTION("bytes follow") {
    const VerifyReport report =
        subject.after([](Bytes& b) { b.resize(b.size() + 5000, std::byte{7}); });
    check_one(report, Cause::appended, "superblock-length");
    CHECK(report.findings[0].offset == subject.whole.size());
    CHECK(report.findings[0].bytes == 5000);
  }
  SECTION("text") {
    check_one(subject.after([](Bytes& b) { b = with_line_ends(b); }), Cause::text_mode,
              "header-magic");
    check_one(subject.after([](Bytes& b) { std::erase(b, std::byte{'\r'}); }), Cause::text_mode,
              "header-magic");
    const auto seven_bits = [](Bytes& b) {
      std::ranges::for_each(b, [](std::byte& c) { c &= std::byte{0x7f}; });
    };
    check_one(subject.after(seven_bits), Cause::text_mode, "header-magic");
  }
  SECTION("another format") {
    check_one(subject.after([](Bytes& b) { std::ranges::fill(b, std::byte{'x'}); }), Cause::foreign,
              "header-magic");
  }
  SECTION("a newer version") {
    FileHeader header = subject.superblock.header;
    for (const auto& [features, code] : {std::pair{kReleaseFeature | 1U << 2, "header-features"},
                                         {kReleaseFeature * 0, "header-draft"}}) {
      header.feature_incompat = features;
      const Block block = encode_file_header(header);
      check_one(subject.after([&](Bytes& b) { std::ranges::copy(block, b.begin()); }), Cause::newer,
                code);
    }
  }
  SECTION("zeros") {
    const auto zero = [&](std::ptrdiff_t from, std::ptrdiff_t bytes) {
      return subject.after([&](Bytes& b) { std::fill_n(b.begin() + from, bytes, std::byte{0}); });
    };
    check_one(zero(subject.at(4), subject.sectors(4)), Cause::zeroed, "page-magic");
    const VerifyReport report = zero(subject.at(7) + 512, 512);
    check_one(report, Cause::zeroed, "page-payload");
    CHECK(report.findings[0].offset == subject.entries[7].offset + 512);
    CHECK(report.findings[0].bytes == 512);
    check_one(zero(all - 4096, 4096), Cause::zeroed, "superblock-magic");
    const VerifyReport both = zero(all - 8192, 8192);
    CHECK(both.damage == 2);
    CHECK(both.findings.at(0).cause == Cause::zeroed);
  }
}

TEST_CASE("diagnosis: misplaced pages are distinguished from pages of other files", "[verify]") {
  const Subject subject(Codec::raw);
  const auto copy_page = [](const Bytes& from, std::ptrdiff_t source, Bytes& to,
                            std::ptrdiff_t target, std::ptrdiff_t bytes) {
    std::copy_n(from.begin() + source, bytes, to.begin() + target);
  };
  std::size_t one = 0;
  while (subject.entries[one].type != PageType::point ||
         subject.entries[one + 1].type != PageType::point ||
         subject.entries[one].stored_bytes != subject.entries[one + 1].stored_bytes) {
    ++one;
  }
  SECTION("another page of the file") {
    const VerifyReport report = subject.after([&](Bytes& b) {
      copy_page(subject.whole, subject.at(one), b, subject.at(one + 1), subject.sectors(one));
    });
    check_one(report, Cause::swapped, "page-agreement");
    CHECK(report.findings[0].actual == "point page " + std::to_string(one));
  }
  SECTION("the page of another file") {
    const VerifyReport report = subject.after([&](Bytes& b) {
      const auto image =
          std::span(b).subspan(subject.entries[one].offset).first<kPageHeaderBytes>();
      encode_page_header(decode_page_header(image, subject.superblock.header), Uuid{std::byte{9}},
                         image);
    });
    check_one(report, Cause::stale, "page-checksum");
  }
}

TEST_CASE("diagnosis: intact parts are checked past lost ones", "[verify]") {
  const Subject subject(Codec::raw, 9000);
  const std::size_t pages = subject.entries.size();
  const auto payload_of = [&](Bytes& b, std::size_t page) -> std::byte& {
    return b[subject.entries[page].offset + 200];
  };
  SECTION("without the file header, which superblocks repeat") {
    const VerifyReport report = subject.after([&](Bytes& b) {
      std::fill_n(b.begin(), kBlockBytes, std::byte{0});
      payload_of(b, 9) ^= std::byte{1};
    });
    CHECK(report.damage == 2);
    CHECK(report.pages == pages);
    CHECK(report.damaged_pages == 1);
  }
  SECTION("without directory and superblocks, by the headers of the pages") {
    const VerifyReport cut = subject.after([&](Bytes& b) {
      b.resize(subject.superblock.directory_offset);
      payload_of(b, 9) ^= std::byte{1};
    });
    CHECK(cut.damage == 2);
    CHECK(cut.pages == pages - subject.superblock.tail.size());
    CHECK(cut.damaged_pages == 1);
    // The tail lies behind the directory.
    const VerifyReport zeroed = subject.after([&](Bytes& b) {
      const auto zero = [&](std::uint64_t from, std::uint64_t to) {
        std::fill(b.begin() + static_cast<std::ptrdiff_t>(from),
                  b.begin() + static_cast<std::ptrdiff_t>(to), std::byte{0});
      };
      zero(subject.superblock.directory_offset, subject.superblock.tail_offset);
      zero(b.size() - 2 * kBlockBytes, b.size());
      payload_of(b, 9) ^= std::byte{1};
      payload_of(b, pages - 2) ^= std::byte{1};
    });
    CHECK(zeroed.pages == pages);
    CHECK(zeroed.damaged_pages == 2);
  }
  SECTION("without one directory page of several") {
    REQUIRE(subject.superblock.directory_pages > 1);
    const VerifyReport report = subject.after([&](Bytes& b) {
      std::fill_n(b.begin() + static_cast<std::ptrdiff_t>(subject.superblock.directory_offset),
                  kBlockBytes, std::byte{0});
      payload_of(b, 9) ^= std::byte{1};
    });
    CHECK(report.damage == 2);
    CHECK(report.pages == pages);
    CHECK(report.damaged_pages == 1);
  }
}

TEST_CASE("diagnosis: packed channels whose names are lost do not crash the check", "[verify]") {
  const TemporaryDirectory directory;
  const auto good = std::filesystem::path(PTC_SOURCE_DIR) / "spec/vectors/good/attributes.ptcx",
             path = directory / "a.ptcx";
  Bytes bytes = read_file(good);
  const ContainerReader container(good);
  const auto at = container.entry(container.meta_page()).offset + kPageHeaderBytes;
  bytes[at] ^= std::byte{0xff};
  bytes[at + 1] ^= std::byte{0xff};
  write_file(path, bytes);
  check_one(verify(path), Cause::unknown, "page-payload");
}

TEST_CASE("diagnosis: the rest of a tree is checked past a damaged page", "[verify]") {
  const Subject subject(Codec::raw);
  OpenContainer wrong(subject.path);
  std::size_t last_nodes = 0, first_points = wrong.pages();
  for (std::size_t page = 0; page < wrong.pages(); ++page) {
    if (wrong.header(page).type == PageType::node && wrong.header(page).level > 1)
      last_nodes = page;
    if (wrong.header(page).type == PageType::point) first_points = std::min(first_points, page);
  }
  const NodePage nodes(wrong.payload(last_nodes).data(), wrong.header(last_nodes).record_count);
  auto* const area = const_cast<std::byte*>(nodes[nodes.size() - 1].area());
  area[1] ^= std::byte{0x10};
  wrong.write(subject.path);
  Bytes bytes = read_file(subject.path);
  bytes[subject.entries[first_points].offset + 200] ^= std::byte{1};
  write_file(subject.path, bytes);
  const VerifyReport report = verify(subject.path);
  REQUIRE(report.damage == 2);
  CHECK(code_of(report.findings[0]) == "page-payload");
  CHECK(code_of(report.findings[1]) == "node-sums");
  CHECK(report.findings[1].cause == Cause::writer);
  CHECK_FALSE(report.tree_checked);
}

TEST_CASE("verify: each level finds faults that lower levels do not", "[verify]") {
  const Subject subject(Codec::raw);
  const auto found_at = [&](const std::function<void(Bytes&)>& damage) {
    int level = 0;
    while (level <= 4 && subject.after(damage, {.level = static_cast<VerifyLevel>(level)}).sound())
      ++level;
    return level;
  };
  const std::size_t end = subject.whole.size();
  CHECK(found_at([&](Bytes& b) { b[end - 100] ^= std::byte{1}; }) == 0);
  CHECK(found_at([&](Bytes& b) { b[subject.entries[2].offset + 9] ^= std::byte{1}; }) == 1);
  CHECK(found_at([&](Bytes& b) { b[subject.entries[2].offset + 99] ^= std::byte{1}; }) == 2);
  CHECK(found_at([&](Bytes& b) {
          b[subject.entries[2].offset + kPageHeaderBytes + subject.entries[2].stored_bytes] =
              std::byte{1};
        }) == 2);
  write_file(subject.path, subject.whole);
  OpenContainer wrong(subject.path);
  wrong.superblock().area *= 2;
  wrong.write(subject.path);
  const Bytes twice = read_file(subject.path);
  CHECK(found_at([&](Bytes& b) { b = twice; }) == 3);
  CHECK(found_at([](Bytes&) {}) == 5);
}

TEST_CASE("verify: a tree that differs within the rounding is found by building it again",
          "[verify]") {
  const Subject subject(Codec::raw);
  const VerifyReport whole = verify(subject.path, {.level = VerifyLevel::rebuild});
  CHECK(whole.sound());
  REQUIRE(whole.tree_digest);
  OpenContainer wrong(subject.path);
  std::size_t page = 0;
  while (wrong.header(page).type != PageType::node) ++page;
  // Spheres may be wider than their points by 2^-8, so that some can take one more step.
  for (std::uint32_t slot = 0; slot < wrong.header(page).record_count; ++slot) {
    const NodePage nodes(wrong.payload(page).data(), wrong.header(page).record_count);
    auto& radius = const_cast<std::byte*>(nodes[slot].radius())[0];
    if ((radius & std::byte{1}) != std::byte{0}) continue;
    radius ^= std::byte{1};
    wrong.write(subject.path);
    if (verify(subject.path).sound()) break;
    radius ^= std::byte{1};
  }
  for (const char* writer : {"", "another program 1.0"}) {
    if (*writer != 0) wrong.superblock().writer = writer;
    wrong.write(subject.path);
    const VerifyReport report = verify(subject.path, {.level = VerifyLevel::rebuild});
    INFO(fault_of(subject.path));
    REQUIRE(report.findings.size() == 1);
    CHECK(code_of(report.findings[0]) == "tree-digest");
    CHECK(report.sound() == (*writer != 0));
    CHECK(report.tree_digest != whole.tree_digest);
  }
}

}  // namespace ptc::test
