// The vectors of the specification, decoded by format/: good ones decode, and bad ones are refused
// by each rule that a decoder can check alone. The file names say which rule.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>

#include <catch2/catch.hpp>

#include "format/checksum.h"
#include "format/codec.h"
#include "format/container.h"
#include "format/node_page.h"
#include "format/parts_page.h"
#include "format/point_page.h"
#include "format/schema.h"
#include "tests/format/support.h"

using namespace ptc;
using ptc::test::clause_of;
using Bytes = std::vector<std::byte>;
using Path = std::filesystem::path;

namespace {

std::vector<Path> vectors(const char* folder) {
  std::vector<Path> paths;
  for (const auto& file :
       std::filesystem::directory_iterator(Path(PTC_SOURCE_DIR) / "spec/vectors" / folder)) {
    if (file.path().extension() == ".ptcx") paths.push_back(file.path());
  }
  std::ranges::sort(paths);
  return paths;
}

Bytes read(const Path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

// container-page-keys.groups.ptcx to spec/container.md#page-keys.
std::string rule_of(const Path& path) {
  std::string name = path.filename().string();
  name = name.substr(0, name.find('.'));
  const std::size_t dash = name.find('-');
  return "spec/" + name.substr(0, dash) + ".md#" + name.substr(dash + 1);
}

// Decodes everything, without comparing structures with one another.
struct Walk {
  std::uint64_t points = 0;
  std::uint64_t groups = 0;
  std::uint64_t nodes = 0;
  Superblock superblock;
  std::optional<PartList> parts;  ///< of a scene of parts
};

void walk_page(std::span<const std::byte> page, const FileHeader& file, Walk& walk) {
  const PageHeader header = decode_page_header(page.first(kPageHeaderBytes), file);
  const auto stored = page.subspan(kPageHeaderBytes, header.stored_bytes);
  if (xxh3_64(stored) != header.payload_xxh3) return;  // a matter for readers
  Bytes payload(header.raw_bytes);
  const bool filtered = header.coding.filter != Filter::none;
  if (filtered && header.type == PageType::attribute) return;  // its columns are in the meta page
  if (is_skippable(header.type)) return;
  PageDecoder().decode(header.coding, stored, payload,
                       {header.record_count, packed_point_columns(file.point_bytes)});
  switch (header.type) {
    case PageType::point:
      PointPage(payload, header.record_count, file.point_bytes).verify();
      walk.points += header.record_count;
      break;
    case PageType::node: {
      // References of a scene of parts lead into files that a decoder does not know.
      const bool parts = file.has_parts();
      const NodePage nodes(payload, header.record_count,
                           parts ? kNoPage : walk.superblock.node_pages, walk.superblock.points,
                           file.point_bytes != kPointBytes);
      walk.groups += nodes.size();
      for (std::uint32_t slot = 0; slot < nodes.size(); ++slot) {
        walk.nodes += nodes.decode(slot).children.size();
      }
      break;
    }
    case PageType::meta:
      (void)decode_meta(payload, file.point_bytes);
      break;
    case PageType::parts:
      if (!walk.parts) walk.parts.emplace(walk.superblock.node_pages);
      walk.parts->add_page(payload);
      break;
    case PageType::attribute:
    case PageType::directory:
      break;
  }
}

DirectoryEntry read_entry(std::span<const std::byte> file, const Superblock& superblock,
                          std::uint32_t page) {
  const std::uint32_t full = directory_entries_per_page(superblock.header);
  const auto listing = file.subspan(superblock.directory_offset +
                                    (std::size_t{page / full} << superblock.header.page_shift));
  (void)decode_page_header(listing.first(kPageHeaderBytes), superblock.header);
  const auto entry =
      listing.subspan(kPageHeaderBytes + page % full * kDirectoryEntryBytes, kDirectoryEntryBytes);
  return decode_directory_entry(entry, superblock.header, superblock.file_bytes);
}

Walk walk(const Bytes& file) {
  const std::span<const std::byte> bytes(file);
  const FileHeader header = decode_file_header(bytes.first(std::min(file.size(), kBlockBytes)));
  Walk walk;
  const std::size_t tail = file.size() - 2 * kBlockBytes;
  walk.superblock = decode_superblock(bytes.subspan(tail, kBlockBytes), header, file.size());
  for (std::uint32_t page = 0; page < walk.superblock.page_count; ++page) {
    const DirectoryEntry entry = read_entry(bytes, walk.superblock, page);
    if (entry.is_void()) continue;
    walk_page(bytes.subspan(entry.offset, kPageHeaderBytes + entry.stored_bytes), header, walk);
  }
  return walk;
}

// Rules about two structures at once, which engine/store checks.
bool needs_a_reader(const std::string& rule) {
  static const std::set<std::string> kRules{"spec/container.md#page-agreement",
                                            "spec/container.md#page-payload",
                                            "spec/container.md#directory-overlap",
                                            "spec/container.md#directory-pages",
                                            "spec/container.md#directory-listing",
                                            "spec/container.md#superblock-copies",
                                            "spec/container.md#superblock-digest",
                                            "spec/container.md#meta-page",
                                            "spec/points.md#point-pages",
                                            "spec/points.md#attribute-pages",
                                            "spec/nodes.md#references",
                                            "spec/parts.md#parts-page",
                                            "spec/parts.md#parts-file",
                                            "spec/parts.md#parts-top"};
  return kRules.contains(rule);
}

}  // namespace

TEST_CASE("vectors: good ones decode, and contain what their superblock counts",
          "[format][vectors]") {
  const auto paths = vectors("good");
  CHECK(paths.size() >= 10);
  for (const Path& path : paths) {
    INFO(path.filename());
    Walk found;
    REQUIRE(clause_of([&] { found = walk(read(path)); }) == "none");
    if (found.parts) {
      CHECK(found.parts->points() == found.superblock.points);
      continue;
    }
    CHECK(found.points == found.superblock.points);
    CHECK(found.groups == found.superblock.node_groups);
    CHECK(found.nodes == found.superblock.nodes);
  }
}

TEST_CASE("vectors: bad ones are refused by the rule that names them", "[format][vectors]") {
  unsigned checked = 0;
  for (const Path& path : vectors("bad")) {
    const std::string rule = rule_of(path);
    INFO(path.filename());
    // A decoder checks only the ranges of the root and the counts, does not compare the tail with
    // the directory, and does not look for superblocks.
    const std::string variant = path.stem().extension().string();
    const bool beyond = (rule == "spec/container.md#superblock-length" &&
                         (variant == ".three-bytes" || variant == ".half")) ||
                        (rule == "spec/container.md#superblock-root" && variant == ".slot") ||
                        (rule == "spec/container.md#superblock-counts" &&
                         (variant.empty() || variant == ".groups" || variant == ".nodes")) ||
                        (rule == "spec/container.md#tail-pages" && variant == ".other-entry") ||
                        (rule == "spec/parts.md#parts-count" && variant == ".superblock");
    // Faults of parts and of what a scene says of them take several files.
    const bool of_parts = variant == ".of-parts" || variant == ".of-a-part";
    if (needs_a_reader(rule) || beyond || of_parts) continue;
    CHECK(clause_of([&] { (void)walk(read(path)); }) == rule);
    ++checked;
  }
  CHECK(checked >= 80);
}

TEST_CASE("vectors: vectors for verifiers decode", "[format][vectors]") {
  const auto paths = vectors("verify");
  CHECK(paths.size() >= 20);
  for (const Path& path : paths) {
    INFO(path.filename());
    const std::string clause = clause_of([&] { (void)walk(read(path)); });
    CHECK((clause == "none" || clause == rule_of(path)));
  }
}

TEST_CASE("vectors: the decoded values of a good file encode to the same bytes",
          "[format][vectors]") {
  for (const Path& path : vectors("good")) {
    INFO(path.filename());
    const Bytes file = read(path);
    const std::span<const std::byte> bytes(file);
    const FileHeader header = decode_file_header(bytes.first(kBlockBytes));
    const Superblock superblock = decode_superblock(bytes.last(kBlockBytes), header, file.size());
    CHECK(std::ranges::equal(encode_file_header(header), bytes.first(kBlockBytes)));
    CHECK(std::ranges::equal(encode_superblock(superblock), bytes.last(kBlockBytes)));
    for (std::uint32_t page = 0; page < superblock.page_count; ++page) {
      const DirectoryEntry entry = read_entry(bytes, superblock, page);
      if (entry.is_void()) continue;
      const auto image = bytes.subspan(entry.offset, kPageHeaderBytes + entry.stored_bytes);
      const PageHeader page_header = decode_page_header(image.first(kPageHeaderBytes), header);
      std::array<std::byte, kPageHeaderBytes> again;
      encode_page_header(page_header, header.uuid, again);
      CHECK(std::ranges::equal(again, image.first(kPageHeaderBytes)));
      if (page_header.coding.codec != Codec::raw) continue;
      const auto payload = image.subspan(kPageHeaderBytes);
      if (page_header.type == PageType::meta) {
        CHECK(std::ranges::equal(
            encode_meta(decode_meta(payload, header.point_bytes), header.point_bytes), payload));
      }
      if (page_header.type == PageType::point) {
        const PointPage points(payload, page_header.record_count, header.point_bytes);
        std::vector<PointRecord> records;
        for (std::uint32_t i = 0; i < points.size(); ++i) records.push_back(points[i]);
        CHECK(std::ranges::equal(encode_point_page(records, header.point_bytes), payload));
      }
    }
  }
}
