// Pages in memory under a hard cap: a shared level and a per-thread level in front of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "engine/cache/page_source.h"
#include "engine/cache/replacement.h"
#include "engine/store/reader.h"

namespace ptc {

struct CacheOptions {
  std::uint64_t memory_bytes = std::uint64_t{512} << 20;  ///< frames and tables together
  unsigned threads = 1;                                   ///< how many readers will exist at once
  BackEnd back_end = BackEnd::pread;
  Replacement replacement = Replacement::clock;
  bool read_ahead = true;  ///< io_uring alone: the page after one that was missed is expected
  /// Pages that a reader holds on to, a power of two up to 256; 0: as many as the frames allow.
  std::uint32_t local_slots = 0;
};

struct CacheStatistics {
  std::uint64_t lookups = 0;      ///< PageReader::get calls: the sum of the next three
  std::uint64_t local_hits = 0;   ///< answered by the thread's own level
  std::uint64_t shared_hits = 0;  ///< found in a frame, or joined another thread's read
  std::uint64_t misses = 0;       ///< pages read, failed reads included
  std::uint64_t evictions = 0;
  std::uint64_t bytes_read = 0;   ///< stored bytes of pages that arrived, headers included
  std::uint64_t frames = 0;       ///< frames there are: what the cap allows and the file can use
  std::uint64_t peak_frames = 0;  ///< most that were in use at once
  double wait_seconds =
      0;  ///< for bytes from the back end or for another thread's read, all readers together
  [[nodiscard]] double hit_rate() const noexcept;  ///< 1 - misses / lookups; 1 without lookups
};

/// The shared level. A page that is there is found without a lock (engine/cache/frame_table.h). One
/// that is not is read once even when several threads ask for it at the same time (single flight);
/// reading and verifying happen outside the lock. Of the pages that no reader holds, one that was
/// not asked for of late leaves first.
///
/// A page that cannot be read fails for all who wait for it; who asks later tries again.
/// Memory: frames of one page size each in one block, 4 bytes a page of the container, and for each
/// reader its table, its decoder and its back end's buffers; all of it within the cap. The
/// container's own directory is not counted. Threads: a PageCache may be shared; each thread makes
/// its own PageReader.
class PageCache {
 public:
  /// @param container  outlives the cache
  /// @throws std::invalid_argument naming the least cap that works, when the cap is below it, or
  /// when there are no threads or local_slots is not a power of two that the frames allow
  PageCache(const ContainerReader& container, const CacheOptions& options);
  ~PageCache();
  PageCache(const PageCache&) = delete;
  PageCache& operator=(const PageCache&) = delete;

  /// Least cap for so many threads: two frames each, and the tables.
  [[nodiscard]] static std::uint64_t min_bytes(const ContainerReader& container, unsigned threads,
                                               BackEnd back_end = BackEnd::pread);
  /// Least cap that gives so many frames.
  [[nodiscard]] static std::uint64_t bytes_for(const ContainerReader& container, unsigned threads,
                                               std::uint64_t frames,
                                               BackEnd back_end = BackEnd::pread);
  [[nodiscard]] const ContainerReader& container() const noexcept;
  /// Sums over the shared level and all readers that have ended. Of a living reader, hits since its
  /// last miss are missing.
  [[nodiscard]] CacheStatistics statistics() const;
  /// Pages that each reader holds on to.
  [[nodiscard]] std::uint32_t local_slots() const noexcept;

 private:
  friend class PageReader;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A thread's way to pages: a direct-mapped table of pages that it holds, so a repeated access
/// takes no lock and writes nothing shared. Not thread-safe: one per thread.
class PageReader {
 public:
  /// @param cache  outlives the reader
  /// @throws std::invalid_argument when as many readers as CacheOptions::threads exist already;
  /// std::system_error
  ///         when the system does not have the back end
  explicit PageReader(PageCache& cache);
  ~PageReader();
  PageReader(const PageReader&) = delete;
  PageReader& operator=(const PageReader&) = delete;

  /// A resident page. `payload` stays valid until the next get() of this reader, aligned to 64.
  /// Bytes up to 64 past the payload may be read (they are zero or stale, never unmapped).
  struct Page {
    const std::byte* payload = nullptr;
    std::uint32_t bytes = 0;
    std::uint32_t record_count = 0;
  };
  /// @param page  below the container's page count
  /// @throws FormatError, DataError, std::system_error when the page cannot be read, the same for
  /// all who wait for it; std::invalid_argument when there is no such page. The reader stays
  /// usable.
  [[nodiscard]] Page get(std::uint32_t page) {
    const Slot& slot = table_[page & mask_];
    ++lookups_;
    if (slot.page == page) return slot.view;
    return find(page);
  }

 private:
  static constexpr std::uint64_t kEmpty =
      ~std::uint64_t{0};  // equal to no page number, kNoPage included
  struct Slot {
    std::uint64_t page = kEmpty;
    Page view;
  };
  Page find(std::uint32_t page);

  PageCache::Impl& shared_;
  std::uint32_t number_;  ///< among the readers
  std::unique_ptr<Slot[]> table_;
  std::uint32_t mask_;
  std::uint64_t lookups_ = 0;      ///< since the shared level was last told
  std::uint64_t shared_hits_ = 0;  ///< likewise
  std::unique_ptr<PageSource> source_;
  PageDecoder decoder_;
};

}  // namespace ptc
