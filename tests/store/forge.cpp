// Takes containers apart and puts them together with nothing but the encoders: the oracle for the
// writer.
#include "tests/store/forge.h"

#include <algorithm>
#include <span>

#include "format/checksum.h"
#include "tests/store/sample.h"

namespace ptc::test {
namespace {

void put(std::vector<std::byte>& file, std::uint64_t offset, std::span<const std::byte> bytes) {
  if (file.size() < offset + bytes.size()) file.resize(offset + bytes.size());
  std::ranges::copy(bytes, file.begin() + static_cast<std::ptrdiff_t>(offset));
}

void put_page(std::vector<std::byte>& file, std::uint64_t offset, const PageHeader& header,
              const Uuid& uuid, std::span<const std::byte> stored) {
  std::array<std::byte, kPageHeaderBytes> head;
  encode_page_header(header, uuid, head);
  put(file, offset, head);
  put(file, offset + kPageHeaderBytes, stored);
}

std::vector<std::byte> encode_entries(const std::vector<DirectoryEntry>& entries) {
  std::vector<std::byte> all(entries.size() * kDirectoryEntryBytes);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    encode_directory_entry(
        entries[i], std::span(all).subspan(i * kDirectoryEntryBytes).first<kDirectoryEntryBytes>());
  }
  return all;
}

}  // namespace

Forgery::Forgery(const std::filesystem::path& path) {
  const std::vector<std::byte> file = read_file(path);
  const std::span all(file);
  header = decode_file_header(all.first(kBlockBytes));
  superblock = decode_superblock(all.last(kBlockBytes), header, file.size());
  const std::uint32_t per_page = directory_entries_per_page(header);
  for (std::uint32_t i = 0; i < superblock.page_count; ++i) {
    const std::size_t at =
        superblock.directory_offset + (std::size_t{i / per_page} << header.page_shift);
    if (i % per_page == 0) directory.push_back(decode_page_header(all.subspan(at), header));
    const auto entry = all.subspan(at + kPageHeaderBytes + i % per_page * kDirectoryEntryBytes);
    entries.push_back(decode_directory_entry(entry, header, file.size()));
    const DirectoryEntry& it = entries.back();
    if (it.raw_bytes == 0) {
      pages.emplace_back();
      continue;
    }
    const auto stored = all.subspan(it.offset + kPageHeaderBytes, it.stored_bytes);
    pages.push_back({it.offset,
                     decode_page_header(all.subspan(it.offset), header),
                     {stored.begin(), stored.end()}});
  }
}

std::vector<std::byte> Forgery::bytes() const {
  std::vector<std::byte> file(superblock.directory_offset);
  put(file, 0, encode_file_header(header));
  std::vector<DirectoryEntry> listed = entries;
  for (std::size_t i = 0; i < pages.size(); ++i) {
    if (i < listed.size() && listed[i].raw_bytes == 0) continue;
    PageHeader head = pages[i].header;
    if (rehash_payloads) {
      head.payload_xxh3 = xxh3_64(pages[i].stored);
      if (i < listed.size()) listed[i].payload_xxh3 = head.payload_xxh3;
    }
    put_page(file, pages[i].offset, head, header.uuid, pages[i].stored);
  }

  const std::vector<std::byte> all = encode_entries(listed);
  const std::size_t full = directory_entries_per_page(header) * kDirectoryEntryBytes;
  for (std::size_t i = 0; i < directory.size(); ++i) {
    const auto rest = std::span(all).subspan(std::min(i * full, all.size()));
    const auto part = rest.first(std::min(full, rest.size()));
    PageHeader head = directory[i];
    if (rehash_directory_pages) head.payload_xxh3 = xxh3_64(part);
    put_page(file, superblock.directory_offset + (i << header.page_shift), head, header.uuid, part);
  }

  Superblock first = superblock;
  first.header = header;
  if (rehash_directory) {
    first.content_xxh3 = content_digest(listed);
    first.directory_xxh3 = xxh3_64(all);
    first.tail.assign(listed.end() - static_cast<std::ptrdiff_t>(first.tail.size()), listed.end());
  }
  Superblock second = first;
  if (last_word) last_word(first, second);
  put(file, superblock.file_bytes - 2 * kBlockBytes, encode_superblock(first));
  put(file, superblock.file_bytes - kBlockBytes, encode_superblock(second));
  return file;
}

}  // namespace ptc::test
