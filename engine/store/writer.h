// Writes a container page by page (spec/container.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "format/codec.h"
#include "format/container.h"
#include "format/schema.h"

namespace ptc {

struct WriterOptions {
  std::uint8_t page_shift = 16;
  Codec codec = Codec::zstd;
  int level = 1;  ///< of zstd, clamped to its range
  Uuid uuid{};
  Frame frame;
  /// Name of the file until it is published, under which it stays when it is not; empty: a
  /// temporary one.
  std::filesystem::path partial;
};

/// How far a writer got.
struct WriterState {
  std::uint32_t pages = 0;          ///< reserved
  std::uint64_t end = kBlockBytes;  ///< of those written
};

/// What superblocks say of who wrote them, unless they are told otherwise: program and version.
[[nodiscard]] const char* writer_name() noexcept;

/// A container on its way to the disk. Page numbers are given out by reserve_page(), so that a
/// parent can refer to a page that is written later; pages are written in any order, and lie in the
/// file in the order of the calls.
///
/// Until finish() has returned, the target is what it was before; a writer that ends before leaves
/// nothing behind. What a reader would refuse is not written but thrown as std::invalid_argument,
/// after which the writer is of no more use. Every call may throw std::system_error.
/// Memory: memory_bytes().   Threads: one at a time.
class ContainerWriter {
 public:
  /// Most that a writer holds while pages are written, beside those that it is given: an encoder
  /// for each thread of write_pages().
  [[nodiscard]] static std::uint64_t writing_bytes(std::uint8_t page_shift,
                                                   unsigned threads) noexcept;
  /// What finish() of so many pages takes: the directory, encoded and not, and its order. Until
  /// then it is on the disk.
  [[nodiscard]] static std::uint64_t finish_bytes(std::uint64_t pages) noexcept;
  /// Both.
  [[nodiscard]] static std::uint64_t memory_bytes(std::uint64_t pages, std::uint8_t page_shift,
                                                  unsigned threads) noexcept;

  /// @throws std::invalid_argument when page_shift is not 12 to 20 or the frame breaks a rule of
  /// spec/morton.md#frame
  ContainerWriter(const std::filesystem::path& target, const WriterOptions& options);
  /// Goes on with the partial file of a writer with the same options, whose state() this was; what
  /// lies behind is cut.
  /// @throws DataError when the file does not hold these pages
  ContainerWriter(const std::filesystem::path& target, const WriterOptions& options,
                  const WriterState& state);
  ~ContainerWriter();

  [[nodiscard]] const FileHeader& header() const noexcept;
  /// The next page number, from 0 on. @throws DataError after 2^32 - 2 pages
  [[nodiscard]] std::uint32_t reserve_page();

  /// What a page header says beyond sizes and hashes.
  struct PageFacts {
    PageType type = PageType::point;
    std::uint16_t group = 0;
    std::uint16_t level = 0xffff;
    std::uint32_t record_count = 0;
    std::uint64_t first_key = 0;
    std::uint64_t last_key = 0;
  };
  /// Those of a page that is there.
  [[nodiscard]] static PageFacts facts_of(const PageHeader& page) noexcept;
  /// Compresses, checksums and writes the page. Each reserved page must be written once.
  /// @param payload  1 to page size - 64 bytes
  /// @param columns  of an attribute page, from packed_group_columns(); without them it is not
  /// packed
  void write_page(std::uint32_t page_id, const PageFacts& facts, std::span<const std::byte> payload,
                  std::span<const PackedColumn> columns = {});
  /// A page that is not compressed yet.
  struct Page {
    std::uint32_t id = 0;
    PageFacts facts;
    std::vector<std::byte> payload;
  };
  /// The same of several, compressed side by side; they lie in the file in their order here. Not of
  /// attribute pages. With more than one thread they are on their way when this returns, and what
  /// goes wrong is thrown by a later call.
  /// @param executor  must outlive the next call of flush() or finish()
  /// Memory: the pages and their stored bytes.
  void write_pages(std::vector<Page> pages, const Executor& executor);
  /// Returns when all pages are in the file. @throws what went wrong with them
  void flush();
  /// State once all pages are in the file.
  [[nodiscard]] WriterState state();
  /// What is in the file is on the disk when it returns. Threads: while another thread writes, too.
  void sync();
  /// Writes a page whose payload is already in its stored form (copied from another container).
  void write_stored_page(std::uint32_t page_id, const PageFacts& facts, Coding coding,
                         std::uint32_t raw_bytes, std::span<const std::byte> stored);

  /// Meta page, directory, superblocks; syncs and publishes under the target's name.
  /// @param superblock  counts, bounds, totals and root; the rest is filled in here, the
  /// writer's name when it is empty
  /// @return  the superblock as it was written
  Superblock finish(const Meta& meta, Superblock superblock);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ptc
