// The file as it lies on the disk, what the writer refuses, and that a file is whole or absent.
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <string>
#include <system_error>

#include <catch2/catch.hpp>

#include "tests/store/forge.h"
#include "tests/store/sample.h"

using namespace ptc;
using namespace ptc::test;

namespace {

using Facts = PageSummary;

/// A limit on the length of files that this process writes, which simulates a full disk.
class FileLimit {
 public:
  explicit FileLimit(rlim_t bytes) : ignored_(std::signal(SIGXFSZ, SIG_IGN)) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit now{bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &now);
  }
  ~FileLimit() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, ignored_);
  }
  FileLimit(const FileLimit&) = delete;
  FileLimit& operator=(const FileLimit&) = delete;

 private:
  rlimit before_{};
  void (*ignored_)(int);
};

}  // namespace

TEST_CASE("writer: pages lie in the order of the calls, aligned, padded with zeros",
          "[store][writer]") {
  const TemporaryDirectory scratch;
  const Sample sample = write_sample(scratch / "a.ptcx", {});
  const std::vector<std::byte> file = read_file(scratch / "a.ptcx");
  const Forgery parts(scratch / "a.ptcx");
  std::uint64_t expected = kBlockBytes;
  const auto expect_zeros = [&](std::uint64_t from, std::uint64_t to) {
    CHECK(std::all_of(file.begin() + static_cast<std::ptrdiff_t>(from),
                      file.begin() + static_cast<std::ptrdiff_t>(to),
                      [](std::byte b) { return b == std::byte{0}; }));
  };
  const auto expect_page = [&](std::uint64_t offset, std::uint64_t stored, std::uint64_t unit) {
    CHECK(offset == expected);
    expected = round_up(offset + 64 + stored, unit);
    expect_zeros(offset + 64 + stored, expected);
  };
  // The sample is written from its last page to its first, but for the tail behind the directory.
  const std::size_t body = parts.entries.size() - parts.superblock.tail.size();
  CHECK(body == sample.pages.size() - 2);
  for (std::size_t page = body; page-- > 0;) {
    expect_page(parts.entries[page].offset, parts.entries[page].stored_bytes, 512);
  }
  expect_zeros(expected, parts.superblock.directory_offset);
  expected = round_up(expected, 4096);
  CHECK(parts.superblock.directory_offset == expected);
  for (std::size_t i = 0; i < parts.directory.size(); ++i) {
    CHECK(parts.directory[i].rank == i);
    expect_page(parts.superblock.directory_offset + i * 4096, parts.directory[i].stored_bytes,
                4096);
  }
  CHECK(parts.superblock.tail_offset == expected);
  for (std::size_t page = body; page < parts.entries.size(); ++page) {
    expect_page(parts.entries[page].offset, parts.entries[page].stored_bytes, 512);
  }
  CHECK(parts.entries.back().type == PageType::meta);
  expect_zeros(expected, round_up(expected, 4096));
  expected = round_up(expected, 4096);
  CHECK(file.size() == expected + 2 * kBlockBytes);
  const std::span tail = std::span(file).last(2 * kBlockBytes);
  CHECK(std::ranges::equal(tail.first(kBlockBytes), tail.last(kBlockBytes)));
}

TEST_CASE("writer: the same calls give the same bytes", "[store][writer]") {
  const TemporaryDirectory scratch;
  write_sample(scratch / "a.ptcx", {});
  write_sample(scratch / "b.ptcx", {});
  CHECK((read_file(scratch / "a.ptcx") == read_file(scratch / "b.ptcx")));
}

TEST_CASE("writer: another uuid changes the bytes, not the content digest", "[store][writer]") {
  const TemporaryDirectory scratch;
  SampleOptions options;
  const Sample a = write_sample(scratch / "a.ptcx", options);
  options.writer.uuid[3] = std::byte{99};
  const Sample b = write_sample(scratch / "b.ptcx", options);
  CHECK(a.superblock.content_xxh3 == b.superblock.content_xxh3);
  CHECK((read_file(scratch / "a.ptcx") != read_file(scratch / "b.ptcx")));
}

TEST_CASE("writer: pages copied in their stored form give the same container", "[store][writer]") {
  const TemporaryDirectory scratch;
  SampleOptions options;
  options.void_every = 2;
  options.later = {PageType{128}, PageType{129}};
  options.tail_pages = 4;
  write_sample(scratch / "a.ptcx", options);
  const ContainerReader from(scratch / "a.ptcx");
  ContainerWriter to(scratch / "b.ptcx", {12, Codec::zstd, 1, from.header().uuid});
  const std::uint32_t copied = from.page_count() - 1;  // the meta page is written again
  const std::uint32_t body =
      from.page_count() - static_cast<std::uint32_t>(from.superblock().tail.size());
  for (std::uint32_t page = 0; page < copied; ++page) {
    const DirectoryEntry& entry = from.entry(page);
    CHECK(to.reserve_page(entry.type, entry.group) == from.read_page_header(page).rank);
  }
  std::vector<std::byte> stored;
  for (std::uint32_t page = body; page-- > 0;) {
    const PageHeader h = from.read_stored_page(page, stored);
    if (from.entry(page).is_void()) {
      to.write_void_page(summary_of(h));
    } else {
      to.write_stored_page(summary_of(h), h.coding, h.raw_bytes, stored);
    }
  }
  for (std::uint32_t page = body; page < copied; ++page) {
    const PageHeader h = from.read_stored_page(page, stored);
    to.keep_stored_page(summary_of(h), h.coding, h.raw_bytes, stored);
  }
  to.finish(from.meta(), from.superblock());
  CHECK((read_file(scratch / "a.ptcx") == read_file(scratch / "b.ptcx")));
}

TEST_CASE("writer: each reserved page must be written exactly once", "[store][writer]") {
  const TemporaryDirectory scratch;
  Sample sample;
  ContainerWriter writer(scratch / "a.ptcx", {12, Codec::zstd, 1, {}});
  write_unfinished(writer, {}, sample);
  const auto twice = [&](const Facts& facts, std::span<const std::byte> payload) {
    CHECK_THROWS_AS(writer.write_page(facts, payload), std::invalid_argument);
    if (facts.type == PageType::attribute)
      CHECK_THROWS_AS(writer.write_void_page(facts), std::invalid_argument);
  };
  for (const Sample::Page& page : sample.pages) {
    if (page.facts.type == PageType::node) break;  // those of the tail are still kept
    twice(page.facts, page.payload);
  }
  Sample::Page page = sample.pages[0];
  page.facts.rank = writer.state().point_pages;
  twice(page.facts, page.payload);
  CHECK(writer.reserve_page(PageType::point) == page.facts.rank);
  CHECK_THROWS_AS(writer.finish(sample.meta, sample.superblock), std::invalid_argument);
}

TEST_CASE("writer: nothing follows finish()", "[store][writer]") {
  const TemporaryDirectory scratch;
  Sample sample;
  ContainerWriter writer(scratch / "a.ptcx", {12, Codec::zstd, 1, {}});
  write_unfinished(writer, {}, sample);
  sample.superblock = writer.finish(sample.meta, sample.superblock);
  const auto& [facts, payload, is_void] = sample.pages[0];
  CHECK_THROWS_AS(writer.reserve_page(PageType::point), std::invalid_argument);
  CHECK_THROWS_AS(writer.write_page(facts, payload), std::invalid_argument);
  CHECK_THROWS_AS(writer.keep_page(sample.pages.back().facts, sample.pages.back().payload),
                  std::invalid_argument);
  CHECK_THROWS_AS(writer.finish(sample.meta, sample.superblock), std::invalid_argument);
}

TEST_CASE("writer: a page that no reader would accept is refused", "[store][writer]") {
  const TemporaryDirectory scratch;
  Sample sample;
  write_sample(scratch / "good.ptcx", {});
  {
    ContainerWriter good(scratch / "b.ptcx", {12, Codec::zstd, 1, {}});
    write_unfinished(good, {}, sample);
  }
  ContainerWriter writer(scratch / "a.ptcx", {12, Codec::zstd, 1, {}});
  static_cast<void>(writer.reserve_page(PageType::point));
  const Facts good = sample.pages[0].facts;
  const std::vector<std::byte>& payload = sample.pages[0].payload;
  const auto refused = [&](const Facts& facts, std::span<const std::byte> bytes) {
    CHECK_THROWS_AS(writer.write_page(facts, bytes), std::invalid_argument);
  };
  Facts facts = good;
  facts.type = PageType::meta;
  refused(facts, payload);
  facts.type = PageType::directory;
  refused(facts, payload);
  facts = good;
  facts.record_count = 0;
  refused(facts, payload);
  facts = good;
  facts.group = 1;
  refused(facts, payload);
  facts = good;
  facts.level = 0;
  refused(facts, payload);
  facts = good;
  std::swap(facts.first_key, facts.last_key);
  refused(facts, payload);
  refused(good, {});
  refused(good, std::vector<std::byte>(4096 - 63));
  const auto stored = [&](Coding coding, std::uint32_t raw_bytes,
                          std::span<const std::byte> bytes) {
    CHECK_THROWS_AS(writer.write_stored_page(good, coding, raw_bytes, bytes),
                    std::invalid_argument);
  };
  const auto size = static_cast<std::uint32_t>(payload.size());
  stored({}, size + 1, payload);
  stored({Codec::zstd}, size, payload);
  stored({}, 0, payload);
  stored({}, size, {});
  CHECK_THROWS_AS(writer.keep_page(good, payload), std::invalid_argument);
  CHECK_THROWS_AS(writer.write_void_page(good), std::invalid_argument);
  CHECK_NOTHROW(writer.write_page(good, payload));
}

TEST_CASE("writer: a page of attributes that are all unknown is void", "[store][writer][void]") {
  const TemporaryDirectory scratch;
  const std::vector<Channel> channels{
      {.name = "a", .type = ChannelType::half, .components = 3, .group = 4, .no_value = 0xfe01},
      {.name = "b", .type = ChannelType::u16, .group = 4}};
  ContainerWriter writer(scratch / "a.ptcx", {12, Codec::zstd, 1, {}});
  const auto entry = [&](std::uint32_t rank, std::span<const std::byte> payload) {
    const std::uint64_t before = writer.state().end;
    writer.write_attributes(4, payload, 8, channels);
    CHECK_THROWS_AS(writer.write_void_page(
                        {.type = PageType::attribute, .group = 4, .rank = rank, .record_count = 8}),
                    std::invalid_argument);
    return writer.state().end - before;
  };
  std::vector<std::byte> payload(8 * 8);
  fill_void(channels, 4, payload);
  CHECK(entry(0, payload) == 0);
  // Any other bit of any value makes it a page like others.
  for (std::size_t byte = 0; byte < payload.size(); ++byte) {
    std::vector<std::byte> other = payload;
    other[byte] ^= std::byte{0x80};
    CHECK(entry(static_cast<std::uint32_t>(byte) + 1, other) == kSectorBytes);
  }
  CHECK(entry(65, std::vector<std::byte>(64)) == kSectorBytes);  // zeros are values of channel a
}

TEST_CASE("writer: the tail takes 63 pages and the meta page, and no more",
          "[store][writer][tail]") {
  const TemporaryDirectory scratch;
  SampleOptions options;
  options.later.assign(70, PageType{200});
  options.tail_pages = 64;
  CHECK_THROWS_AS(write_sample(scratch / "a.ptcx", options), std::invalid_argument);
  CHECK(scratch.listing().empty());
  options.tail_pages = 63;
  const Sample sample = write_sample(scratch / "a.ptcx", options);
  CHECK(sample.superblock.tail.size() == 64);
  CHECK_NOTHROW(walk(scratch / "a.ptcx"));
}

TEST_CASE("writer: pages that are kept in another order than the directory's are refused",
          "[store][writer][tail]") {
  const TemporaryDirectory scratch;
  ContainerWriter writer(scratch / "a.ptcx", {12, Codec::zstd, 1, {}});
  SampleOptions options;
  options.tail_pages = 0;
  Sample sample;
  write_unfinished(writer, options, sample);
  const std::vector<std::byte> payload(10);
  std::vector<Facts> later;
  for (int i = 0; i < 2; ++i)
    later.push_back(
        {.type = PageType{128}, .rank = writer.reserve_page(PageType{128}), .record_count = 1});
  SECTION("the later page first") {
    writer.keep_page(later[1], payload);
    writer.keep_page(later[0], payload);
    CHECK_THROWS_AS(writer.finish(sample.meta, sample.superblock), std::invalid_argument);
  }
  SECTION("the later page in front of the directory") {
    writer.write_page(later[1], payload);
    writer.keep_page(later[0], payload);
    CHECK_THROWS_AS(writer.finish(sample.meta, sample.superblock), std::invalid_argument);
  }
  SECTION("a page twice") {
    writer.keep_page(later[0], payload);
    writer.keep_page(later[0], payload);
    writer.keep_page(later[1], payload);
    CHECK_THROWS_AS(writer.finish(sample.meta, sample.superblock), std::invalid_argument);
  }
  SECTION("in their order") {
    writer.keep_page(later[0], payload);
    writer.keep_page(later[1], payload);
    CHECK_NOTHROW(writer.finish(sample.meta, sample.superblock));
  }
}

TEST_CASE("writer: a superblock that contradicts the pages is refused", "[store][writer]") {
  const TemporaryDirectory scratch;
  const auto refused = [&](const auto& lie) {
    Sample sample;
    ContainerWriter writer(scratch / "a.ptcx", {12, Codec::zstd, 1, {}});
    write_unfinished(writer, {}, sample);
    lie(sample.superblock, sample.meta);
    CHECK_THROWS_AS(writer.finish(sample.meta, sample.superblock), std::invalid_argument);
  };
  refused([](Superblock& s, Meta&) { ++s.points; });
  refused([](Superblock& s, Meta&) { ++s.node_groups; });
  refused([](Superblock& s, Meta&) { s.nodes = s.node_groups * 8 + 1; });
  refused([](Superblock& s, Meta&) { s.root_page = 1000; });
  refused([](Superblock& s, Meta&) { s.root_page = kNoPage; });
  refused([](Superblock& s, Meta&) { s.root_slot = 1; });
  refused([](Superblock&, Meta& m) { m.channels.pop_back(); });
  refused([](Superblock&, Meta& m) { m.channels.push_back({"more", ChannelType::f32, 1, 9}); });
  refused([](Superblock&, Meta& m) { m.text["long"] = std::string(5000, 'x'); });
  refused([](Superblock& s, Meta&) { s.writer = std::string(64, 'x'); });
  CHECK(scratch.listing().empty());
}

TEST_CASE("writer: an invalid page size or frame is refused before a file is made",
          "[store][writer]") {
  const TemporaryDirectory scratch;
  for (const std::uint8_t shift : {std::uint8_t{0}, std::uint8_t{11}, std::uint8_t{21}}) {
    CHECK_THROWS_AS(ContainerWriter(scratch / "a.ptcx", {shift, Codec::zstd, 1, {}}),
                    std::invalid_argument);
  }
  CHECK_THROWS_AS(ContainerWriter(scratch / "a.ptcx", {.frame = {{}, 3}}), std::invalid_argument);
  CHECK(scratch.listing().empty());
}

TEST_CASE("writer: without finish() neither the target nor a temporary file is left",
          "[store][writer]") {
  const TemporaryDirectory scratch;
  try {
    Sample sample;
    ContainerWriter writer(scratch / "a.ptcx", {12, Codec::zstd, 1, {}});
    write_unfinished(writer, {}, sample);
    CHECK(scratch.listing().starts_with(".a.ptcx.tmp-"));
    CHECK(scratch.listing().find(' ') == std::string::npos);
    throw std::runtime_error("the build failed");
  } catch (const std::runtime_error&) {
  }
  CHECK(scratch.listing().empty());
}

TEST_CASE("writer: a write that fails at any block leaves the old file as it was",
          "[store][writer]") {
  const TemporaryDirectory scratch;
  SampleOptions options;
  options.points = 200;
  write_sample(scratch / "whole.ptcx", options);
  const std::size_t length = read_file(scratch / "whole.ptcx").size();
  const std::vector<std::byte> old(100, std::byte{42});
  write_file(scratch / "a.ptcx", old);
  for (std::size_t limit = 0; limit < length; limit += kBlockBytes) {
    {
      const FileLimit full(limit);
      CHECK_THROWS_AS(write_sample(scratch / "a.ptcx", options), std::system_error);
    }
    CHECK(scratch.listing() == "a.ptcx whole.ptcx");
    CHECK((read_file(scratch / "a.ptcx") == old));
  }
  const FileLimit enough(length);
  write_sample(scratch / "a.ptcx", options);
  CHECK((read_file(scratch / "a.ptcx") == read_file(scratch / "whole.ptcx")));
}
