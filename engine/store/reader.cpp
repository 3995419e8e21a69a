// From the commit record at the end of the file to verified pages (spec/container.md).
#include "engine/store/reader.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

#include "engine/io/file/file.h"
#include "engine/store/commit.h"
#include "engine/store/page_content.h"
#include "engine/store/structure.h"
#include "format/checksum.h"
#include "format/error.h"

namespace ptc {
namespace {

constexpr char kAgreement[] = "spec/container.md#page-agreement";
constexpr char kPayload[] = "spec/container.md#page-payload";

}  // namespace

struct ContainerReader::Impl {
  explicit Impl(const std::filesystem::path& path)
      : file(path),
        header(read_file_header(file)),
        superblock(read_superblock(file, header)),
        entries(read_directory(file, superblock)),
        index(index_pages(entries)) {
    at_offset(file, 0, [&] { verify_pages(superblock, entries, index); });
    meta = read_meta();
    columns = columns_by_group(meta);
    at_offset(file, 0, [&] { verify_attributes(superblock, entries, index, meta); });
  }

  const DirectoryEntry& entry(std::uint32_t page) const {
    if (page < entries.size()) return entries[page];
    throw std::invalid_argument(file.path().string() + ": page " + std::to_string(page) + " of " +
                                std::to_string(entries.size()));
  }

  /// The header of the page whose image begins so, when the directory agrees with it.
  PageHeader agreed_header(std::uint32_t page, std::span<const std::byte> image) const {
    const PageHeader found = decode_page_header(image.first(kPageHeaderBytes), header);
    if (found.page_id != page || entry_of(found, entries[page].offset) != entries[page]) {
      throw FormatError(0, kAgreement, "the page header is not what the directory says");
    }
    return found;
  }

  /// Likewise of a whole image, when its payload's checksum is right too.
  PageHeader checked_header(std::uint32_t page, std::span<const std::byte> image) const {
    const PageHeader found = agreed_header(page, image);
    if (xxh3_64(image.subspan(kPageHeaderBytes)) != found.payload_xxh3) {
      throw FormatError(kPageHeaderBytes, kPayload, "payload's checksum is wrong");
    }
    return found;
  }

  std::span<const PackedColumn> columns_of(std::uint16_t group) const {
    const auto found = columns.find(group);
    if (found == columns.end()) return {};
    return found->second;
  }

  PageRange range(std::uint32_t page) const {
    const DirectoryEntry& where = entry(page);
    return {where.offset, kPageHeaderBytes + std::size_t{where.stored_bytes}};
  }

  PageHeader decode(std::uint32_t page, std::span<const std::byte> image, std::span<std::byte> out,
                    PageDecoder& decoder) const {
    return at_page(file, entry(page).offset, page, [&] {
      const PageHeader found = checked_header(page, image);
      decode_payload(found, image.subspan(kPageHeaderBytes), {entries, superblock.points, &columns},
                     out, decoder);
      return found;
    });
  }

  PageHeader read(std::uint32_t page, std::span<std::byte> out, PageDecoder& decoder) const {
    const PageRange where = range(page);
    const auto image = std::make_unique_for_overwrite<std::byte[]>(where.bytes);
    file.read_at(where.offset, {image.get(), where.bytes});
    return decode(page, {image.get(), where.bytes}, out, decoder);
  }

  Meta read_meta() const {
    const DirectoryEntry& where = entries[superblock.meta_page];
    std::vector<std::byte> payload(where.raw_bytes);
    PageDecoder decoder;
    const PageHeader found = read(superblock.meta_page, payload, decoder);
    return at_page(file, where.offset, superblock.meta_page, [&] {
      try {
        return decode_meta(payload);
      } catch (const FormatError& error) {
        throw placed_in_page(error, found);
      }
    });
  }

  InputFile file;
  FileHeader header;
  Superblock superblock;
  std::vector<DirectoryEntry> entries;
  PageIndex index;
  Meta meta;
  GroupColumns columns;
};

ContainerReader::ContainerReader(const std::filesystem::path& path)
    : impl_(std::make_unique<Impl>(path)) {}

ContainerReader::~ContainerReader() = default;

const std::filesystem::path& ContainerReader::path() const noexcept {
  return impl_->file.path();
}

const FileHeader& ContainerReader::header() const noexcept {
  return impl_->header;
}

const Superblock& ContainerReader::superblock() const noexcept {
  return impl_->superblock;
}

const Meta& ContainerReader::meta() const noexcept {
  return impl_->meta;
}

std::uint32_t ContainerReader::page_count() const noexcept {
  return impl_->superblock.page_count;
}

std::size_t ContainerReader::page_payload_limit() const noexcept {
  return (std::size_t{1} << impl_->header.page_shift) - kPageHeaderBytes;
}

const DirectoryEntry& ContainerReader::entry(std::uint32_t page) const {
  return impl_->entry(page);
}

std::span<const DirectoryEntry> ContainerReader::entries() const noexcept {
  return impl_->entries;
}

std::span<const std::uint32_t> ContainerReader::point_pages() const noexcept {
  return impl_->index.points;
}

std::span<const std::uint32_t> ContainerReader::node_pages() const noexcept {
  return impl_->index.nodes;
}

std::span<const std::uint32_t> ContainerReader::attribute_pages(std::uint16_t group) const {
  const auto pages = impl_->index.attributes.find(group);
  if (pages == impl_->index.attributes.end()) return {};
  return pages->second;
}

std::span<const PackedColumn> ContainerReader::attribute_columns(std::uint16_t group) const {
  return impl_->columns_of(group);
}

PageHeader ContainerReader::read_page_header(std::uint32_t page) const {
  const DirectoryEntry& where = impl_->entry(page);
  std::array<std::byte, kPageHeaderBytes> image;
  impl_->file.read_at(where.offset, image);
  return at_page(impl_->file, where.offset, page,
                 [&] { return impl_->agreed_header(page, image); });
}

ContainerReader::PageRange ContainerReader::page_range(std::uint32_t page) const {
  return impl_->range(page);
}

const InputFile& ContainerReader::file() const noexcept {
  return impl_->file;
}

PageHeader ContainerReader::read_page(std::uint32_t page, std::span<std::byte> out,
                                      PageDecoder& decoder) const {
  if (out.size() < page_payload_limit()) {
    throw std::invalid_argument("read_page: the buffer is smaller than a page's payload may be");
  }
  return impl_->read(page, out, decoder);
}

PageHeader ContainerReader::decode_page(std::uint32_t page, std::span<const std::byte> image,
                                        std::span<std::byte> out, PageDecoder& decoder) const {
  return impl_->decode(page, image, out, decoder);
}

PageHeader ContainerReader::read_stored_page(std::uint32_t page,
                                             std::vector<std::byte>& stored) const {
  const DirectoryEntry& where = impl_->entry(page);
  stored.resize(kPageHeaderBytes + std::size_t{where.stored_bytes});
  impl_->file.read_at(where.offset, stored);
  const PageHeader found =
      at_page(impl_->file, where.offset, page, [&] { return impl_->checked_header(page, stored); });
  stored.erase(stored.begin(), stored.begin() + kPageHeaderBytes);
  return found;
}

}  // namespace ptc
