// Pages, directory and commit record in the order that makes a torn file recognisable
// (spec/container.md#publishing):
//
//   header | pages ... | directory | coarse pages, meta page | sync | superblock A | B | sync |
//   rename
#include "engine/store/writer.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <utility>

#include "engine/base/background.h"
#include "engine/base/error.h"
#include "engine/store/commit.h"
#include "engine/store/structure.h"
#include "format/checksum.h"
#include "format/error.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr std::size_t kPagesAtOnce = 64;    // that write_pages() encodes before it writes them
constexpr std::uint64_t kFinishBytes = 96;  // memory that finish() takes for each page
// Most bytes of node pages in the tail. A first request of 256 KiB then gets the last 2,400 entries
// of the directory as well, and knows where the pages lie that it asks for next.
constexpr std::uint64_t kTailBytes = 150'000;

FileHeader make_header(const WriterOptions& options) {
  FileHeader header;
  header.uuid = options.uuid;
  header.page_shift = options.page_shift;
  header.frame = options.frame;
  header.point_bytes = options.point_bytes;
  if (options.parts) header.feature_incompat |= kPartsFeature;
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
      encoder_(header_, options.codec, options.level),
      source_(options.source) {
  if (!options.partial.empty()) file_.truncate(0);
  file_.write_at(0, encode_file_header(header_));
}

ContainerWriter::ContainerWriter(const std::filesystem::path& target, const WriterOptions& options,
                                 const WriterState& state)
    : header_(make_header(options)),
      file_(target, options.partial),
      entries_(directory_of(options.partial)),
      encoder_(header_, options.codec, options.level),
      source_(options.source),
      end_(state.end) {
  static_cast<void>(entries_.add(PageType::point, 0, state.point_pages));
  static_cast<void>(entries_.add(PageType::node, 0, state.node_pages));
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
  std::vector<std::byte> stored;
  std::uint64_t at = kBlockBytes;
  while (at < end_) {
    std::array<std::byte, kPageHeaderBytes> bytes;
    in.read_at(at, bytes);
    const PageHeader page = at_offset(in, at, [&] { return decode_page_header(bytes, header_); });
    stored.resize(page.stored_bytes);
    in.read_at(at + kPageHeaderBytes, stored);
    check(xxh3_64(stored) == page.payload_xxh3, "a page's checksum is wrong");
    check(entries_.awaits(page.type, page.group, page.rank), "a page that was not written");
    entries_.set(page.rank, entry_of(page, at));
    at += extent_bytes(page.stored_bytes);
  }
  check(at == end_, "the unfinished container's last page is cut");
}

std::uint32_t ContainerWriter::reserve_page(PageType type, std::uint8_t group) {
  require_of_writer(!finished_, "a page after finish()");
  return entries_.add(type, group, 1);
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
  return {entries_.size(PageType::point), entries_.size(PageType::node), end_};
}

void ContainerWriter::append(const PageImage& image) {
  file_.write_at(end_, image.bytes);
  end_ += image.bytes.size();
}

void ContainerWriter::append_page(const PageImage& image) {
  const PageHeader& page = image.page;
  const std::uint64_t offset = end_;
  require_of_writer(entries_.awaits(page.type, page.group, page.rank),
                    "a page that was not reserved, or a page written twice");
  append(image);
  entries_.set(page.rank, entry_of(page, offset));
}

void ContainerWriter::require_content(const PageSummary& summary) const {
  require_of_writer(summary.type != PageType::directory && summary.type != PageType::meta,
                    "directory and meta page are written by finish()");
}

void ContainerWriter::write_page(const PageSummary& summary, std::span<const std::byte> payload,
                                 std::span<const PackedColumn> columns) {
  require_content(summary);
  begin_page();
  encoder_.prepare(1);
  encoder_.encode(summary, payload, columns, 0, image_);
  append_page(image_);
}

void ContainerWriter::write_attributes(std::uint8_t group, std::span<const std::byte> payload,
                                       std::uint32_t count, std::span<const Channel> channels) {
  const PageSummary summary{.type = PageType::attribute,
                            .group = group,
                            .rank = reserve_page(PageType::attribute, group),
                            .record_count = count};
  if (is_void(channels, group, payload)) return write_void_page(summary);
  write_page(summary, payload, packed_group_columns(channels, group));
}

void ContainerWriter::write_void_page(const PageSummary& summary) {
  begin_page();
  require_of_writer(summary.type == PageType::attribute, "a void page that has no attributes");
  require_of_writer(entries_.awaits(summary.type, summary.group, summary.rank),
                    "a page that was not reserved, or a page written twice");
  entries_.set(
      summary.rank,
      {.record_count = summary.record_count, .type = summary.type, .group = summary.group});
}

void ContainerWriter::write_pages(std::vector<Page> pages, const Executor& executor) {
  require_of_writer(std::ranges::all_of(pages, has_points_or_nodes, &Page::summary),
                    "write_pages() is for pages of points and nodes");
  begin_page();
  images_.resize(std::max(images_.size(), std::min(pages.size(), kPagesAtOnce)));
  encoder_.prepare(executor.threads());
  auto write = [this, pages = std::move(pages), &executor] {
    for (std::size_t at = 0; at < pages.size(); at += kPagesAtOnce) {
      const auto some = std::span(pages).subspan(at, std::min(kPagesAtOnce, pages.size() - at));
      executor.for_each(some.size(), [&](std::size_t i, unsigned thread) {
        encoder_.encode(some[i].summary, some[i].payload, {}, thread, images_[i]);
      });
      for (const PageImage& image : std::span(images_).first(some.size())) append_page(image);
    }
  };
  if (executor.threads() == 1) return write();
  writing_ = in_background(std::move(write));
}

void ContainerWriter::write_stored_page(const PageSummary& summary, Coding coding,
                                        std::uint32_t raw_bytes,
                                        std::span<const std::byte> stored) {
  require_content(summary);
  begin_page();
  encoder_.take(summary, coding, raw_bytes, stored, image_);
  append_page(image_);
}

// Makes room for the next page of the tail.
PageImage& ContainerWriter::kept_page(const PageSummary& summary) {
  require_content(summary);
  require_of_writer(summary.type != PageType::point && summary.type != PageType::attribute,
                    "a page of the tail that has points or attributes");
  require_of_writer(entries_.awaits(summary.type, summary.group, summary.rank),
                    "a page that was not reserved, or a page written twice");
  require_of_writer(tail_.size() + 1 < kMaxTailPages, "more pages than the tail has");
  begin_page();
  return tail_.emplace_back();
}

void ContainerWriter::keep_page(const PageSummary& summary, std::span<const std::byte> payload) {
  PageImage& image = kept_page(summary);
  encoder_.prepare(1);
  encoder_.encode(summary, payload, {}, 0, image);
}

void ContainerWriter::keep_stored_page(const PageSummary& summary, Coding coding,
                                       std::uint32_t raw_bytes, std::span<const std::byte> stored) {
  encoder_.take(summary, coding, raw_bytes, stored, kept_page(summary));
}

// Writes the first node pages that were kept, until the tail has no more than kTailBytes of them.
void ContainerWriter::shorten_tail() {
  const auto is_node = [](const PageImage& image) { return image.page.type == PageType::node; };
  std::uint64_t bytes = 0;
  for (const PageImage& image : tail_) bytes += is_node(image) ? image.bytes.size() : 0;
  auto first = tail_.begin();
  for (; bytes > kTailBytes && is_node(*first); ++first) {
    append_page(*first);
    bytes -= first->bytes.size();
  }
  tail_.erase(tail_.begin(), first);
}

// Gives the pages of the tail their places, one after another from an offset on.
void ContainerWriter::place_tail(std::uint64_t offset) {
  for (const PageImage& image : tail_) {
    entries_.set(image.page.rank, entry_of(image.page, offset));
    offset += image.bytes.size();
  }
}

// Directory pages are not compressed: each can be recognised and read without the others.
void ContainerWriter::write_directory(std::span<const std::byte> directory) {
  const std::size_t full = directory_entries_per_page(header_) * kDirectoryEntryBytes;
  PageSummary summary{.type = PageType::directory};
  for (std::size_t at = 0; at < directory.size(); at += full, ++summary.rank) {
    const auto part = directory.subspan(at, std::min(full, directory.size() - at));
    summary.record_count = static_cast<std::uint32_t>(part.size() / kDirectoryEntryBytes);
    encoder_.take(summary, {}, static_cast<std::uint32_t>(part.size()), part, image_);
    append(image_);
  }
  end_ = round_up(end_, kBlockBytes);
}

// Fills in what the writer knows before the directory is made: identity, counts and places.
void ContainerWriter::complete(Superblock& superblock, const Meta& meta) const {
  const std::uint32_t pages = entries_.size();
  superblock.header = header_;
  superblock.page_count = pages;
  superblock.point_pages = entries_.size(PageType::point);
  superblock.node_pages = entries_.size(PageType::node);
  superblock.attribute_groups = static_cast<std::uint16_t>(channel_groups(meta.channels).size());
  superblock.directory_pages = (pages - 1) / directory_entries_per_page(header_) + 1;
  superblock.directory_offset = end_;
  superblock.tail_offset = end_ + directory_bytes(header_, pages);
  std::uint64_t end = superblock.tail_offset;
  for (const PageImage& image : tail_) end += image.bytes.size();
  superblock.file_bytes = round_up(end, kBlockBytes) + 2 * kBlockBytes;
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
    superblock.directory_xxh3 = xxh3_64(directory);
    superblock.content_xxh3 = content_digest(pages);
    superblock.tail.assign(pages.end() - static_cast<std::ptrdiff_t>(tail_.size()), pages.end());
    block = encode_superblock(superblock);
    static_cast<void>(decode_superblock(block, header_, superblock.file_bytes));
    verify_pages(superblock, pages);
    verify_attributes(superblock, pages, meta);
  });
  return block;
}

Superblock ContainerWriter::finish(const Meta& meta, Superblock superblock) {
  // Encode the meta page, the last page of the tail
  require_of_writer(!finished_, "finish() twice");
  flush();
  const PageSummary summary{
      .type = PageType::meta, .rank = reserve_page(PageType::meta), .record_count = 1};
  encoder_.prepare(1);
  encoder_.encode(summary, encode_meta(meta, header_.point_bytes), {}, 0, tail_.emplace_back());
  finished_ = true;

  // Place the directory and the tail, and check what is about to be committed as a reader would
  shorten_tail();
  end_ = round_up(end_, kBlockBytes);
  complete(superblock, meta);
  place_tail(superblock.tail_offset);
  require_of_writer(entries_.complete(), "a reserved page that was never written");
  const std::vector<std::byte> directory = entries_.encoded();
  const Block block = commit_record(superblock, directory, meta);

  // Write them; all else reaches the disk before the superblocks that commit it
  write_directory(directory);
  for (const PageImage& image : tail_) append(image);
  end_ = round_up(end_, kBlockBytes);
  file_.sync();
  file_.write_at(end_, block);
  file_.write_at(end_ + kBlockBytes, block);
  file_.sync();
  file_.publish(source_);
  return superblock;
}

}  // namespace ptc
