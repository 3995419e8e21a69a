// Pages, directory and commit record in the order that makes a torn file recognisable
// (spec/container.md#publishing):
//
//   header | pages ... meta page | directory pages | sync | superblock A | B | sync | rename
#include "engine/store/writer.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <utility>

#include "engine/base/error.h"
#include "engine/store/commit.h"
#include "engine/store/structure.h"
#include "format/checksum.h"
#include "format/error.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr std::uint16_t kNoLevel = 0xffff;
constexpr std::uint64_t kFinishBytes = 80;  // memory that finish() takes for each page

// Runs a reader's check on what is about to be written: what fails it is the caller's mistake.
template <class Check>
void refuse_what_readers_refuse(Check&& check) {
  try {
    check();
  } catch (const FormatError& error) {
    require_of_writer(false, error.what());
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

OutputFile open_output(const std::filesystem::path& target, const std::filesystem::path& partial) {
  return partial.empty() ? OutputFile(target) : OutputFile(target, partial);
}

bool has_points_or_nodes(const PageSummary& summary) {
  return summary.type == PageType::point || summary.type == PageType::node;
}

}  // namespace

const char* writer_name() noexcept {
  return "ptc " PTC_VERSION;
}

std::uint64_t ContainerWriter::writing_bytes(std::uint8_t page_shift, unsigned threads) noexcept {
  return threads * (PageImages::kEncoderBytes + (std::uint64_t{2} << page_shift));
}

std::uint64_t ContainerWriter::finish_bytes(std::uint64_t pages) noexcept {
  return pages * kFinishBytes;
}

std::uint64_t ContainerWriter::memory_bytes(std::uint64_t pages, std::uint8_t page_shift,
                                            unsigned threads) noexcept {
  return finish_bytes(pages) + writing_bytes(page_shift, threads);
}

ContainerWriter::ContainerWriter(const std::filesystem::path& target, const WriterOptions& options)
    : header_(make_header(options)),
      file_(open_output(target, options.partial)),
      entries_(directory_of(file_.temporary())),
      encoder_(header_, options.codec, options.level) {
  if (!options.partial.empty()) file_.truncate(0);
  file_.write_at(0, encode_file_header(header_));
}

ContainerWriter::ContainerWriter(const std::filesystem::path& target, const WriterOptions& options,
                                 const WriterState& state)
    : header_(make_header(options)),
      file_(target, options.partial),
      entries_(directory_of(options.partial)),
      encoder_(header_, options.codec, options.level),
      end_(state.end) {
  static_cast<void>(entries_.add(state.pages));
  find_pages(options.partial);
  file_.truncate(end_);
}

// Fills the directory of a partial file from the headers of its pages.
void ContainerWriter::find_pages(const std::filesystem::path& partial) {
  const InputFile in(partial);
  const auto check = [&](bool holds, const char* text) {
    if (!holds) throw DataError(partial.string() + ": " + text);
  };
  check(in.size() >= end_ && end_ >= kBlockBytes,
        "the unfinished container is shorter than it was");
  Block block;
  in.read_at(0, block);
  check(block == encode_file_header(header_), "it is no unfinished container of this scene");
  std::uint64_t at = kBlockBytes;
  while (at < end_) {
    std::array<std::byte, kPageHeaderBytes> bytes;
    in.read_at(at, bytes);
    const PageHeader page = at_offset(in, at, [&] { return decode_page_header(bytes, header_); });
    check(page.page_id < entries_.size() && !entries_.has(page.page_id),
          "a page that was not written");
    entries_.set(page.page_id, entry_of(page, at));
    at += extent_bytes(page.stored_bytes);
  }
  check(at == end_, "the unfinished container's last page is cut");
}

std::uint32_t ContainerWriter::reserve_page() {
  require_of_writer(!finished_, "a page after finish()");
  if (entries_.size() >= kMaxPages) {
    throw DataError(file_.target().string() + ": needs more than 2^32 - 2 pages");
  }
  return entries_.add(1);
}

void ContainerWriter::begin_page() {
  require_of_writer(!finished_, "a page after finish()");
  flush();
}

void ContainerWriter::flush() {
  if (writing_.valid()) writing_.get();
}

WriterState ContainerWriter::state() {
  flush();
  return {entries_.size(), end_};
}

void ContainerWriter::append(const PageImage& image) {
  file_.write_at(end_, image.bytes);
  end_ += image.bytes.size();
}

void ContainerWriter::append_page(const PageImage& image) {
  const PageHeader& page = image.page;
  const std::uint64_t offset = end_;
  require_of_writer(page.page_id < entries_.size(), "a page that was not reserved");
  require_of_writer(!entries_.has(page.page_id), "a page written twice");
  append(image);
  entries_.set(page.page_id, entry_of(page, offset));
}

void ContainerWriter::write_content_page(std::uint32_t page, const PageSummary& summary,
                                         std::span<const std::byte> payload,
                                         std::span<const PackedColumn> columns) {
  begin_page();
  encoder_.prepare(1);
  encoder_.encode(page, summary, payload, columns, 0, image_);
  append_page(image_);
}

void ContainerWriter::write_page(std::uint32_t page, const PageSummary& summary,
                                 std::span<const std::byte> payload,
                                 std::span<const PackedColumn> columns) {
  require_of_writer(summary.type != PageType::directory && summary.type != PageType::meta,
                    "directory and meta page are written by finish()");
  write_content_page(page, summary, payload, columns);
}

void ContainerWriter::write_pages(std::vector<Page> pages, const Executor& executor) {
  require_of_writer(std::ranges::all_of(pages, has_points_or_nodes, &Page::summary),
                    "write_pages() is for pages of points and nodes");
  begin_page();
  if (images_.size() < pages.size()) images_.resize(pages.size());
  encoder_.prepare(executor.threads());
  const auto write = [this, pages = std::move(pages), &executor] {
    executor.for_each(pages.size(), [&](std::size_t i, unsigned thread) {
      encoder_.encode(pages[i].id, pages[i].summary, pages[i].payload, {}, thread, images_[i]);
    });
    for (const PageImage& image : std::span(images_).first(pages.size())) append_page(image);
  };
  if (executor.threads() == 1) return write();
  writing_ = std::async(std::launch::async, write);
}

void ContainerWriter::write_stored_page(std::uint32_t page, const PageSummary& summary,
                                        Coding coding, std::uint32_t raw_bytes,
                                        std::span<const std::byte> stored) {
  require_of_writer(summary.type != PageType::directory && summary.type != PageType::meta,
                    "directory and meta page are written by finish()");
  begin_page();
  encoder_.take(page, summary, coding, raw_bytes, stored, image_);
  append_page(image_);
}

// Directory pages are numbered on from the last page and not compressed: each can be recognised and
// read without the others.
void ContainerWriter::write_directory(std::span<const std::byte> directory) {
  const std::size_t full = directory_entries_per_page(header_) * kDirectoryEntryBytes;
  std::uint32_t page = entries_.size();
  for (std::size_t at = 0; at < directory.size(); at += full, ++page) {
    const auto part = directory.subspan(at, std::min(full, directory.size() - at));
    const auto bytes = static_cast<std::uint32_t>(part.size());
    const auto count = static_cast<std::uint32_t>(part.size() / kDirectoryEntryBytes);
    encoder_.take(page, {PageType::directory, 0, kNoLevel, count, 0, 0}, {}, bytes, part, image_);
    append(image_);
  }
  end_ = round_up(end_, kBlockBytes);
}

// Fills in what the writer knows: identity, directory, length.
void ContainerWriter::complete(Superblock& superblock, std::span<const std::byte> directory) const {
  const std::uint32_t pages = entries_.size();
  superblock.header = header_;
  superblock.page_count = pages;
  superblock.directory_pages = (pages - 1) / directory_entries_per_page(header_) + 1;
  superblock.directory_offset = end_;
  superblock.directory_xxh3 = xxh3_64(directory);
  superblock.file_bytes = end_ + directory_bytes(header_, pages) + 2 * kBlockBytes;
  superblock.points_per_page = points_per_page(header_);
  if (superblock.writer.empty()) superblock.writer = writer_name();
}

std::vector<DirectoryEntry> ContainerWriter::decode_directory(std::span<const std::byte> directory,
                                                              std::uint64_t file_bytes) const {
  std::vector<DirectoryEntry> pages;
  pages.reserve(entries_.size());
  for (; !directory.empty(); directory = directory.subspan(kDirectoryEntryBytes))
    pages.push_back(decode_directory_entry(directory, header_, file_bytes));
  return pages;
}

// The block that commits the file, once a reader's checks have passed it and the pages.
Block ContainerWriter::commit_record(Superblock& superblock, std::span<const std::byte> directory,
                                     const Meta& meta) const {
  Block block{};
  refuse_what_readers_refuse([&] {
    const std::vector<DirectoryEntry> pages = decode_directory(directory, superblock.file_bytes);
    superblock.content_xxh3 = content_digest(pages);
    block = encode_superblock(superblock);
    static_cast<void>(decode_superblock(block, header_, superblock.file_bytes));
    const PageIndex index = index_pages(pages);
    verify_pages(superblock, pages, index);
    verify_attributes(superblock, pages, index, meta);
  });
  return block;
}

Superblock ContainerWriter::finish(const Meta& meta, Superblock superblock) {
  // Write the meta page
  require_of_writer(!finished_, "finish() twice");
  flush();
  require_of_writer(entries_.complete(), "a reserved page that was never written");
  superblock.meta_page = reserve_page();
  write_content_page(superblock.meta_page, {PageType::meta, 0, kNoLevel, 1, 0, 0},
                     encode_meta(meta), {});
  finished_ = true;

  // Check what is about to be committed as a reader would
  const std::vector<std::byte> directory = entries_.encoded();
  end_ = round_up(end_, kBlockBytes);
  complete(superblock, directory);
  const Block block = commit_record(superblock, directory, meta);

  // Write the directory; it reaches the disk before the superblocks that commit it
  write_directory(directory);
  file_.sync();
  file_.write_at(end_, block);
  file_.write_at(end_ + kBlockBytes, block);
  file_.sync();
  file_.publish();
  return superblock;
}

}  // namespace ptc
