// What was written is read back, for every codec and page size.
#include <algorithm>
#include <string>

#include <catch2/catch.hpp>

#include "format/error.h"
#include "format/point_page.h"
#include "tests/store/forge.h"
#include "tests/store/sample.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Checks every page against what the writer was given.
void check_pages(const ContainerReader& reader, const Sample& sample) {
  PageDecoder decoder;
  std::vector<std::byte> buffer(reader.page_payload_limit());
  std::vector<std::byte> stored;
  for (std::uint32_t page = 0; page < sample.pages.size(); ++page) {
    const auto& [facts, payload, is_void] = sample.pages[page];
    const PageHeader header = reader.read_page(page, buffer, decoder);
    REQUIRE(header.rank == facts.rank);
    REQUIRE(header.type == facts.type);
    REQUIRE(header.group == facts.group);
    REQUIRE(header.level == facts.level);
    REQUIRE(header.record_count == facts.record_count);
    REQUIRE(header.first_key == facts.first_key);
    REQUIRE(header.last_key == facts.last_key);
    REQUIRE(header.raw_bytes == payload.size());
    REQUIRE(std::equal(payload.begin(), payload.end(), buffer.begin()));
    REQUIRE(reader.entry(page).is_void() == is_void);
    REQUIRE(reader.read_stored_page(page, stored).coding == header.coding);
    REQUIRE(reader.read_page_header(page).rank == facts.rank);
    if (is_void) {
      REQUIRE(stored.empty());
      continue;
    }
    std::vector<std::byte> decoded(header.raw_bytes);
    const auto columns = facts.type == PageType::point
                             ? packed_point_columns(reader.header().point_bytes)
                             : std::span<const PackedColumn>();
    decoder.decode(header.coding, stored, decoded, {facts.record_count, columns});
    REQUIRE((decoded == payload));
  }
}

void check_index(const ContainerReader& reader, const Sample& sample) {
  std::vector<std::uint32_t> points, nodes, second;
  for (std::uint32_t page = 0; page < sample.pages.size(); ++page) {
    const PageSummary& facts = sample.pages[page].facts;
    if (facts.type == PageType::point) points.push_back(page);
    if (facts.type == PageType::node) nodes.push_back(page);
    if (facts.group == 2) second.push_back(page);
  }
  REQUIRE(std::ranges::equal(reader.point_pages(), points));
  REQUIRE(std::ranges::equal(reader.node_pages(), nodes));
  REQUIRE(std::ranges::equal(reader.attribute_pages(2), second));
  REQUIRE(reader.attribute_pages(77).empty());
}

}  // namespace

TEST_CASE("container: pages are read back under every codec and page size", "[store][reader]") {
  const TemporaryDirectory scratch;
  for (const Codec codec : {Codec::raw, Codec::zstd}) {
    for (std::uint8_t shift = 12; shift <= 20; ++shift) {
      SampleOptions options;
      options.writer.codec = codec;
      options.writer.page_shift = shift;
      options.points = shift < 16 ? 5000 : 20000;
      const Sample sample = write_sample(scratch / "a.ptcx", options);
      const ContainerReader reader(scratch / "a.ptcx");
      INFO("codec " << static_cast<int>(codec) << ", page shift " << int{shift});
      CHECK(reader.header().page_shift == shift);
      CHECK(reader.page_payload_limit() == (std::size_t{1} << shift) - 64);
      CHECK(reader.page_count() == sample.pages.size() + 1);
      CHECK(reader.meta().channels == sample.meta.channels);
      CHECK(reader.meta().text == sample.meta.text);
      check_index(reader, sample);
      check_pages(reader, sample);
    }
  }
}

TEST_CASE("container: points that emit light are read back with their emission",
          "[store][reader]") {
  const TemporaryDirectory scratch;
  SampleOptions options;
  options.writer.point_bytes = kEmittingPointBytes;
  options.points = 5000;
  const Sample sample = write_sample(scratch / "a.ptcx", options);
  const ContainerReader reader(scratch / "a.ptcx");
  CHECK(reader.header().point_bytes == 40);
  check_pages(reader, sample);
  const std::vector<PointRecord> points = sample_points(options.points);
  PageDecoder decoder;
  std::vector<std::byte> payload(reader.page_payload_limit());
  const PageHeader page = reader.read_page(0, payload, decoder);
  const PointPage first(payload.data(), page.record_count, reader.header().point_bytes);
  for (std::uint32_t i = 0; i < first.size(); ++i) {
    REQUIRE(first[i].radiance == points[i].radiance);
    REQUIRE(first[i].emission == points[i].emission);
  }
}

TEST_CASE("container: a void page takes nothing but its entry and reads as unknown values",
          "[store][reader][void]") {
  const TemporaryDirectory scratch;
  SampleOptions options;
  options.points = 5000;
  write_sample(scratch / "full.ptcx", options);
  options.void_every = 2;
  const Sample sample = write_sample(scratch / "a.ptcx", options);
  const ContainerReader reader(scratch / "a.ptcx");
  const ContainerReader full(scratch / "full.ptcx");
  check_index(reader, sample);
  check_pages(reader, sample);
  // The files differ by the bytes of the void pages.
  std::uint64_t saved = 0;
  for (const std::uint32_t page : reader.attribute_pages(2)) {
    const bool is_void = reader.entry(page).is_void();
    CHECK(is_void == (reader.read_page_header(page).rank % 2 == 0));
    CHECK((reader.page_range(page).bytes == 0) == is_void);
    if (is_void) saved += round_up(full.page_range(page).bytes, kSectorBytes);
  }
  CHECK(saved > 0);
  CHECK(reader.superblock().file_bytes < full.superblock().file_bytes - saved);
  // Group 1 has a half without a value and a byte that has none to say so.
  PageDecoder decoder;
  std::vector<std::byte> payload(reader.page_payload_limit(), std::byte{0xff});
  const std::uint32_t first = reader.attribute_pages(1)[0];
  const std::uint32_t count = reader.read_page(first, payload, decoder).record_count;
  for (std::uint32_t i = 0; i < count; ++i) {
    REQUIRE(payload[2 * i] == std::byte{0});
    REQUIRE(payload[2 * i + 1] == std::byte{0x7e});
    REQUIRE(payload[2 * count + i] == std::byte{0});
  }
}

TEST_CASE("container: pages of a later version's types are passed over", "[store][reader][later]") {
  const TemporaryDirectory scratch;
  SampleOptions options;
  options.later = {PageType{128}, PageType{128}, PageType{200}, PageType{255}, PageType{255}};
  for (const std::size_t tail_pages : {0U, 2U, 8U, 63U}) {
    options.tail_pages = tail_pages;
    const Sample sample = write_sample(scratch / "a.ptcx", options);
    const ContainerReader reader(scratch / "a.ptcx");
    check_index(reader, sample);
    check_pages(reader, sample);
    CHECK(reader.page_count() == sample.pages.size() + 1);
    CHECK(reader.entry(reader.meta_page() - 5).type == PageType{128});
    CHECK(reader.meta().channels == sample.meta.channels);
  }
}

TEST_CASE("container: compression is used where it saves space", "[store][reader]") {
  const TemporaryDirectory scratch;
  SampleOptions options;
  write_sample(scratch / "zstd.ptcx", options);
  options.writer.codec = Codec::raw;
  write_sample(scratch / "raw.ptcx", options);
  const ContainerReader zstd(scratch / "zstd.ptcx");
  const ContainerReader raw(scratch / "raw.ptcx");
  std::uint64_t zstd_bytes = 0;
  for (std::uint32_t page = 0; page < raw.page_count(); ++page) {
    CHECK(raw.entry(page).stored_bytes == raw.entry(page).raw_bytes);
    CHECK(zstd.entry(page).raw_bytes == raw.entry(page).raw_bytes);
    zstd_bytes += zstd.entry(page).stored_bytes;
  }
  std::uint64_t raw_bytes = 0;
  for (std::uint32_t page = 0; page < raw.page_count(); ++page) {
    raw_bytes += raw.entry(page).stored_bytes;
  }
  CHECK(zstd_bytes < raw_bytes * 3 / 4);
}

TEST_CASE("container: a scene without points is a valid container", "[store][reader]") {
  const TemporaryDirectory scratch;
  SampleOptions options;
  options.points = 0;
  write_sample(scratch / "empty.ptcx", options);
  const ContainerReader reader(scratch / "empty.ptcx");
  CHECK(reader.page_count() == 1);
  CHECK(reader.superblock().root_page == kNoPage);
  CHECK(reader.point_pages().empty());
  CHECK(reader.node_pages().empty());
  CHECK_FALSE(walk(scratch / "empty.ptcx").empty());
}

TEST_CASE("container: a directory of several pages is read back", "[store][reader]") {
  const TemporaryDirectory scratch;
  SampleOptions options;
  options.points = 40000;
  options.attribute_groups = 0;
  const Sample sample = write_sample(scratch / "a.ptcx", options);
  REQUIRE(sample.superblock.directory_pages > 3);
  const ContainerReader reader(scratch / "a.ptcx");
  check_index(reader, sample);
  check_pages(reader, sample);
}

TEST_CASE("container: the superblock is read back as finish() returned it", "[store][reader]") {
  const TemporaryDirectory scratch;
  const Sample sample = write_sample(scratch / "a.ptcx", {});
  const ContainerReader reader(scratch / "a.ptcx");
  CHECK((encode_superblock(reader.superblock()) == encode_superblock(sample.superblock)));
  CHECK(reader.superblock().writer.starts_with("ptc "));
  CHECK(reader.path() == scratch / "a.ptcx");
}

TEST_CASE("reader: a nonexistent page is refused, as is a small buffer", "[store][reader]") {
  const TemporaryDirectory scratch;
  write_sample(scratch / "a.ptcx", {});
  const ContainerReader reader(scratch / "a.ptcx");
  PageDecoder decoder;
  std::vector<std::byte> buffer(reader.page_payload_limit());
  CHECK_THROWS_AS(reader.entry(reader.page_count()), std::invalid_argument);
  CHECK_THROWS_AS(reader.entry(kNoPage), std::invalid_argument);
  CHECK_THROWS_AS(reader.read_page(reader.page_count(), buffer, decoder), std::invalid_argument);
  CHECK_THROWS_AS(reader.read_stored_page(reader.page_count(), buffer), std::invalid_argument);
  const auto small = std::span(buffer).first(buffer.size() - 1);
  CHECK_THROWS_AS(reader.read_page(0, small, decoder), std::invalid_argument);
}

TEST_CASE("forgery: taking a container apart and putting it together gives the same bytes",
          "[store][support]") {
  const TemporaryDirectory scratch;
  for (const std::uint32_t points : {0u, 1u, 500u, 20000u}) {
    SampleOptions options;
    options.points = points;
    options.void_every = points == 500 ? 3 : 0;
    write_sample(scratch / "a.ptcx", options);
    CHECK((Forgery(scratch / "a.ptcx").bytes() == read_file(scratch / "a.ptcx")));
  }
}
