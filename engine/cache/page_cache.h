// Pages in memory under a hard cap: a shared level and a per-thread level in front of it.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "engine/base/memory.h"
#include "engine/cache/frame_table.h"
#include "engine/cache/page_source.h"
#include "engine/cache/replacement.h"
#include "engine/store/reader.h"

namespace ptc {

/// What a page cache may use, and how it reads.
struct CacheOptions {
  std::uint64_t memory_bytes = std::uint64_t{512} << 20;  ///< frames and tables together
  unsigned threads = 1;                                   ///< readers that exist at once, at most
  BackEnd back_end = BackEnd::pread;
  Replacement replacement = Replacement::clock;
  bool read_ahead = true;  ///< with io_uring: a miss also reads the next page of the same kind
  /// Pages that each reader keeps resident for itself, a power of two up to 256; 0: as many as the
  /// frames allow.
  std::uint32_t local_slots = 0;
};

/// What a page cache did since it was made.
struct CacheStatistics {
  std::uint64_t lookups = 0;      ///< calls of PageReader::pin(): the sum of the next three
  std::uint64_t local_hits = 0;   ///< found in the reader's own table
  std::uint64_t shared_hits = 0;  ///< found in a frame, or in a read of another thread
  std::uint64_t misses = 0;       ///< pages read, failed reads included
  std::uint64_t evictions = 0;
  std::uint64_t bytes_read = 0;   ///< stored bytes of pages that were read, headers included
  std::uint64_t frames = 0;       ///< frames of the cache: what the cap allows and the file can use
  std::uint64_t peak_frames = 0;  ///< the most frames that were in use at once
  /// The time that all readers together waited for the back end or for another thread's read.
  double wait_seconds = 0;
  /// 1 - misses / lookups; 1 without lookups.
  [[nodiscard]] double hit_rate() const noexcept;
};

/// The level of the cache that all threads share.
///
/// A resident page is found without a lock (engine/cache/frame_table.h). A missing page is read
/// once, even when several threads ask for it at the same time (single flight); reading and
/// verifying happen outside the lock. Among unpinned pages, one that was not used recently is
/// evicted first.
///
/// A page that cannot be read fails for all callers that wait for it; a later call tries again.
/// Threads: a cache may be shared; each thread makes its own PageReader.
/// Memory: within the cap, one block of frames of one page each, 4 bytes for each page of the
/// container, and for each reader its table, its decoder and the buffers of its back end. The
/// container's own directory is not included.
class PageCache {
 public:
  /// @param container  must outlive the cache
  /// @throws std::invalid_argument when the cap is too small (the text names the least that works),
  ///         when `threads` is 0, or when `local_slots` is not a power of two that the frames allow
  PageCache(const ContainerReader& container, const CacheOptions& options);
  PageCache(const PageCache&) = delete;
  PageCache& operator=(const PageCache&) = delete;

  /// The least cap for a number of threads: two frames each, and the tables.
  [[nodiscard]] static std::uint64_t min_bytes(const ContainerReader& container, unsigned threads,
                                               BackEnd back_end = BackEnd::pread);
  /// The least cap that gives a number of frames.
  [[nodiscard]] static std::uint64_t bytes_for(const ContainerReader& container, unsigned threads,
                                               std::uint64_t frames,
                                               BackEnd back_end = BackEnd::pread);
  [[nodiscard]] const ContainerReader& container() const noexcept { return container_; }
  /// Sums over the shared level and all readers that have ended. The hits of a living reader since
  /// its last miss are not included.
  [[nodiscard]] CacheStatistics statistics() const;
  /// The number of pages that each reader keeps resident for itself.
  [[nodiscard]] std::uint32_t local_slots() const noexcept { return slots_; }

 private:
  friend class PageGuard;
  friend class PageReader;

  /// A page in its frame.
  struct View {
    const std::byte* payload = nullptr;
    std::uint32_t bytes = 0;
    std::uint32_t record_count = 0;
  };

  /// What a reader brings along to the shared level.
  struct Caller {
    std::uint32_t number;
    PageDecoder& decoder;
    PageSources& sources;
    std::uint64_t lookups;      ///< not yet added to the statistics, this one included
    std::uint64_t shared_hits;  ///< not yet added to the statistics
  };

  PageCache(const ContainerReader& container, const CacheOptions& options, std::uint32_t frames);

  [[nodiscard]] View view(std::uint32_t frame) const noexcept;
  std::uint32_t acquire(std::uint32_t page, const Caller& caller);
  std::uint32_t load(std::unique_lock<std::mutex>& lock, std::uint32_t page, const Caller& caller);
  std::span<const std::byte> fetch(std::uint32_t page, PageSources& sources, double& waited) const;
  [[nodiscard]] std::uint32_t next_of_kind(std::uint32_t page) const;

  const ContainerReader& container_;
  const CacheOptions options_;
  const bool reads_ahead_;
  const std::uint32_t slots_;
  /// Guards statistics_, seats_ and those parts of the table that readers do not own.
  mutable std::mutex mutex_;
  std::condition_variable loaded_;
  FrameTable table_;
  const std::uint64_t frame_stride_;
  Arena arena_;
  CacheStatistics statistics_;
  std::vector<bool> seats_;  ///< by number of a reader: whether it exists
};

/// A resident page, which is not evicted while its guard lives.
///
/// A reader pins one page at a time. Asking it for another while a guard lives is a mistake, which
/// throws std::logic_error unless the other page is in the reader's own table. A guard that was
/// moved from pins nothing.
class PageGuard {
 public:
  PageGuard(PageGuard&& other) noexcept
      : view_(other.view_), pins_(std::exchange(other.pins_, nullptr)) {}
  PageGuard& operator=(PageGuard&&) = delete;
  ~PageGuard() {
    if (pins_ != nullptr) --*pins_;
  }

  /// The decoded payload, aligned to 64 bytes. Up to 64 bytes beyond bytes() may be read: they are
  /// zero or stale, never unmapped.
  [[nodiscard]] const std::byte* payload() const noexcept { return view_.payload; }
  /// The size of the payload.
  [[nodiscard]] std::uint32_t bytes() const noexcept { return view_.bytes; }
  /// The number of records in the payload, from the page's header.
  [[nodiscard]] std::uint32_t record_count() const noexcept { return view_.record_count; }

 private:
  friend class PageReader;
  PageGuard(const PageCache::View& view, std::uint32_t& pins) noexcept : view_(view), pins_(&pins) {
    ++pins;
  }

  PageCache::View view_;
  std::uint32_t* pins_;
};

/// One thread's way to pages: a direct-mapped table of pages that it keeps resident, so that a
/// repeated access takes no lock and writes nothing shared.
/// Threads: one reader for each thread.
class PageReader {
 public:
  /// @param cache  must outlive the reader
  /// @throws std::invalid_argument when CacheOptions::threads readers exist already;
  ///         std::system_error when the system lacks the back end
  explicit PageReader(PageCache& cache);
  ~PageReader();
  PageReader(const PageReader&) = delete;
  PageReader& operator=(const PageReader&) = delete;

  /// Pins a page, which is read when it is not resident. The guard must not outlive the reader.
  /// @throws FormatError, DataError, std::system_error when the page cannot be read, the same for
  ///         all callers that wait for it; std::invalid_argument for a page that does not exist;
  ///         std::logic_error when a guard of this reader lives and the page is not in the reader's
  ///         own table. The reader stays usable.
  [[nodiscard]] PageGuard pin(std::uint32_t page) {
    const Slot& slot = table_[page & mask_];
    ++lookups_;
    return {slot.page == page ? slot.view : find(page), pins_};
  }

 private:
  static constexpr std::uint64_t kEmpty = ~std::uint64_t{0};  ///< no page number, not even kNoPage
  struct Slot {
    std::uint64_t page = kEmpty;
    PageCache::View view;
  };
  const PageCache::View& find(std::uint32_t page);

  PageCache& shared_;
  std::uint32_t number_;  ///< among the readers
  std::unique_ptr<Slot[]> table_;
  std::uint32_t mask_;
  std::uint32_t pins_ = 0;         ///< guards that live
  std::uint64_t lookups_ = 0;      ///< not yet added to the shared statistics
  std::uint64_t shared_hits_ = 0;  ///< not yet added to the shared statistics
  PageSources sources_;
  PageDecoder decoder_;
};

}  // namespace ptc
