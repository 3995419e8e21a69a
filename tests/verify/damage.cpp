// Containers whose checksums are made correct again after a change (spec/checksums.md).
#include "tests/verify/damage.h"

#include <algorithm>
#include <stdexcept>

#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "format/checksum.h"
#include "tests/support/scenes.h"

namespace ptc::test {

std::vector<Surfel> small_scene() {
  std::vector<Surfel> surfels;
  add_rectangle(surfels, {0, 0, 0}, {0, 0, 1}, {1, 0, 0}, 0.2, {1, 0.5F, 0.25F});
  add_rectangle(surfels, {0, 0, 0}, {0, 1, 0}, {0, 0, 1}, 0.25, {0.1F, 0.9F, 0.3F});
  add_sphere(surfels, {0.5, 0.4, 0.5}, 0.2, 0.12, {2, 3, 4});
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    surfels[i].radiance *= static_cast<float>(1 + i % 7) * 0.5F;
  }
  return surfels;
}

std::string fault_of(const std::filesystem::path& path, unsigned threads) {
  Progress silent;
  std::string faults;
  for (const Finding& finding :
       verify_container(path, {.threads = threads, .flip_budget = 0}, silent).findings) {
    faults += line_of(finding) + "\n";
  }
  return faults;
}

OpenContainer::OpenContainer(const std::filesystem::path& path) : bytes_(read_file(path)) {
  const ContainerReader container(path);
  superblock_ = container.superblock();
  if (superblock_.directory_pages != 1) throw std::invalid_argument("more than one directory page");
  for (std::uint32_t page = 0; page < container.page_count(); ++page) {
    entries_.push_back(container.entry(page));
    if (entries_.back().is_void()) throw std::invalid_argument("a void page");
    headers_.push_back(decode_page_header(
        std::span(bytes_).subspan(entries_.back().offset, kPageHeaderBytes), container.header()));
    if (headers_.back().coding.codec != Codec::raw)
      throw std::invalid_argument("a page that is not raw");
  }
}

std::span<std::byte> OpenContainer::payload(std::size_t page) {
  return std::span(bytes_).subspan(entries_[page].offset + kPageHeaderBytes,
                                   entries_[page].stored_bytes);
}

void OpenContainer::write(const std::filesystem::path& target) {
  const Uuid& uuid = superblock_.header.uuid;
  const auto header_at = [&](std::uint64_t offset) {
    return std::span(bytes_).subspan(offset).first<kPageHeaderBytes>();
  };
  const auto directory = std::span(bytes_).subspan(superblock_.directory_offset + kPageHeaderBytes,
                                                   entries_.size() * kDirectoryEntryBytes);
  ContentDigest digest;
  for (std::size_t page = 0; page < entries_.size(); ++page) {
    PageHeader& header = headers_[page];
    DirectoryEntry& entry = entries_[page];
    header.payload_xxh3 = entry.payload_xxh3 = xxh3_64(payload(page));
    header.stored_bytes = entry.stored_bytes;
    entry = entry_of(header, entry.offset);
    encode_page_header(header, uuid, header_at(entry.offset));
    encode_directory_entry(
        entry, directory.subspan(page * kDirectoryEntryBytes).first<kDirectoryEntryBytes>());
    digest.add(entry);
  }
  PageHeader header =
      decode_page_header(header_at(superblock_.directory_offset), superblock_.header);
  header.payload_xxh3 = superblock_.directory_xxh3 = xxh3_64(directory);
  encode_page_header(header, uuid, header_at(superblock_.directory_offset));
  superblock_.content_xxh3 = digest.value();
  const auto tail = std::span(entries_).last(superblock_.tail.size());
  superblock_.tail.assign(tail.begin(), tail.end());
  const Block block = encode_superblock(superblock_);
  for (const std::size_t back : {2 * kBlockBytes, kBlockBytes}) {
    std::ranges::copy(block, bytes_.end() - static_cast<std::ptrdiff_t>(back));
  }
  write_file(target, bytes_);
}

}  // namespace ptc::test
