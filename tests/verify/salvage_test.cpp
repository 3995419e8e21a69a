// salvage_container(): whatever is whole is kept, in order and with its channels, whatever else is
// lost.
#include "engine/verify/salvage.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <random>
#include <string>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/octree/build_pages.h"
#include "engine/parallel/thread_pool.h"
#include "engine/store/container_points.h"
#include "engine/store/writer.h"
#include "engine/verify/verify.h"
#include "format/point_page.h"
#include "format/scalar.h"
#include "tests/support/scenes.h"
#include "tests/verify/damage.h"

namespace ptc::test {
namespace {

using Bytes = std::vector<std::byte>;
constexpr std::size_t kPoints = 3000;

/// Points whose radiance is their number, with the number again as a channel, so that each kept
/// point says which one it was.
void write_numbered(const std::filesystem::path& path) {
  SortedScene scene = sort_scene(random_surfels(kPoints, 4));
  for (std::size_t i = 0; i < scene.records.size(); ++i) {
    scene.records[i].radiance = {encode_half(static_cast<float>(i % 1000)),
                                 encode_half(static_cast<float>(i / 1000)), std::uint16_t{0}};
  }
  ContainerWriter writer(path, {.page_shift = 12, .codec = Codec::zstd, .frame = scene.frame});
  VectorStream stream(scene.records);
  Progress silent;
  const Superblock superblock =
      build_pages(stream, writer, {.leaf_points = 4}, ThreadPool(), silent);
  const Meta meta{.channels = {{.name = "number", .type = ChannelType::u16}},
                  .text = {{"source", "test"}}};
  const std::uint32_t full = points_per_page(writer.header());
  for (std::size_t first = 0; first < kPoints; first += full) {
    const std::size_t count = std::min<std::size_t>(full, kPoints - first);
    std::vector<std::uint16_t> numbers(count);
    for (std::size_t i = 0; i < count; ++i) numbers[i] = static_cast<std::uint16_t>(first + i + 1);
    writer.write_attributes(1, std::as_bytes(std::span(numbers)), static_cast<std::uint32_t>(count),
                            meta.channels);
  }
  writer.finish(meta, superblock);
}

struct Kept {
  SalvageReport report;
  std::vector<std::size_t> points;   ///< numbers of the kept points, from 0 on
  std::vector<std::size_t> channel;  ///< values of their channel, from 1 on; 0 where it was lost
};

struct Patient {
  TemporaryDirectory directory;
  std::filesystem::path path = directory / "scene.ptcx", target = directory / "kept.ptcx";
  Bytes whole;
  std::vector<DirectoryEntry> entries;
  Superblock superblock;
  std::vector<std::uint32_t> points, nodes, attributes;
  std::size_t points_per_page = 0;

  Patient() {
    write_numbered(path);
    whole = read_file(path);
    const ContainerReader container(path);
    entries.assign(container.entries().begin(), container.entries().end());
    superblock = container.superblock();
    points_per_page = ptc::points_per_page(container.header());
    points.assign(container.point_pages().begin(), container.point_pages().end());
    nodes.assign(container.node_pages().begin(), container.node_pages().end());
    attributes.assign(container.attribute_pages(1).begin(), container.attribute_pages(1).end());
  }

  void damage(const std::function<void(Bytes&)>& how) const {
    Bytes bytes = whole;
    how(bytes);
    write_file(path, bytes);
  }
  /// Changes two bytes of a payload, which no single flipped bit explains.
  void spoil(Bytes& bytes, std::uint32_t page) const {
    bytes[entries[page].offset + kPageHeaderBytes] ^= std::byte{0xff};
    bytes[entries[page].offset + kPageHeaderBytes + 1] ^= std::byte{0xff};
  }

  [[nodiscard]] Kept salvage() const {
    Progress silent;
    Kept kept{.report = salvage_container(path, target, {}, silent), .points = {}, .channel = {}};
    const VerifyReport verdict = verify_container(target, {.level = VerifyLevel::rebuild}, silent);
    CHECK(verdict.findings.empty());
    const ContainerReader container(target);
    CHECK(container.header().uuid != superblock.header.uuid);
    ContainerPoints stream(container);
    std::vector<PointRecord> records(kPoints + 1);
    records.resize(stream.next(records));
    for (const PointRecord& p : records) {
      kept.points.push_back(
          static_cast<std::size_t>(decode_half(p.radiance[0]) + 1000 * decode_half(p.radiance[1])));
    }
    Bytes payload(container.page_payload_limit());
    PageDecoder decoder;
    for (const std::uint32_t page : container.attribute_pages(1)) {
      const std::uint32_t count = container.read_page(page, payload, decoder).record_count;
      std::vector<std::uint16_t> numbers(count);
      std::memcpy(numbers.data(), payload.data(), 2 * count);
      kept.channel.insert(kept.channel.end(), numbers.begin(), numbers.end());
    }
    return kept;
  }

  /// Returns the numbers of all points except those of a page.
  [[nodiscard]] std::vector<std::size_t> all_but(std::size_t lost_page = ~std::size_t{0}) const {
    std::vector<std::size_t> numbers;
    for (std::size_t i = 0; i < kPoints; ++i) {
      if (i / points_per_page != lost_page) numbers.push_back(i);
    }
    return numbers;
  }
};

void check_beside(const Kept& kept) {
  REQUIRE(kept.channel.size() == kept.points.size());
  for (std::size_t i = 0; i < kept.points.size(); ++i) {
    if (kept.channel[i] != kept.points[i] + 1) FAIL("point " << i << " has the value of another");
  }
}

}  // namespace

TEST_CASE("salvage: damage that costs nothing leaves everything kept", "[verify][salvage]") {
  const Patient patient;
  const auto all = static_cast<std::ptrdiff_t>(patient.whole.size());
  const auto directory = static_cast<std::ptrdiff_t>(patient.superblock.directory_offset);
  const auto zero = [](std::ptrdiff_t from, std::ptrdiff_t bytes) {
    return [=](Bytes& b) { std::fill_n(b.begin() + from, bytes, std::byte{0}); };
  };
  const auto swap_pages = [&](Bytes& b) {
    const auto one =
        b.begin() + static_cast<std::ptrdiff_t>(patient.entries[patient.points[3]].offset);
    const auto other =
        b.begin() + static_cast<std::ptrdiff_t>(patient.entries[patient.points[5]].offset);
    const auto bytes = [&](std::uint32_t page) {
      return round_up(kPageHeaderBytes + patient.entries[page].stored_bytes, kSectorBytes);
    };
    if (bytes(patient.points[3]) != bytes(patient.points[5]))
      FAIL("the pages are not equally long");
    std::swap_ranges(one, one + static_cast<std::ptrdiff_t>(bytes(patient.points[3])), other);
  };
  const std::vector<std::function<void(Bytes&)>> damages{
      [](Bytes&) {},
      zero(0, kBlockBytes),
      zero(directory, kBlockBytes),
      zero(all - 4096, 4096),
      zero(all - 8192, 4096),
      [](Bytes& b) { b.resize(b.size() - 100); },
      [](Bytes& b) { b.resize(b.size() + 70000, std::byte{1}); },
      [&](Bytes& b) {
        for (const std::uint32_t page : patient.nodes) patient.spoil(b, page);
      },
      [&](Bytes& b) {
        for (const auto& entry : patient.entries) b[entry.offset + 100] ^= std::byte{4};
      },
      [&](Bytes& b) { b[patient.entries[patient.points[1]].offset + 30] ^= std::byte{4}; },
      swap_pages,
  };
  for (std::size_t i = 0; i < damages.size(); ++i) {
    INFO("damage " << i);
    patient.damage(damages[i]);
    const Kept kept = patient.salvage();
    CHECK(kept.points == patient.all_but());
    check_beside(kept);
    CHECK(kept.report.points == kPoints);
    CHECK(kept.report.points_before == kPoints);
    CHECK(kept.report.area_share == Approx(1));
    CHECK(kept.report.flux_share == Approx(1));
    CHECK(kept.report.attribute_pages == patient.attributes.size());
    CHECK(kept.report.meta);
    CHECK(ContainerReader(patient.target).meta().text.at("source") == "test");
  }
}

TEST_CASE("salvage: a lost page costs only its own content", "[verify][salvage]") {
  const Patient patient;
  SECTION("points") {
    for (const std::size_t lost : {std::size_t{0}, std::size_t{7}, patient.points.size() - 1}) {
      patient.damage([&](Bytes& b) { patient.spoil(b, patient.points[lost]); });
      const Kept kept = patient.salvage();
      CHECK(kept.points == patient.all_but(lost));
      check_beside(kept);
      CHECK(kept.report.point_pages + 1 == kept.report.point_pages_before);
      CHECK(kept.report.area_share < 1);
      CHECK(kept.report.area_share > 0.9);
    }
  }
  SECTION("points, and the directory page that lists them") {
    patient.damage([&](Bytes& b) {
      patient.spoil(b, patient.points[2]);
      std::fill_n(b.begin() + static_cast<std::ptrdiff_t>(patient.superblock.directory_offset),
                  kBlockBytes, std::byte{0});
    });
    const Kept kept = patient.salvage();
    CHECK(kept.points == patient.all_but(2));
    check_beside(kept);
  }
  SECTION("channels") {
    patient.damage([&](Bytes& b) { patient.spoil(b, patient.attributes[4]); });
    const Kept kept = patient.salvage();
    CHECK(kept.points == patient.all_but());
    for (std::size_t i = 0; i < kPoints; ++i) {
      if (kept.channel[i] != (i / patient.points_per_page == 4 ? 0 : i + 1)) FAIL("point " << i);
    }
    CHECK(kept.report.attribute_pages + 1 == kept.report.attribute_pages_before);
  }
  SECTION("their names") {
    patient.damage([&](Bytes& b) { patient.spoil(b, patient.superblock.page_count - 1); });
    const Kept kept = patient.salvage();
    CHECK(kept.points == patient.all_but());
    CHECK(kept.channel.empty());
    CHECK_FALSE(kept.report.meta);
  }
}

TEST_CASE("salvage: the written part of an unfinished file is kept", "[verify][salvage]") {
  const Patient patient;
  const auto cut_behind = [&](std::uint32_t page) {
    patient.damage([&](Bytes& b) {
      b.resize(patient.entries[page].offset +
               round_up(kPageHeaderBytes + patient.entries[page].stored_bytes, kSectorBytes));
    });
  };
  const auto without_ends = [&](Bytes& b) {  // directory and superblocks
    const auto at = [&](std::uint64_t offset) {
      return b.begin() + static_cast<std::ptrdiff_t>(offset);
    };
    std::fill(at(patient.superblock.directory_offset), at(patient.superblock.tail_offset),
              std::byte{0});
    b.resize(b.size() - 2 * kBlockBytes);
  };
  SECTION("all but directory, coarse nodes, meta page and superblocks") {
    patient.damage([&](Bytes& b) { b.resize(patient.superblock.directory_offset); });
    const Kept kept = patient.salvage();
    CHECK(kept.points == patient.all_but());
    CHECK(kept.channel.empty());
    CHECK_FALSE(kept.report.meta);
    CHECK_FALSE(kept.report.points_before);
  }
  SECTION("all but directory and superblocks") {
    patient.damage(without_ends);
    const Kept kept = patient.salvage();
    CHECK(kept.points == patient.all_but());
    check_beside(kept);
    CHECK_FALSE(kept.report.points_before);
    CHECK_FALSE(kept.report.area_share);
    CHECK_FALSE(kept.report.flux_share);
    CHECK(kept.report.point_pages_before == patient.points.size());
  }
  SECTION("a point page spoiled besides") {
    patient.damage([&](Bytes& b) {
      without_ends(b);
      patient.spoil(b, patient.points[2]);
    });
    const Kept kept = patient.salvage();
    CHECK(kept.points == patient.all_but(2));
    check_beside(kept);
  }
  SECTION("a point page that does not even tell its rank: those of the others place channels") {
    patient.damage([&](Bytes& b) {
      without_ends(b);
      std::fill_n(
          b.begin() + static_cast<std::ptrdiff_t>(patient.entries[patient.points[2]].offset),
          kPageHeaderBytes, std::byte{0});
    });
    const Kept kept = patient.salvage();
    CHECK(kept.points == patient.all_but(2));
    check_beside(kept);
  }
  SECTION("the first point pages") {
    cut_behind(patient.points[4]);
    const Kept kept = patient.salvage();
    CHECK(kept.points.size() == 5 * patient.points_per_page);
    CHECK(std::ranges::is_sorted(kept.points));
    CHECK_FALSE(kept.report.meta);
  }
}

TEST_CASE("salvage: without any whole page of points nothing is written", "[verify][salvage]") {
  const Patient patient;
  Progress silent;
  const auto refused = [&](const std::function<void(Bytes&)>& how) {
    patient.damage(how);
    CHECK_THROWS_AS(salvage_container(patient.path, patient.target, {}, silent), FormatError);
    CHECK_FALSE(std::filesystem::exists(patient.target));
  };
  refused([](Bytes& b) { std::ranges::fill(b, std::byte{0}); });
  refused([](Bytes& b) { b.resize(10); });
  refused([&](Bytes& b) {
    for (const std::uint32_t page : patient.points) patient.spoil(b, page);
  });
  patient.damage([](Bytes&) {});
  CHECK_THROWS_AS(salvage_container(patient.path, patient.path, {}, silent), RequestError);
  CHECK(read_file(patient.path) == patient.whole);
  try {
    salvage_container(patient.path, patient.target, {.memory_bytes = 1 << 20}, silent);
    FAIL("the cap was not refused");
  } catch (const LimitError& error) {
    CHECK(error.field() == "memory_bytes");
    CHECK_THAT(error.what(), Catch::Contains("32M for the program"));
  }
  CHECK_FALSE(std::filesystem::exists(patient.target));
}

TEST_CASE("salvage: whatever happens to a file, only its own points are kept",
          "[verify][salvage]") {
  const Patient patient;
  std::mt19937 random(11);
  const auto below = [&](std::size_t n) {
    return std::uniform_int_distribution<std::size_t>(0, n - 1)(random);
  };
  std::size_t kept_some = 0;
  for (int run = 0; run < 60; ++run) {
    patient.damage([&](Bytes& b) {
      for (std::size_t k = 0; k <= below(12); ++k) {
        const std::size_t at = below(b.size());
        const std::size_t bytes = std::min(b.size() - at, std::size_t{1} << below(14));
        const auto first = b.begin() + static_cast<std::ptrdiff_t>(at);
        switch (below(4)) {
          case 0:
            std::fill_n(first, bytes, std::byte{0});
            break;
          case 1:
            b[at] ^= std::byte{1} << below(8);
            break;
          case 2:
            std::copy_n(patient.whole.begin() +
                            static_cast<std::ptrdiff_t>(below(patient.whole.size() - bytes)),
                        bytes, first);
            break;
          default:
            std::generate_n(first, bytes, [&] { return static_cast<std::byte>(random()); });
        }
      }
    });
    INFO("run " << run);
    try {
      const Kept kept = patient.salvage();
      ++kept_some;
      CHECK(std::ranges::is_sorted(kept.points));
      CHECK(std::ranges::adjacent_find(kept.points) == kept.points.end());
      for (std::size_t i = 0; i < kept.channel.size(); ++i) {
        if (kept.channel[i] != 0 && kept.channel[i] != kept.points[i] + 1)
          FAIL("point " << i << " has the value of another");
      }
    } catch (const FormatError&) {  // header and superblocks, or all points
    }
  }
  CHECK(kept_some > 50);
}

}  // namespace ptc::test
