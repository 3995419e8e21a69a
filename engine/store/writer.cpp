// Pages, directory and commit record in the order that makes a torn file recognisable
// (spec/container.md#publishing):
//
//   header | pages ... meta page | directory pages | sync | superblock A | B | sync | rename
#include "engine/store/writer.h"

#include <algorithm>
#include <array>
#include <future>
#include <stdexcept>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/store/commit.h"
#include "engine/store/entry_table.h"
#include "engine/store/structure.h"
#include "format/checksum.h"
#include "format/error.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr std::uint16_t kNoLevel = 0xffff;
constexpr std::uint64_t kPageBytes = 80;            // of memory a page, in finish()
constexpr std::uint64_t kEncoderBytes = 768 << 10;  // and two pages

void require(bool holds, const char* text) {
  if (!holds) throw std::invalid_argument(std::string("container writer: ") + text);
}

/// Runs a reader's check on what is about to be written: what fails it is the caller's mistake.
template <class Check>
void refuse_what_readers_refuse(Check&& check) {
  try {
    check();
  } catch (const FormatError& error) {
    throw std::invalid_argument(std::string("container writer: ") + error.what());
  }
}

FileHeader make_header(const WriterOptions& options) {
  FileHeader header;
  header.uuid = options.uuid;
  header.page_shift = options.page_shift;
  header.frame = options.frame;
  refuse_what_readers_refuse(
      [&] { static_cast<void>(decode_file_header(encode_file_header(header))); });
  return header;
}

}  // namespace

struct ContainerWriter::Impl {
  Impl(const std::filesystem::path& target, const WriterOptions& options)
      : header(make_header(options)),
        codec(options.codec),
        level(options.level),
        file(options.partial.empty() ? OutputFile(target) : OutputFile(target, options.partial)),
        entries(directory_of(file.temporary())) {
    if (!options.partial.empty()) file.truncate(0);
    file.write_at(0, encode_file_header(header));
  }

  Impl(const std::filesystem::path& target, const WriterOptions& options, const WriterState& state)
      : header(make_header(options)),
        codec(options.codec),
        level(options.level),
        file(target, options.partial),
        entries(directory_of(options.partial)),
        end(state.end) {
    static_cast<void>(entries.add(state.pages));
    find_pages(options.partial);
    file.truncate(end);
  }

  /// Fills the entries from the page headers.
  void find_pages(const std::filesystem::path& partial) {
    const InputFile in(partial);
    const auto check = [&](bool holds, const char* text) {
      if (!holds) throw DataError(partial.string() + ": " + text);
    };
    check(in.size() >= end && end >= kBlockBytes,
          "the unfinished container is shorter than it was");
    Block block;
    in.read_at(0, block);
    check(block == encode_file_header(header), "it is no unfinished container of this scene");
    std::uint64_t at = kBlockBytes;
    while (at < end) {
      std::array<std::byte, kPageHeaderBytes> bytes;
      in.read_at(at, bytes);
      const PageHeader page = at_offset(in, at, [&] { return decode_page_header(bytes, header); });
      check(page.page_id < entries.size() && !entries.has(page.page_id),
            "a page that was not written");
      entries.set(page.page_id, entry_of(page, at));
      at += extent_bytes(page.stored_bytes);
    }
    check(at == end, "the unfinished container's last page is cut");
  }

  [[nodiscard]] std::size_t payload_limit() const {
    return (std::size_t{1} << header.page_shift) - kPageHeaderBytes;
  }

  std::uint32_t reserve() {
    require(!finished, "a page after finish()");
    if (entries.size() >= kMaxPages) {
      throw DataError(file.target().string() + ": needs more than 2^32 - 2 pages");
    }
    return entries.add(1);
  }

  PageHeader page_header(std::uint32_t page_id, const PageFacts& facts) const {
    PageHeader page;
    page.type = facts.type;
    page.page_id = page_id;
    page.group = facts.group;
    page.level = facts.level;
    page.record_count = facts.record_count;
    page.first_key = facts.first_key;
    page.last_key = facts.last_key;
    return page;
  }

  /// A page as it will lie in the file: header, payload and zeros up to the next sector.
  struct Image {
    PageHeader page;
    std::vector<std::byte> bytes;
  };

  void make_image(Image& image, std::span<const std::byte> payload) const {
    image.page.stored_bytes = static_cast<std::uint32_t>(payload.size());
    image.page.payload_xxh3 = xxh3_64(payload);
    image.bytes.resize(extent_bytes(image.page.stored_bytes));
    encode_page_header(image.page, header.uuid, std::span(image.bytes).first<kPageHeaderBytes>());
    refuse_what_readers_refuse([&] { static_cast<void>(decode_page_header(image.bytes, header)); });
    const auto rest = std::ranges::copy(payload, image.bytes.begin() + kPageHeaderBytes).out;
    std::fill(rest, image.bytes.end(), std::byte{0});
  }

  /// At the end of the file, in one write.
  void append(const Image& image) {
    file.write_at(end, image.bytes);
    end += image.bytes.size();
  }

  void append_page(const Image& image) {
    const PageHeader& page = image.page;
    const std::uint64_t offset = end;
    require(page.page_id < entries.size(), "a page that was not reserved");
    require(!entries.has(page.page_id), "a page written twice");
    append(image);
    entries.set(page.page_id, entry_of(page, offset));
  }

  /// An encoder and what it fills, for one thread; kept between calls.
  struct Encoding {
    Encoding(Codec codec, int level) : encoder(codec, level) {}
    PageEncoder encoder;
    std::vector<std::byte> stored;
  };

  Encoding& encoding(std::size_t thread) {
    while (encodings.size() <= thread)
      encodings.push_back(std::make_unique<Encoding>(codec, level));
    return *encodings[thread];
  }

  void encode_page(std::uint32_t page_id, const PageFacts& facts,
                   std::span<const std::byte> payload, std::span<const PackedColumn> columns,
                   Encoding& with, Image& image) const {
    require(!payload.empty() && payload.size() <= payload_limit(),
            "a payload that is empty or longer than a page");
    image.page = page_header(page_id, facts);
    image.page.raw_bytes = static_cast<std::uint32_t>(payload.size());
    if (facts.type == PageType::point) columns = packed_point_columns();
    image.page.coding = with.encoder.encode(payload, with.stored, {facts.record_count, columns});
    make_image(image, with.stored);
  }

  /// Until the pages that are on their way are in the file.
  void wait() {
    if (writing.valid()) writing.get();
  }

  void begin_page() {
    require(!finished, "a page after finish()");
    wait();
  }

  void write_page(std::uint32_t page_id, const PageFacts& facts, std::span<const std::byte> payload,
                  std::span<const PackedColumn> columns = {}) {
    begin_page();
    encode_page(page_id, facts, payload, columns, encoding(0), single);
    append_page(single);
  }

  void write_pages(std::vector<Page> pages, const Executor& executor) {
    begin_page();
    if (images.size() < pages.size()) images.resize(pages.size());
    static_cast<void>(encoding(executor.threads() - 1));
    const auto write = [this, pages = std::move(pages), &executor] {
      executor.for_each(pages.size(), [&](std::size_t i, unsigned thread) {
        encode_page(pages[i].id, pages[i].facts, pages[i].payload, {}, *encodings[thread],
                    images[i]);
      });
      for (const Image& image : std::span(images).first(pages.size())) append_page(image);
    };
    if (executor.threads() == 1) return write();
    writing = std::async(std::launch::async, write);
  }

  std::uint32_t write_meta(const Meta& meta) {
    const std::uint32_t page = reserve();
    write_page(page, {PageType::meta, 0, kNoLevel, 1, 0, 0}, encode_meta(meta));
    return page;
  }

  /// Directory pages are numbered on from the last page and not compressed: they can be told apart
  /// and read without one another.
  void write_directory(std::span<const std::byte> all) {
    const std::size_t full = directory_entries_per_page(header) * kDirectoryEntryBytes;
    std::uint32_t page_id = entries.size();
    for (std::size_t at = 0; at < all.size(); at += full, ++page_id) {
      const auto part = all.subspan(at, std::min(full, all.size() - at));
      const auto count = static_cast<std::uint32_t>(part.size() / kDirectoryEntryBytes);
      single.page = page_header(page_id, {PageType::directory, 0, kNoLevel, count, 0, 0});
      single.page.raw_bytes = static_cast<std::uint32_t>(part.size());
      make_image(single, part);
      append(single);
    }
    end = round_up(end, kBlockBytes);
  }

  void complete(Superblock& superblock, std::span<const std::byte> directory) const {
    const std::uint32_t pages = entries.size();
    superblock.header = header;
    superblock.page_count = pages;
    superblock.directory_pages = (pages - 1) / directory_entries_per_page(header) + 1;
    superblock.directory_offset = end;
    superblock.directory_xxh3 = xxh3_64(directory);
    superblock.file_bytes = end + directory_bytes(header, pages) + 2 * kBlockBytes;
    superblock.points_per_page = points_per_page(header);
    if (superblock.writer.empty()) superblock.writer = writer_name();
  }

  std::vector<DirectoryEntry> decode_directory(std::span<const std::byte> all,
                                               std::uint64_t file_bytes) const {
    std::vector<DirectoryEntry> pages;
    pages.reserve(entries.size());
    for (; !all.empty(); all = all.subspan(kDirectoryEntryBytes))
      pages.push_back(decode_directory_entry(all, header, file_bytes));
    return pages;
  }

  /// The commit record, once it and the pages are what a reader takes.
  Block encode_checked(Superblock& superblock, std::span<const std::byte> directory,
                       const Meta& meta) const {
    Block block{};
    refuse_what_readers_refuse([&] {
      const std::vector<DirectoryEntry> pages = decode_directory(directory, superblock.file_bytes);
      superblock.content_xxh3 = content_digest(pages);
      block = encode_superblock(superblock);
      static_cast<void>(decode_superblock(block, header, superblock.file_bytes));
      const PageIndex index = index_pages(pages);
      verify_pages(superblock, pages, index);
      verify_attributes(superblock, pages, index, meta);
    });
    return block;
  }

  Superblock finish(const Meta& meta, Superblock superblock) {
    require(!finished, "finish() twice");
    wait();
    require(entries.complete(), "a reserved page that was never written");
    superblock.meta_page = write_meta(meta);
    finished = true;
    const std::vector<std::byte> directory = entries.encoded();
    end = round_up(end, kBlockBytes);
    complete(superblock, directory);
    const Block block = encode_checked(superblock, directory, meta);
    write_directory(directory);
    file.sync();  // what is committed reaches the disk before the commit record
    file.write_at(end, block);
    file.write_at(end + kBlockBytes, block);
    file.sync();
    file.publish();
    return superblock;
  }

  FileHeader header;
  Codec codec;
  int level;
  OutputFile file;
  EntryTable entries;               ///< pages are reserved while others are written
  std::uint64_t end = kBlockBytes;  ///< where the next page goes
  bool finished = false;
  std::vector<std::unique_ptr<Encoding>> encodings;
  Image single;               ///< these two kept between calls
  std::vector<Image> images;  ///< of write_pages()
  std::future<void> writing;  ///< of pages on their way; last, so that it is waited for first
};

ContainerWriter::ContainerWriter(const std::filesystem::path& target, const WriterOptions& options)
    : impl_(std::make_unique<Impl>(target, options)) {}

ContainerWriter::~ContainerWriter() = default;

ContainerWriter::ContainerWriter(const std::filesystem::path& target, const WriterOptions& options,
                                 const WriterState& state)
    : impl_(std::make_unique<Impl>(target, options, state)) {}

WriterState ContainerWriter::state() {
  impl_->wait();
  return {impl_->entries.size(), impl_->end};
}

void ContainerWriter::sync() {
  impl_->file.sync();
}

std::uint64_t ContainerWriter::writing_bytes(std::uint8_t page_shift, unsigned threads) noexcept {
  return threads * (kEncoderBytes + (std::uint64_t{2} << page_shift));
}

std::uint64_t ContainerWriter::finish_bytes(std::uint64_t pages) noexcept {
  return pages * kPageBytes;
}

std::uint64_t ContainerWriter::memory_bytes(std::uint64_t pages, std::uint8_t page_shift,
                                            unsigned threads) noexcept {
  return finish_bytes(pages) + writing_bytes(page_shift, threads);
}

const FileHeader& ContainerWriter::header() const noexcept {
  return impl_->header;
}

ContainerWriter::PageFacts ContainerWriter::facts_of(const PageHeader& page) noexcept {
  return {page.type, page.group, page.level, page.record_count, page.first_key, page.last_key};
}

std::uint32_t ContainerWriter::reserve_page() {
  return impl_->reserve();
}

void ContainerWriter::write_page(std::uint32_t page_id, const PageFacts& facts,
                                 std::span<const std::byte> payload,
                                 std::span<const PackedColumn> columns) {
  require(facts.type != PageType::directory && facts.type != PageType::meta,
          "directory and meta page are written by finish()");
  impl_->write_page(page_id, facts, payload, columns);
}

void ContainerWriter::write_pages(std::vector<Page> pages, const Executor& executor) {
  require(std::ranges::none_of(pages,
                               [](const Page& page) {
                                 return page.facts.type == PageType::directory ||
                                        page.facts.type == PageType::meta ||
                                        page.facts.type == PageType::attribute;
                               }),
          "write_pages() is for pages of points and nodes");
  impl_->write_pages(std::move(pages), executor);
}

void ContainerWriter::flush() {
  impl_->wait();
}

void ContainerWriter::write_stored_page(std::uint32_t page_id, const PageFacts& facts,
                                        Coding coding, std::uint32_t raw_bytes,
                                        std::span<const std::byte> stored) {
  require(facts.type != PageType::directory && facts.type != PageType::meta,
          "directory and meta page are written by finish()");
  require(!stored.empty() && stored.size() <= impl_->payload_limit(),
          "a stored payload that is empty or longer than a page");
  impl_->begin_page();
  Impl::Image& image = impl_->single;
  image.page = impl_->page_header(page_id, facts);
  image.page.coding = coding;
  image.page.raw_bytes = raw_bytes;
  impl_->make_image(image, stored);
  impl_->append_page(image);
}

const char* writer_name() noexcept {
  return "ptc " PTC_VERSION;
}

Superblock ContainerWriter::finish(const Meta& meta, Superblock superblock) {
  return impl_->finish(meta, std::move(superblock));
}

}  // namespace ptc
