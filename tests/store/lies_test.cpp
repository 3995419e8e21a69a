// Containers whose checksums are correct and whose structure is not: each lie is found, and the
// error names file, place and rule.
#include <algorithm>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <utility>

#include <catch2/catch.hpp>

#include "format/error.h"
#include "format/node_page.h"
#include "format/point_page.h"
#include "tests/store/forge.h"
#include "tests/store/sample.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// The numbers of pages of the sample: 5 pages of points, 5 of each group, then nodes, then meta.
constexpr std::uint32_t kPoint = 0;
constexpr std::uint32_t kAttribute = 5;
constexpr std::uint32_t kSecondGroup = 10;
constexpr std::uint32_t kNode = 15;

constexpr std::size_t kRadiusColumn = 16;  // bytes of a point before the column (spec/points.md)

class Liar {
 public:
  explicit Liar(SampleOptions options = {}) {
    options.writer.codec = Codec::raw;
    write_sample(path(), options);
  }

  [[nodiscard]] std::filesystem::path path() const { return scratch_ / "a.ptcx"; }
  [[nodiscard]] Forgery truth() const { return Forgery(path()); }

  /// Expects that opening or reading reports the lie under `clause`, with `text`.
  void expect(const std::string& clause, const std::function<void(Forgery&)>& lie,
              const std::string& text = "") const {
    Forgery forgery = truth();
    lie(forgery);
    const std::filesystem::path lied = scratch_ / "lied.ptcx";
    write_file(lied, forgery.bytes());
    try {
      static_cast<void>(walk(lied));
      FAIL_CHECK("not found: " << clause);
    } catch (const FormatError& error) {
      INFO(error.what());
      CHECK(error.clause().ends_with("#" + clause));
      CHECK_THAT(error.text(), Catch::Contains(text));
      CHECK(std::string(error.what()).starts_with(lied.string() + ": offset "));
      CHECK(error.offset() <= forgery.superblock.file_bytes);
    }
  }

 private:
  TemporaryDirectory scratch_;
};

std::uint32_t last_point_page(const Forgery& f) {
  std::uint32_t last = 0;
  for (std::uint32_t page = 0; page < f.entries.size(); ++page) {
    if (f.entries[page].type == PageType::point) last = page;
  }
  return last;
}

/// Gives a page another payload, in both its header and its entry.
void replace(Forgery& f, std::uint32_t page, std::vector<std::byte> payload) {
  const auto bytes = static_cast<std::uint32_t>(payload.size());
  f.pages[page].stored = std::move(payload);
  f.pages[page].header.stored_bytes = f.pages[page].header.raw_bytes = bytes;
  f.entries[page].stored_bytes = f.entries[page].raw_bytes = bytes;
}

/// Changes the first child reference that `pick` accepts, anywhere in the node pages.
void change_reference(Forgery& f, const std::function<bool(ChildRef&)>& pick) {
  for (std::uint32_t page = 0; page < f.entries.size(); ++page) {
    if (f.entries[page].type != PageType::node) continue;
    const NodePage nodes(f.pages[page].stored.data(), f.entries[page].record_count);
    NodePageEncoder encoder((std::size_t{1} << f.header.page_shift) - kPageHeaderBytes);
    bool done = false;
    for (std::uint32_t slot = 0; slot < nodes.size(); ++slot) {
      NodeGroup group = nodes.decode(slot);
      for (NodeChild& child : group.children) done = done || pick(child.ref);
      encoder.add(group);
    }
    if (done) return replace(f, page, encoder.take());
  }
  FAIL("no such reference");
}

}  // namespace

TEST_CASE("reader: pages that overlap are found", "[store][lies]") {
  SampleOptions options;
  options.writer.page_shift = 14;
  options.points = 2000;
  const Liar liar(options);
  REQUIRE(liar.truth().entries[kPoint].raw_bytes > 2 * kBlockBytes);
  liar.expect("directory-overlap", [](Forgery& f) { f.entries[1].offset = f.entries[0].offset; });
  liar.expect("directory-overlap",
              [](Forgery& f) { f.entries[1].offset = f.entries[0].offset + kBlockBytes; });
  liar.expect("directory-overlap",
              [](Forgery& f) { f.entries[0].offset = f.entries[1].offset - kBlockBytes; });
  liar.expect("directory-overlap", [](Forgery& f) {
    f.entries[last_point_page(f)].offset = f.superblock.directory_offset;
  });
  liar.expect("directory-overlap",
              [](Forgery& f) { f.entries[last_point_page(f)].offset = f.superblock.tail_offset; });
  liar.expect("directory-overlap", [](Forgery& f) {  // the last page before it reaches into it
    const std::uint64_t blocks = (f.entries[0].stored_bytes + 64 + kBlockBytes - 1) / kBlockBytes;
    f.entries[0].offset = f.superblock.directory_offset - (blocks - 1) * kBlockBytes;
  });
  liar.expect("directory-extent", [](Forgery& f) { f.entries[0].offset = 0; });
  liar.expect("directory-extent", [](Forgery& f) { f.entries[0].offset += 64; });
  liar.expect("directory-extent",
              [](Forgery& f) { f.entries[0].offset = f.superblock.file_bytes; });
  liar.expect("directory-extent", [](Forgery& f) {
    f.entries[0].offset = std::numeric_limits<std::uint64_t>::max() - kBlockBytes + 1;
  });
}

TEST_CASE("reader: counts that contradict the directory are found", "[store][lies]") {
  const Liar liar;
  for (const int by : {-1, 1}) {
    const auto step = static_cast<std::uint64_t>(by);  // wraps around, as the addition does
    liar.expect("superblock-counts", [&](Forgery& f) { f.superblock.points += step; });
    liar.expect("superblock-counts", [&](Forgery& f) { f.superblock.node_groups += step; });
  }
  liar.expect("superblock-counts",
              [](Forgery& f) { f.superblock.nodes = 8 * f.superblock.node_groups + 1; });
  liar.expect("superblock-counts",
              [](Forgery& f) { f.superblock.points = std::uint64_t{1} << 47; });
  liar.expect("superblock-pages", [](Forgery& f) { --f.superblock.page_count; });
  liar.expect("superblock-pages", [](Forgery& f) { ++f.superblock.point_pages; });
  liar.expect("superblock-pages", [](Forgery& f) { ++f.superblock.node_pages; });
  liar.expect("superblock-pages", [](Forgery& f) { ++f.superblock.attribute_groups; });
  liar.expect("directory-listing", [](Forgery& f) { --f.superblock.point_pages; });
  liar.expect("directory-listing", [](Forgery& f) { --f.superblock.attribute_groups; });
  liar.expect("directory-listing", [](Forgery& f) {
    f.superblock.root_page = 0;
    --f.superblock.node_pages;
  });
  liar.expect("directory-pages", [](Forgery& f) {
    f.entries.erase(f.entries.begin());
    f.rehash_payloads = false;
    f.directory.back().record_count -= 1;
    f.directory.back().stored_bytes -= 40;
    f.directory.back().raw_bytes -= 40;
  });
}

TEST_CASE("reader: point pages whose lengths misplace points are found", "[store][lies]") {
  const Liar liar;
  liar.expect("point-pages", [](Forgery& f) {  // the short page is not the last
    const std::uint32_t last = last_point_page(f);
    REQUIRE(f.entries[last].record_count < f.entries[kPoint].record_count);
    std::swap(f.entries[kPoint], f.entries[last]);
    std::swap(f.pages[kPoint], f.pages[last]);
    std::swap(f.pages[kPoint].header.rank, f.pages[last].header.rank);
  });
}

TEST_CASE("reader: a root or meta page that is none is found", "[store][lies]") {
  const Liar liar;
  liar.expect("superblock-root",
              [](Forgery& f) { f.superblock.root_page = f.superblock.node_pages; });
  liar.expect("superblock-root", [](Forgery& f) { f.superblock.root_page = kNoPage; });
  liar.expect("superblock-root", [](Forgery& f) {
    f.superblock.root_slot =
        static_cast<std::uint16_t>(f.entries[kNode + f.superblock.root_page].record_count);
  });
  liar.expect("meta-page", [](Forgery& f) {
    f.pages.back().header.type = f.entries.back().type = PageType{255};
  });
  liar.expect("directory-listing", [](Forgery& f) {
    PageHeader& header = f.pages[kAttribute].header;
    DirectoryEntry& entry = f.entries[kAttribute];
    header.type = entry.type = PageType::meta;
    header.group = entry.group = 0;
    header.record_count = entry.record_count = 1;
    header.first_key = header.last_key = 0;
  });
}

TEST_CASE("reader: attribute pages that do not match the point pages are found", "[store][lies]") {
  const Liar liar;
  const auto set_group = [](Forgery& f, std::uint8_t group) {
    f.entries[kAttribute].group = f.pages[kAttribute].header.group = group;
  };
  liar.expect("directory-listing", [&](Forgery& f) { set_group(f, 9); });
  const auto rename = [](Forgery& f, std::uint8_t group, std::uint8_t to) {
    for (std::uint32_t page = 0; page < f.entries.size(); ++page) {
      if (f.entries[page].group != group) continue;
      f.entries[page].group = f.pages[page].header.group = to;
    }
  };
  liar.expect(
      "attribute-pages", [&](Forgery& f) { rename(f, 2, 9); },
      "is of channel group 9 where the meta page has 2");
  liar.expect(
      "directory-listing", [&](Forgery& f) { rename(f, 1, 9); }, "does not ascend");
  liar.expect("directory-listing", [&](Forgery& f) { set_group(f, 2); });
  liar.expect("attribute-pages", [](Forgery& f) {
    f.entries[kAttribute].record_count -= 1;
    f.pages[kAttribute].header.record_count -= 1;
  });
  liar.expect("attribute-pages", [](Forgery& f) {
    std::vector<std::byte> payload = f.pages[kAttribute].stored;
    payload.pop_back();
    replace(f, kAttribute, payload);
  });
  liar.expect("directory-listing", [](Forgery& f) {  // the last one, with another group's length
    const std::uint32_t last = last_point_page(f);
    f.entries[last + kSecondGroup].group = f.pages[last + kSecondGroup].header.group = 1;
  });
}

TEST_CASE("reader: a page without bytes that is no void attribute page is found",
          "[store][lies][void]") {
  SampleOptions options;
  options.void_every = 2;
  const Liar liar(options);
  REQUIRE(liar.truth().entries[kAttribute].is_void());
  const auto empty = [](Forgery& f, std::uint32_t page) {
    f.rehash_payloads = false;
    f.entries[page].offset = f.entries[page].payload_xxh3 = 0;
    f.entries[page].stored_bytes = f.entries[page].raw_bytes = 0;
  };
  for (const std::uint32_t page : {kPoint, kNode})
    liar.expect("page-length", [&](Forgery& f) { empty(f, page); });
  liar.expect("page-length", [](Forgery& f) { f.entries[kAttribute].stored_bytes = 1; });
  liar.expect("page-length", [](Forgery& f) { f.entries[kAttribute].offset = kBlockBytes; });
  liar.expect("page-agreement", [](Forgery& f) {  // the page is there, but is not as its entry says
    f.rehash_payloads = false;
    f.entries[kAttribute + 1].payload_xxh3 = 0;
  });
  liar.expect("attribute-pages", [](Forgery& f) { ++f.entries[kAttribute].record_count; });
}

TEST_CASE("reader: pages of a later version's types that are out of place are found",
          "[store][lies][later]") {
  SampleOptions options;
  options.later = {PageType{128}, PageType{130}, PageType{130}};
  options.tail_pages = 3;
  const Liar liar(options);
  const auto retype = [](Forgery& f, std::size_t back, std::uint8_t type) {
    const std::size_t page = f.entries.size() - back;
    f.entries[page].type = f.pages[page].header.type = PageType{type};
  };
  liar.expect("directory-listing", [&](Forgery& f) { retype(f, 4, 131); });
  liar.expect("directory-listing", [&](Forgery& f) { retype(f, 2, 129); });
  liar.expect("page-type", [&](Forgery& f) { retype(f, 3, 127); });
  liar.expect("directory-listing", [&](Forgery& f) {  // before the node pages
    const std::size_t page = kNode;
    f.entries[page].type = f.pages[page].header.type = PageType{128};
    f.entries[page].level = f.pages[page].header.level = kNoLevel;
    f.entries[page].first_key = f.pages[page].header.first_key = f.pages[page].header.last_key = 0;
  });
  liar.expect("page-agreement", [&](Forgery& f) { retype(f, 3, 129); });  // now the ranks are wrong
  liar.expect("page-agreement", [&](Forgery& f) { ++f.pages[f.pages.size() - 2].header.rank; });
  liar.expect("page-agreement", [&](Forgery& f) { f.pages[f.pages.size() - 2].header.rank = 0; });
}

TEST_CASE("reader: a tail that is not the end of the directory is found", "[store][lies][tail]") {
  const Liar liar;
  using Tail = std::vector<DirectoryEntry>;
  const auto expect = [&](const std::function<void(Tail&)>& lie) {
    liar.expect("tail-pages", [&](Forgery& f) {
      f.last_word = [&](Superblock& a, Superblock& b) {
        lie(a.tail);
        b.tail = a.tail;
      };
    });
  };
  const Forgery truth = liar.truth();
  REQUIRE(truth.superblock.tail.size() == 3);
  CHECK(std::ranges::equal(truth.superblock.tail, std::span(truth.entries).last(3)));
  // Its pages are not those that the directory lists.
  expect([](Tail& tail) { ++tail[0].payload_xxh3; });
  expect([](Tail& tail) { ++tail[1].first_key; });
  expect([](Tail& tail) { tail[2].record_count = 1, tail[2].type = PageType{255}; });
  // Its pages do not fill the room behind the directory.
  expect([](Tail& tail) { tail.clear(); });
  expect([](Tail& tail) { tail.erase(tail.begin()); });
  expect([](Tail& tail) { tail[0].offset += kSectorBytes; });
  expect([](Tail& tail) { tail[1].offset += kSectorBytes; });
  expect([](Tail& tail) { std::swap(tail[0], tail[1]); });
  liar.expect("directory-overlap", [](Forgery& f) {  // the last two pages, one of them in its place
    f.last_word = [](Superblock& a, Superblock& b) {
      a.tail.pop_back();
      b.tail = a.tail;
    };
  });
  // It has pages that cannot lie there.
  expect([&](Tail& tail) { tail[0] = truth.entries[kPoint]; });
  expect([&](Tail& tail) { tail[0] = truth.entries[kAttribute]; });
  expect([&](Tail& tail) { tail.insert(tail.begin(), truth.entries[kNode]); });
}

TEST_CASE("reader: a page in the place of another is found", "[store][lies]") {
  const Liar liar;
  liar.expect("page-agreement", [](Forgery& f) {
    REQUIRE(f.entries[kAttribute].stored_bytes == f.entries[kAttribute + 1].stored_bytes);
    std::swap(f.pages[kAttribute].offset, f.pages[kAttribute + 1].offset);
  });
  liar.expect("page-agreement", [](Forgery& f) {
    std::swap(f.entries[kAttribute].payload_xxh3, f.entries[kAttribute + 1].payload_xxh3);
    f.rehash_payloads = false;
  });
  liar.expect("page-agreement", [](Forgery& f) { f.pages[kPoint].header.rank = 5; });
  liar.expect("page-agreement", [](Forgery& f) { ++f.pages[kNode].header.level; });
  liar.expect("page-agreement", [](Forgery& f) { --f.pages[kNode + 1].header.first_key; });
  liar.expect("page-agreement", [](Forgery& f) { f.pages[kAttribute].header.group = 2; });
  liar.expect("page-payload", [](Forgery& f) {
    f.pages[kPoint].stored[100] ^= std::byte{1};
    f.rehash_payloads = false;
  });
}

TEST_CASE("reader: a page of another file is found", "[store][lies]") {
  const Liar liar;
  const TemporaryDirectory scratch;
  SampleOptions options;
  options.writer.codec = Codec::raw;
  options.writer.uuid[0] = std::byte{8};
  write_sample(scratch / "other.ptcx", options);
  const Forgery other(scratch / "other.ptcx");
  const Forgery mine = liar.truth();
  REQUIRE((other.entries == mine.entries));
  for (std::uint32_t page = 0; page < mine.entries.size(); ++page) {
    std::vector<std::byte> file = read_file(liar.path());
    const std::vector<std::byte> from = read_file(scratch / "other.ptcx");
    const std::size_t at = mine.entries[page].offset;
    std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(at), kSectorBytes,
                file.begin() + static_cast<std::ptrdiff_t>(at));
    write_file(scratch / "mixed.ptcx", file);
    CHECK_THROWS_WITH(
        walk(scratch / "mixed.ptcx"),
        Catch::Contains("#page-checksum") && Catch::Contains("offset " + std::to_string(at + 56)));
  }
}

TEST_CASE("reader: a directory that does not match the superblock is found", "[store][lies]") {
  const Liar liar;
  liar.expect("superblock-digest", [](Forgery& f) {
    f.last_word = [](Superblock& a, Superblock& b) { a.content_xxh3[1] = b.content_xxh3[1] ^= 1; };
  });
  liar.expect("directory-pages", [](Forgery& f) {
    f.last_word = [](Superblock& a, Superblock& b) { a.directory_xxh3 = b.directory_xxh3 ^= 1; };
  });
  liar.expect("directory-pages", [](Forgery& f) { ++f.directory[0].rank; });
  liar.expect("directory-pages", [](Forgery& f) {
    f.directory[0].type = PageType::attribute;
    f.directory[0].group = 1;
  });
  liar.expect("directory-pages", [](Forgery& f) {  // one entry fewer than lie there
    f.directory.back().record_count -= 1;
    f.directory.back().stored_bytes -= 40;
    f.directory.back().raw_bytes -= 40;
  });
  liar.expect("directory-pages", [](Forgery& f) {
    f.rehash_directory_pages = false;
    f.directory[0].payload_xxh3 ^= 1;
  });
  liar.expect("superblock-copies",
              [](Forgery& f) { f.last_word = [](Superblock& a, Superblock&) { a.area += 1; }; });
}

TEST_CASE("reader: a wrong entry is named by its place in the file", "[store][lies]") {
  SampleOptions options;
  options.points = 40000;
  options.attribute_groups = 0;
  const Liar liar(options);
  Forgery f = liar.truth();
  REQUIRE(f.directory.size() > 2);
  const std::uint32_t page = directory_entries_per_page(f.header) + 5;
  f.entries[page].offset += 64;
  const TemporaryDirectory scratch;
  write_file(scratch / "lied.ptcx", f.bytes());
  const std::uint64_t at = f.superblock.directory_offset + 4096 + 64 + 5 * 40;
  CHECK_THROWS_WITH(walk(scratch / "lied.ptcx"), Catch::Contains("offset " + std::to_string(at)));
}

TEST_CASE("reader: references to nonexistent groups are found", "[store][lies]") {
  const Liar liar;
  const Forgery truth = liar.truth();
  const auto interior = [&](const std::function<void(ChildRef&)>& change) {
    return [change](ChildRef& ref) {
      if (ref.interior) change(ref);
      return ref.interior;
    };
  };
  liar.expect("references", [&](Forgery& f) {
    change_reference(f, interior([&](ChildRef& ref) {
                       ref.slot =
                           static_cast<std::uint16_t>(truth.entries[kNode + ref.page].record_count);
                     }));
  });
  for (const std::uint32_t page :
       {truth.superblock.node_pages, truth.superblock.page_count, kNoPage}) {
    liar.expect("node-reference", [&](Forgery& f) {
      change_reference(f, interior([&](ChildRef& ref) { ref.page = page; }));
    });
  }
  liar.expect("node-leaf", [&](Forgery& f) {
    change_reference(f, [&](ChildRef& ref) {
      if (ref.interior) return false;
      ref.first_point = truth.superblock.points - ref.point_count + 1;
      return true;
    });
  });
}

TEST_CASE("reader: payloads that decode to nonsense are found", "[store][lies]") {
  const Liar liar;
  liar.expect("point-radius", [](Forgery& f) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const std::size_t at = kRadiusColumn * f.entries[kPoint].record_count;
    std::memcpy(&f.pages[kPoint].stored[at], &nan, sizeof nan);
  });
  liar.expect("codec-frame", [](Forgery& f) {
    f.pages[kPoint].header.coding.codec = Codec::zstd;
    f.pages[kPoint].stored.pop_back();
    --f.pages[kPoint].header.stored_bytes;
    --f.entries[kPoint].stored_bytes;
  });
  liar.expect("meta-size", [](Forgery& f) {
    const std::uint32_t meta = f.superblock.page_count - 1;
    std::vector<std::byte> payload = f.pages[meta].stored;
    payload.push_back(std::byte{0});
    replace(f, meta, payload);
  });
  liar.expect("node-slots", [](Forgery& f) {
    ++f.entries[kNode].record_count;
    ++f.pages[kNode].header.record_count;
    ++f.superblock.node_groups;
  });
}

TEST_CASE("reader: an error in a compressed page names the decoded byte", "[store][lies]") {
  const TemporaryDirectory scratch;
  write_sample(scratch / "a.ptcx", {});
  Forgery f(scratch / "a.ptcx");
  REQUIRE(f.pages[kPoint].header.coding == Coding{Codec::zstd, Filter::columns});
  std::vector<std::byte> payload(f.entries[kPoint].raw_bytes);
  const PayloadColumns columns{f.entries[kPoint].record_count,
                               packed_point_columns(f.header.point_bytes)};
  PageDecoder().decode({Codec::zstd, Filter::columns}, f.pages[kPoint].stored, payload, columns);
  const std::size_t at = kRadiusColumn * f.entries[kPoint].record_count;
  const float negative = -1;
  std::memcpy(&payload[at], &negative, sizeof negative);
  std::vector<std::byte> stored;
  REQUIRE(PageEncoder(Codec::zstd).encode(payload, stored, columns) ==
          Coding{Codec::zstd, Filter::columns});
  f.pages[kPoint].stored = stored;
  f.pages[kPoint].header.stored_bytes = static_cast<std::uint32_t>(stored.size());
  f.entries[kPoint].stored_bytes = static_cast<std::uint32_t>(stored.size());
  write_file(scratch / "lied.ptcx", f.bytes());
  CHECK_THROWS_WITH(walk(scratch / "lied.ptcx"),
                    Catch::Contains("decoded byte " + std::to_string(at)) &&
                        Catch::Contains("offset " + std::to_string(f.entries[kPoint].offset + 64)));
}
