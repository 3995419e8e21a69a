// From the commit record at the end of the file to verified pages (spec/container.md#opening):
//
//   superblock -> directory -> numbers of pages by kind -> meta page -> any page, on request
#include "engine/store/reader.h"

#include <array>
#include <memory>
#include <stdexcept>
#include <string>

#include "engine/store/commit.h"
#include "format/checksum.h"
#include "format/error.h"

namespace ptc {
namespace {

// An open container keeps the decoded entries. While it opens, it reads the encoded ones into a
// vector whose capacity doubles as it grows, so that this takes up to twice their bytes.
static_assert(ContainerReader::kPageBytes == sizeof(DirectoryEntry));
static_assert(ContainerReader::kMaxPageBytes == 2 * kDirectoryEntryBytes + sizeof(DirectoryEntry));

}  // namespace

ContainerReader::ContainerReader(const std::filesystem::path& path, OpenParts parts)
    : file_(path),
      header_(read_file_header(file_)),
      superblock_(read_superblock(file_, header_)),
      entries_(read_directory(file_, superblock_)) {
  at_offset(file_, 0, [&] { verify_pages(superblock_, entries_); });
  numbers_ = page_numbers(superblock_, entries_);
  meta_ = read_meta();
  columns_ = columns_by_group(meta_);
  at_offset(file_, 0, [&] { verify_attributes(superblock_, entries_, meta_); });
  if (header_.has_parts() && parts == OpenParts::yes) open_parts();
}

std::size_t ContainerReader::page_payload_limit() const noexcept {
  return payload_limit(header_.page_shift);
}

const DirectoryEntry& ContainerReader::entry(std::uint32_t page) const {
  if (page < entries_.size()) return entries_[page];
  throw std::invalid_argument(path().string() + ": page " + std::to_string(page) + " of " +
                              std::to_string(entries_.size()));
}

std::span<const PackedColumn> ContainerReader::attribute_columns(std::uint8_t group) const {
  const auto found = columns_.find(group);
  if (found == columns_.end()) return {};
  return found->second;
}

// The header of a whole image, whose payload must have the checksum that the header states.
PageHeader ContainerReader::checked_header(std::uint32_t page,
                                           std::span<const std::byte> image) const {
  const PageHeader found = decode_agreed_header(image, header_, entries_[page], rank(page));
  check_payload(image, found);
  return found;
}

ContainerReader::PageRange ContainerReader::page_range(std::uint32_t page) const {
  const DirectoryEntry& where = entry(page);
  if (where.is_void()) return {};
  const std::optional<PartPage> in_part = part_page(page);
  return {.offset = where.offset,
          .bytes = kPageHeaderBytes + std::size_t{where.stored_bytes},
          .part = in_part ? static_cast<std::uint32_t>(in_part->part + 1) : 0};
}

// Makes up the header of an attribute page that is not in the file.
PageHeader ContainerReader::void_header(std::uint32_t page) const {
  const DirectoryEntry& entry = entries_[page];
  return {.type = entry.type,
          .group = entry.group,
          .rank = rank(page),
          .record_count = entry.record_count};
}

// Makes up the header and the payload of an attribute page that is not in the file.
PageHeader ContainerReader::void_page(std::uint32_t page, std::span<std::byte> out) const {
  PageHeader header = void_header(page);
  const std::size_t bytes = header.record_count * group_point_bytes(meta_.channels, header.group);
  fill_void(meta_.channels, header.group, out.first(bytes));
  header.raw_bytes = static_cast<std::uint32_t>(bytes);
  return header;
}

PageHeader ContainerReader::decode_page(std::uint32_t page, std::span<const std::byte> image,
                                        std::span<std::byte> out, PageDecoder& decoder) const {
  if (entry(page).is_void()) return void_page(page, out);
  if (const std::optional<PartPage> at = part_page(page)) {
    const PageHeader found = parts_[at->part]->decode_page(at->page, image, out, decoder);
    if (found.type == PageType::node)
      renumber(out.first(found.raw_bytes), found.record_count, at->part);
    return found;
  }
  return at_page(file_, entry(page).offset, page, [&] {
    const PageHeader found = checked_header(page, image);
    // References of a scene that has not opened its parts may lead into these.
    const PageNumbers::Range nodes =
        header_.has_parts() && parts_.empty() ? PageNumbers::Range{} : node_pages();
    decode_payload(found, image.subspan(kPageHeaderBytes),
                   {.point_bytes = header_.point_bytes,
                    .node_pages = std::span(entries_).subspan(nodes.first, nodes.count),
                    .own_pages = places_.empty() ? kNoPage : places_.front().first_node_page,
                    .points = superblock_.points,
                    .columns = &columns_},
                   out, decoder);
    if (found.type == PageType::node && !parts_.empty())
      renumber_top(out.first(found.raw_bytes), found.record_count);
    return found;
  });
}

PageHeader ContainerReader::read_page(std::uint32_t page, std::span<std::byte> out,
                                      PageDecoder& decoder) const {
  if (out.size() < page_payload_limit()) {
    throw std::invalid_argument("read_page: the buffer is smaller than a page's payload may be");
  }
  const PageRange where = page_range(page);
  const auto image = std::make_unique_for_overwrite<std::byte[]>(where.bytes);
  file(where.part).read_at(where.offset, {image.get(), where.bytes});
  return decode_page(page, {image.get(), where.bytes}, out, decoder);
}

PageHeader ContainerReader::read_page_header(std::uint32_t page) const {
  const DirectoryEntry& where = entry(page);
  if (where.is_void()) return void_header(page);
  if (const std::optional<PartPage> at = part_page(page))
    return parts_[at->part]->read_page_header(at->page);
  std::array<std::byte, kPageHeaderBytes> image;
  file_.read_at(where.offset, image);
  return at_page(file_, where.offset, page,
                 [&] { return decode_agreed_header(image, header_, where, rank(page)); });
}

PageHeader ContainerReader::read_stored_page(std::uint32_t page,
                                             std::vector<std::byte>& stored) const {
  if (const std::optional<PartPage> at = part_page(page))
    return parts_[at->part]->read_stored_page(at->page, stored);
  const PageRange where = page_range(page);
  stored.resize(where.bytes);
  if (stored.empty()) return void_header(page);
  file_.read_at(where.offset, stored);
  const PageHeader found =
      at_page(file_, where.offset, page, [&] { return checked_header(page, stored); });
  stored.erase(stored.begin(), stored.begin() + kPageHeaderBytes);
  return found;
}

Meta ContainerReader::read_meta() const {
  const std::uint32_t page = meta_page();
  std::vector<std::byte> payload(page_payload_limit());
  PageDecoder decoder;
  const PageHeader found = read_page(page, payload, decoder);
  return at_page(file_, entries_[page].offset, page, [&] {
    try {
      return decode_meta(std::span(payload).first(found.raw_bytes), header_.point_bytes);
    } catch (const FormatError& error) {
      throw placed_in_page(error, found);
    }
  });
}

}  // namespace ptc
