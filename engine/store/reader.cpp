// From the commit record at the end of the file to verified pages (spec/container.md#opening):
//
//   superblock -> directory -> index of pages by kind -> meta page -> any page, on request
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

constexpr char kAgreement[] = "spec/container.md#page-agreement";
constexpr char kPayload[] = "spec/container.md#page-payload";

}  // namespace

ContainerReader::ContainerReader(const std::filesystem::path& path)
    : file_(path),
      header_(read_file_header(file_)),
      superblock_(read_superblock(file_, header_)),
      entries_(read_directory(file_, superblock_)),
      index_(index_pages(entries_)) {
  at_offset(file_, 0, [&] { verify_pages(superblock_, entries_, index_); });
  meta_ = read_meta();
  columns_ = columns_by_group(meta_);
  at_offset(file_, 0, [&] { verify_attributes(superblock_, entries_, index_, meta_); });
}

std::size_t ContainerReader::page_payload_limit() const noexcept {
  return (std::size_t{1} << header_.page_shift) - kPageHeaderBytes;
}

const DirectoryEntry& ContainerReader::entry(std::uint32_t page) const {
  if (page < entries_.size()) return entries_[page];
  throw std::invalid_argument(path().string() + ": page " + std::to_string(page) + " of " +
                              std::to_string(entries_.size()));
}

std::span<const std::uint32_t> ContainerReader::attribute_pages(std::uint16_t group) const {
  const auto pages = index_.attributes.find(group);
  if (pages == index_.attributes.end()) return {};
  return pages->second;
}

std::span<const PackedColumn> ContainerReader::attribute_columns(std::uint16_t group) const {
  const auto found = columns_.find(group);
  if (found == columns_.end()) return {};
  return found->second;
}

// The header at the front of a page's image, which the directory must agree with.
PageHeader ContainerReader::agreed_header(std::uint32_t page,
                                          std::span<const std::byte> image) const {
  const PageHeader found = decode_page_header(image.first(kPageHeaderBytes), header_);
  if (found.page_id != page || entry_of(found, entries_[page].offset) != entries_[page]) {
    throw FormatError(0, kAgreement, "the page header is not what the directory says");
  }
  return found;
}

// The header of a whole image, whose payload must have the checksum that the header states.
PageHeader ContainerReader::checked_header(std::uint32_t page,
                                           std::span<const std::byte> image) const {
  const PageHeader found = agreed_header(page, image);
  if (xxh3_64(image.subspan(kPageHeaderBytes)) != found.payload_xxh3) {
    throw FormatError(kPageHeaderBytes, kPayload, "payload's checksum is wrong");
  }
  return found;
}

ContainerReader::PageRange ContainerReader::page_range(std::uint32_t page) const {
  const DirectoryEntry& where = entry(page);
  return {where.offset, kPageHeaderBytes + std::size_t{where.stored_bytes}};
}

PageHeader ContainerReader::decode_page(std::uint32_t page, std::span<const std::byte> image,
                                        std::span<std::byte> out, PageDecoder& decoder) const {
  return at_page(file_, entry(page).offset, page, [&] {
    const PageHeader found = checked_header(page, image);
    decode_payload(found, image.subspan(kPageHeaderBytes),
                   {entries_, superblock_.points, &columns_}, out, decoder);
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
  file_.read_at(where.offset, {image.get(), where.bytes});
  return decode_page(page, {image.get(), where.bytes}, out, decoder);
}

PageHeader ContainerReader::read_page_header(std::uint32_t page) const {
  const DirectoryEntry& where = entry(page);
  std::array<std::byte, kPageHeaderBytes> image;
  file_.read_at(where.offset, image);
  return at_page(file_, where.offset, page, [&] { return agreed_header(page, image); });
}

PageHeader ContainerReader::read_stored_page(std::uint32_t page,
                                             std::vector<std::byte>& stored) const {
  const PageRange where = page_range(page);
  stored.resize(where.bytes);
  file_.read_at(where.offset, stored);
  const PageHeader found =
      at_page(file_, where.offset, page, [&] { return checked_header(page, stored); });
  stored.erase(stored.begin(), stored.begin() + kPageHeaderBytes);
  return found;
}

Meta ContainerReader::read_meta() const {
  const std::uint32_t page = superblock_.meta_page;
  std::vector<std::byte> payload(page_payload_limit());
  PageDecoder decoder;
  const PageHeader found = read_page(page, payload, decoder);
  return at_page(file_, entries_[page].offset, page, [&] {
    try {
      return decode_meta(std::span(payload).first(found.raw_bytes));
    } catch (const FormatError& error) {
      throw placed_in_page(error, found);
    }
  });
}

}  // namespace ptc
