// A container read in ranges: what is loaded is what a reader of the whole file finds, and what is
// not loaded is not asked for.
#include "engine/store/partial_reader.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/store/reader.h"
#include "format/error.h"
#include "tests/store/sample.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// Bytes in memory as a source, which records the ranges that were asked for.
class Bytes : public RangeSource {
 public:
  explicit Bytes(std::vector<std::byte> bytes) : bytes_(std::move(bytes)) {}
  [[nodiscard]] std::string name() const override { return "source"; }
  [[nodiscard]] std::uint64_t size() const override { return bytes_.size(); }
  void read(std::uint64_t offset, std::span<std::byte> out) override {
    REQUIRE(offset + out.size() <= bytes_.size());
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(offset), out.size(), out.begin());
    ++requests;
  }
  std::byte& operator[](std::size_t at) { return bytes_[at]; }

  unsigned requests = 0;

 private:
  std::vector<std::byte> bytes_;
};

/// A sample whose file is longer than the first request.
SampleOptions large() {
  SampleOptions options;
  options.writer.codec = Codec::raw;
  options.points = 9000;
  options.void_every = 3;
  return options;
}

std::vector<std::uint32_t> content_pages(const ContainerReader& reader) {
  std::vector<std::uint32_t> pages;
  for (std::uint32_t page = 0; page < reader.page_count(); ++page) {
    if (!is_skippable(reader.entry(page).type)) pages.push_back(page);
  }
  return pages;
}

/// Loads every page of a source that can be loaded. @return the rule that it breaks, or "none"
std::string broken_rule(RangeSource& source) {
  try {
    PartialReader scene(source);
    for (std::uint32_t page = 0; page < scene.superblock().page_count; ++page) scene.load({{page}});
  } catch (const FormatError& error) {
    return error.clause();
  }
  return "none";
}

/// Says whether a partial reader may leave out a rule (spec/README.md#conformance), or what breaks
/// it: the header, the directory as a whole, and other files.
bool may_leave_out(const std::string& rule, const std::string& variant) {
  for (const char* out : {"container.md#header-", "#superblock-header", "#directory-pages",
                          "#directory-overlap", "#superblock-digest", "#superblock-counts",
                          "#superblock-root", "nodes.md#references", "#node-leaf", "parts.md#"}) {
    if (rule.find(out) != std::string::npos) return true;
  }
  // An entry of a wrong group or type breaks two rules.
  if (rule.find("#meta-page") != std::string::npos || variant == ".group") return true;
  return variant == ".directory" || variant == ".other-entry" || variant == ".of-a-part" ||
         variant == ".of-parts";
}

}  // namespace

TEST_CASE("partial reader: its pages are those of a reader, in whatever order they are loaded",
          "[store][partial]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  for (const std::uint8_t point_bytes : {kPointBytes, kEmittingPointBytes}) {
    SampleOptions options = large();
    options.writer.point_bytes = point_bytes;
    write_sample(path, options);
    const ContainerReader reader(path);
    REQUIRE(reader.superblock().file_bytes > 2 * PartialReader::kFirstRequest);
    const std::vector<std::uint32_t> pages = content_pages(reader);
    std::vector<std::byte> expected(reader.page_payload_limit());
    PageDecoder decoder;
    Bytes one_by_one(read_file(path)), at_once(read_file(path));
    PartialReader single(one_by_one), all(at_once);
    all.load(pages);
    CHECK(at_once.requests < 10);
    for (std::size_t i = 0; i < pages.size(); ++i) {
      const std::uint32_t page = pages[i * 7919 % pages.size()];
      const bool loaded = single.has(page);
      const unsigned requests = one_by_one.requests;
      single.load({{page}});
      if (loaded) CHECK(one_by_one.requests == requests);
      const PageHeader header = reader.read_page(page, expected, decoder);
      const auto payload = std::span(expected).first(header.raw_bytes);
      CHECK(std::ranges::equal(single.payload(page), payload));
      CHECK(std::ranges::equal(all.payload(page), payload));
      if (page != reader.meta_page()) single.forget(page);
    }
  }
}

TEST_CASE("partial reader: it opens by one request, and asks for a loaded page no more",
          "[store][partial]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  write_sample(path, large());
  Bytes source(read_file(path));
  PartialReader scene(source);
  CHECK(source.requests == 1);
  const std::uint32_t root = scene.numbers().nodes()[scene.superblock().root_page];
  scene.load({{root}});
  CHECK(source.requests == 1);  // the root lies in the tail
  CHECK(scene.nodes(scene.superblock().root_page).size() > 0);
  scene.load({{0}});
  const unsigned requests = source.requests;
  CHECK(requests <= 3);  // one for the entry, one for the page
  scene.load({{0, root}});
  CHECK(source.requests == requests);
  CHECK(scene.points(0).size() == ContainerReader(path).entry(0).record_count);
}

TEST_CASE("partial reader: node pages that the first request got are loaded, and no others",
          "[store][partial]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  write_sample(path, large());
  const ContainerReader reader(path);
  const std::uint64_t from = reader.superblock().file_bytes - PartialReader::kFirstRequest;
  const std::uint32_t root = reader.node_pages()[reader.superblock().root_page];
  Bytes source(read_file(path));
  const PartialReader scene(source);
  CHECK(scene.has(root));
  for (const std::uint32_t page : content_pages(reader)) {
    const bool node = reader.entry(page).type == PageType::node;
    CHECK(scene.has(page) ==
          ((node && reader.entry(page).offset >= from) || page == reader.meta_page()));
  }
  // A damaged one is left until somebody asks for it.
  source[reader.entry(root).offset + kPageHeaderBytes + 5] ^= std::byte{1};
  PartialReader damaged(source);
  CHECK_FALSE(damaged.has(root));
  CHECK_THROWS_WITH(damaged.load({{root}}), Catch::Contains("spec/container.md#page-payload"));
}

TEST_CASE("partial reader: known entries tell which node page has the group of a cell",
          "[store][partial]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  write_sample(path, large());
  const ContainerReader reader(path);
  Bytes source(read_file(path));
  PartialReader scene(source);
  const PageNumbers::Range nodes = scene.numbers().nodes();
  scene.load_entries(std::vector<std::uint32_t>(nodes.begin(), nodes.end()));
  for (const std::uint32_t page : nodes) {
    const DirectoryEntry& entry = reader.entry(page);
    CHECK(scene.level(page) == entry.level);
    for (const std::uint64_t key : {entry.first_key, entry.first_key + 1, entry.first_key / 2}) {
      std::optional<std::uint32_t> last;
      for (const std::uint32_t other : nodes) {
        const DirectoryEntry& at = reader.entry(other);
        if (at.level != entry.level || at.first_key > key) continue;
        if (!last || at.first_key >= reader.entry(*last).first_key) last = other;
      }
      CHECK(scene.known_node_page(entry.level, key) == last);
    }
  }
}

TEST_CASE("partial reader: damage of what is loaded is refused, other damage is not seen",
          "[store][partial]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  write_sample(path, large());
  const ContainerReader reader(path);
  Bytes source(read_file(path));
  PartialReader scene(source);
  // Take a page that lies before what the first request got.
  const auto first = std::ranges::find(reader.entries(), kBlockBytes, &DirectoryEntry::offset);
  const auto page = static_cast<std::uint32_t>(first - reader.entries().begin());
  const std::uint64_t offset = reader.entry(page).offset;
  source[offset + kPageHeaderBytes + 5] ^= std::byte{1};
  CHECK_NOTHROW(scene.load({{0}}));
  CHECK_THROWS_WITH(
      scene.load({{page}}),
      Catch::StartsWith("source: offset " + std::to_string(offset + kPageHeaderBytes)) &&
          Catch::Contains("spec/container.md#page-payload"));
  CHECK_FALSE(scene.has(page));
  source[offset + kPageHeaderBytes + 5] ^= std::byte{1};
  CHECK_NOTHROW(scene.load({{page}}));
  CHECK_THROWS_AS(scene.load({{reader.page_count()}}), std::invalid_argument);
}

TEST_CASE("partial reader: a source that is too short or has no superblock is refused",
          "[store][partial]") {
  for (const std::size_t bytes : {0U, 1U, 8191U, 8192U, 20480U}) {
    Bytes source{std::vector<std::byte>(bytes)};
    CHECK(broken_rule(source) == "spec/container.md#superblock-magic");
  }
}

TEST_CASE("partial reader: good vectors are read, and bad ones are refused by no other rule",
          "[store][partial][vectors]") {
  const auto root = std::filesystem::path(PTC_SOURCE_DIR) / "spec/vectors";
  for (const auto& entry : std::filesystem::directory_iterator(root / "good")) {
    if (entry.path().extension() != ".ptcx") continue;
    INFO(entry.path().filename());
    Bytes source(read_file(entry.path()));
    CHECK(broken_rule(source) == "none");
  }
  unsigned refused = 0;
  for (const auto& entry : std::filesystem::directory_iterator(root / "bad")) {
    if (entry.path().extension() != ".ptcx") continue;
    INFO(entry.path().filename());
    Bytes source(read_file(entry.path()));
    const std::string rule = rule_of(entry.path()), found = broken_rule(source);
    if (may_leave_out(rule, entry.path().stem().extension().string())) continue;
    CHECK(found == rule);
    ++refused;
  }
  CHECK(refused > 150);
}
