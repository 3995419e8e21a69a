// Writes a container page by page (spec/container.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <future>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/io/file/file.h"
#include "engine/store/entry_table.h"
#include "engine/store/page_images.h"
#include "format/codec.h"
#include "format/container.h"
#include "format/schema.h"

namespace ptc {

/// What a container is made of, and what it is called until it is published.
struct WriterOptions {
  std::uint8_t page_shift = 16;  ///< the page size is 2^page_shift bytes; 12 to 20
  Codec codec = Codec::zstd;
  int level = 1;  ///< compression level of zstd, clamped to its range
  Uuid uuid{};    ///< identity of the file, which salts the checksums of its page headers
  Frame frame;    ///< the cube of space that the points' lattice fills
  std::uint8_t point_bytes = kPointBytes;  ///< kEmittingPointBytes when points may emit light
  bool parts = false;                      ///< the container is a scene of parts (spec/parts.md)
  /// The name of the file until it is published. The file stays under that name when the writer
  /// ends without finish(). Empty: a temporary name, and nothing stays.
  std::filesystem::path partial;
  /// The container that the new one is made from, or null; it must outlive the writer. When it has
  /// the name of the target, finish() must find it there: a file that another program has put in
  /// its place is not lost.
  const InputFile* source = nullptr;
};

/// How far a writer got.
struct WriterState {
  std::uint32_t point_pages = 0;    ///< point pages that were reserved
  std::uint32_t node_pages = 0;     ///< node pages that were reserved
  std::uint64_t end = kBlockBytes;  ///< end of the written pages, bytes from the start of the file
};

/// The program and its version, which superblocks record unless another writer is named.
[[nodiscard]] const char* writer_name() noexcept;

/// A container on its way to the disk.
///
/// reserve_page() gives out ranks, so that a parent can refer to a page that is written later.
/// Pages may be written in any order; they lie in the file in the order of the calls. Those that
/// keep_page() takes wait for finish(), which puts them into the tail (spec/container.md#tail).
///
/// The target stays what it was until finish() returns. A writer that ends before that leaves
/// nothing behind, unless WriterOptions::partial names the file. A page that a reader would refuse
/// is a std::invalid_argument, and the writer is then of no further use. Every call may throw
/// std::system_error.
/// Threads: one at a time.   Memory: memory_bytes().
class ContainerWriter {
 public:
  /// The most memory that a writer holds while pages are written, the pages themselves not counted:
  /// an encoder for each thread of write_pages().
  [[nodiscard]] static std::uint64_t writing_bytes(std::uint8_t page_shift,
                                                   unsigned threads) noexcept;
  /// The memory that finish() takes: the directory, encoded and decoded, and its order. Until then
  /// the directory is on the disk.
  [[nodiscard]] static std::uint64_t finish_bytes(std::uint64_t pages) noexcept;
  /// writing_bytes() plus finish_bytes().
  [[nodiscard]] static std::uint64_t memory_bytes(std::uint64_t pages, std::uint8_t page_shift,
                                                  unsigned threads) noexcept;

  /// Begins a container.
  /// @throws std::invalid_argument when page_shift is not 12 to 20 or the frame breaks a rule of
  ///         spec/morton.md#frame
  ContainerWriter(const std::filesystem::path& target, const WriterOptions& options);
  /// Continues the partial file of a writer with the same options. What lies behind the state is
  /// cut off.
  /// @param state  what state() of that writer returned
  /// @throws DataError when the file does not hold these pages
  ContainerWriter(const std::filesystem::path& target, const WriterOptions& options,
                  const WriterState& state);
  ContainerWriter(const ContainerWriter&) = delete;
  ContainerWriter& operator=(const ContainerWriter&) = delete;

  [[nodiscard]] const FileHeader& header() const noexcept { return header_; }
  /// Gives out the next rank of a type and group; the first is 0.
  /// @throws RequestError that names `page_shift` after kMaxPages pages
  [[nodiscard]] std::uint32_t reserve_page(PageType type, std::uint8_t group = 0);

  /// Compresses, checksums and writes a page. Each reserved page must be written exactly once.
  /// @param summary  its rank was reserved
  /// @param payload  1 to page size - 64 bytes
  /// @param columns  of an attribute page, from packed_group_columns(), to pack it; empty: it is
  ///                 not packed
  void write_page(const PageSummary& summary, std::span<const std::byte> payload,
                  std::span<const PackedColumn> columns = {});
  /// Writes the next attribute page of a group, or notes it as void when none of its values is
  /// known.
  /// @param payload   the columns of the group's channels, `count` values each
  /// @param channels  of the file
  void write_attributes(std::uint8_t group, std::span<const std::byte> payload, std::uint32_t count,
                        std::span<const Channel> channels);
  /// Notes a void attribute page, which takes no room but its entry.
  void write_void_page(const PageSummary& summary);

  /// A page that is not compressed yet.
  struct Page {
    PageSummary summary;
    std::vector<std::byte> payload;
  };
  /// Compresses pages of points and nodes in parallel and writes them in the order given here. With
  /// more than one thread this returns before they are written, and a later call throws what goes
  /// wrong.
  /// @param executor  must outlive the next call of flush(), state() or finish()
  /// Memory: the pages and their stored bytes.
  void write_pages(std::vector<Page> pages, const Executor& executor);

  /// Writes a page whose payload is already in its stored form, such as one of another container.
  /// @param raw_bytes  size of the decoded payload
  void write_stored_page(const PageSummary& summary, Coding coding, std::uint32_t raw_bytes,
                         std::span<const std::byte> stored);

  /// Keeps a page for the tail. Pages are kept in the order of the directory, after all others of
  /// their type, at most kMaxTailPages - 1 of them. The first node pages of these are written
  /// before the directory when there are more than 150 KB of them.
  /// @param summary  of a node page, whose rank was reserved, or of a page of another type that
  ///                 stands behind them
  void keep_page(const PageSummary& summary, std::span<const std::byte> payload);
  /// Keeps a page for the tail whose payload is already in its stored form.
  void keep_stored_page(const PageSummary& summary, Coding coding, std::uint32_t raw_bytes,
                        std::span<const std::byte> stored);

  /// Waits until all pages are in the file.
  /// @throws what went wrong while write_pages() was under way
  void flush();
  /// Waits until all pages are in the file and returns how far the writer got.
  [[nodiscard]] WriterState state();
  /// Flushes everything that is in the file to stable storage. Threads: safe beside one thread that
  /// writes.
  void sync() { file_.sync(); }

  /// Writes the meta page, the directory and the superblocks, flushes them to stable storage and
  /// publishes the file under the target's name.
  /// @param superblock  has counts, bounds, totals and root; everything else is filled in, and the
  ///                    writer's name where it is empty
  /// @return            the superblock as it was written
  Superblock finish(const Meta& meta, Superblock superblock);

 private:
  void find_pages(const std::filesystem::path& partial);
  void begin_page();
  void require_content(const PageSummary& summary) const;
  void append(const PageImage& image);
  void append_page(const PageImage& image);
  PageImage& kept_page(const PageSummary& summary);
  void shorten_tail();
  void place_tail(std::uint64_t offset);
  void write_directory(std::span<const std::byte> directory);
  void complete(Superblock& superblock, const Meta& meta) const;
  [[nodiscard]] std::vector<DirectoryEntry> decode_directory(std::span<const std::byte> directory,
                                                             std::uint64_t file_bytes) const;
  [[nodiscard]] Block commit_record(Superblock& superblock, std::span<const std::byte> directory,
                                    const Meta& meta) const;

  FileHeader header_;
  OutputFile file_;
  EntryTable entries_;  ///< guards itself: pages are reserved while others are written
  PageImages encoder_;
  const InputFile* source_;          ///< WriterOptions::source
  std::uint64_t end_ = kBlockBytes;  ///< where the next page goes
  bool finished_ = false;
  PageImage image_;                ///< of write_page(), kept between calls
  std::vector<PageImage> images_;  ///< of write_pages(), kept between calls
  std::vector<PageImage> tail_;    ///< pages that finish() writes
  std::future<void> writing_;      ///< write_pages() under way; last, so that its end is awaited
                                   ///< before the other members go
};

}  // namespace ptc
