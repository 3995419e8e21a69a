// Property, for any bytes as a container: ContainerReader opens the file and reads every page, with
// the values that it promises, or throws FormatError. The verifier does not accept what the reader
// refuses.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "format/error.h"
#include "format/node_page.h"
#include "format/point_page.h"
#include "fuzz/memory_file.h"
#include "fuzz/require.h"

namespace {

using ptc::ContainerReader;
using ptc::fuzz::require;

// Runs a body and says whether it ended without FormatError.
template <class Body>
bool accepts(const Body& body) {
  try {
    body();
    return true;
  } catch (const ptc::FormatError&) {
    return false;
  }
}

// Checks what opening promises of the places of pages: the number of each follows from its type,
// group and rank, and the superblock repeats the last entries.
void check_places(const ContainerReader& reader) {
  const auto check = [&](const ptc::PageNumbers::Range& pages, ptc::PageType type,
                         std::uint8_t group) {
    for (std::uint32_t rank = 0; rank < pages.count; ++rank) {
      const ptc::DirectoryEntry& entry = reader.entry(pages[rank]);
      require(entry.type == type && entry.group == group && reader.rank(pages[rank]) == rank);
    }
    return pages.count;
  };
  std::uint32_t known = check(reader.point_pages(), ptc::PageType::point, 0) +
                        check(reader.node_pages(), ptc::PageType::node, 0) + 1;
  for (const std::uint8_t group : reader.groups())
    known += check(reader.attribute_pages(group), ptc::PageType::attribute, group);
  for (const ptc::DirectoryEntry& entry : reader.entries())
    known += entry.type == ptc::PageType::parts || is_skippable(entry.type) ? 1U : 0U;
  require(known == reader.page_count() && reader.meta_page() == known - 1);
  const std::vector<ptc::DirectoryEntry>& tail = reader.superblock().tail;
  require(!tail.empty() && std::ranges::equal(reader.entries().last(tail.size()), tail));
}

void check_nodes(const ContainerReader& reader, const ptc::NodePage& page) {
  for (std::uint32_t slot = 0; slot < page.size(); ++slot) {
    require(!page[slot].emits() || reader.header().point_bytes == ptc::kEmittingPointBytes);
    for (const ptc::NodeChild& child : page.decode(slot).children) {
      const ptc::ChildRef& ref = child.ref;
      require(ref.interior ? ref.page < reader.node_pages().count &&
                                 ref.slot < reader.entry(reader.node_pages()[ref.page]).record_count
                           : ref.point_count > 0 &&
                                 ref.first_point + ref.point_count <= reader.superblock().points);
    }
  }
}

void check_points(const ptc::PointPage& page) {
  for (std::uint32_t i = 0; i < page.size(); ++i) {
    const ptc::PointRecord point = page[i];
    require(point.radius >= 0 && std::isfinite(point.radius) &&
            std::ranges::max(point.radiance) < 0x7c00 && std::ranges::max(point.emission) < 0x7c00);
    require(page.emits() || point.emission == ptc::Half3{});
  }
}

// Checks that an attribute page has as many values as its point page has points, and that those of
// a void one are unknown.
void check_attributes(const ContainerReader& reader, std::uint32_t page,
                      const ptc::PageHeader& header, std::span<const std::byte> payload) {
  require(header.record_count == reader.entry(reader.point_pages()[header.rank]).record_count);
  for (const ptc::Channel& channel : reader.meta().channels) {
    if (channel.group != header.group) continue;
    const std::size_t width = channel.component_bytes();
    for (std::size_t i = 0; i < std::size_t{channel.components} * header.record_count; ++i) {
      require(payload.size() >= width);
      std::uint64_t value = 0;
      std::memcpy(&value, payload.data(), width);
      require(!reader.entry(page).is_void() || value == channel.no_value.value_or(0));
      payload = payload.subspan(width);
    }
  }
  require(payload.empty());
}

// Checks what read_page() promises of a page that it returns.
void check_promises(const ContainerReader& reader, std::uint32_t page,
                    const ptc::PageHeader& header, std::span<const std::byte> payload) {
  require(header.type == reader.entry(page).type && header.group == reader.entry(page).group &&
          header.rank == reader.rank(page));
  if (header.type == ptc::PageType::node)
    check_nodes(reader, ptc::NodePage(payload.data(), header.record_count));
  if (header.type == ptc::PageType::point) {
    check_points(ptc::PointPage(payload.data(), header.record_count, reader.header().point_bytes));
  }
  if (header.type == ptc::PageType::attribute)
    check_attributes(reader, page, header, payload.first(header.raw_bytes));
}

// Reads a page whole, then its stored payload, then its header. A read that checks less must accept
// whatever one that checks more has accepted.
bool read_page(const ContainerReader& reader, std::uint32_t page, ptc::PageDecoder& decoder) {
  std::vector<std::byte> read(reader.page_payload_limit()), stored;
  ptc::PageHeader header;
  const bool whole = accepts([&] { header = reader.read_page(page, read, decoder); });
  if (whole) check_promises(reader, page, header, read);
  const bool found = accepts([&] { static_cast<void>(reader.read_page_header(page)); });
  const bool copied = accepts([&] { static_cast<void>(reader.read_stored_page(page, stored)); });
  require(whole <= copied && copied <= found);
  return whole;
}

// Opens a file, reads all pages, and says whether nothing was refused.
bool read_all(const std::filesystem::path& path) {
  bool whole = true;
  return accepts([&] {
           const ContainerReader reader(path);
           check_places(reader);
           ptc::PageDecoder decoder;
           for (std::uint32_t page = 0; page < reader.page_count(); ++page)
             whole &= read_page(reader, page, decoder);
         }) &&
         whole;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const ptc::fuzz::MemoryFile file({reinterpret_cast<const std::byte*>(data), size}, "a.ptcx");
  const bool read = read_all(file.path());
  ptc::Progress silent;
  const ptc::VerifyReport report = verify_container(
      file.path(), {.memory_bytes = std::uint64_t{1} << 30, .threads = 1, .flip_budget = 1 << 20},
      silent);
  require(read || !report.sound());
  return 0;
}
