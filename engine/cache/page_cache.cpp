// The locked half of the cache: finding, claiming and loading frames.
//
// Why a claim always finds a frame. Let T be the threads, S the slots of a reader's table, F the
// frames; the constructor sees to T * S <= F. A reader pins at most one frame for each of its
// slots, and the frame it loads or waits for counts for the slot it will fill: acquire() unpins
// that slot's old frame first. So when a reader claims a frame, it pins at most S - 1, the others
// at most (T - 1) * S: together fewer than T * S <= F. A frame that is loading or failed is pinned
// by its loader or by those who still have to read its error. So some frame is unpinned: it is
// empty, or ready and in the LRU list. No claim waits, hence there is no deadlock: the only wait is
// for another thread's read, and who reads holds no lock.
#include "engine/cache/page_cache.h"

#include <algorithm>
#include <bit>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include "engine/base/memory.h"
#include "engine/cache/frame_table.h"

namespace ptc {
namespace {

constexpr std::uint32_t kMostSlots = 256;
constexpr std::uint64_t kGuardBytes = 64;            // may be read past a payload
constexpr std::uint64_t kDecoderBytes = 128u << 10;  // a zstd context takes 94 KiB
constexpr std::uint64_t kTableSlotBytes = 32;        // of a PageReader, rounded up

std::uint64_t frame_bytes(const ContainerReader& container) {
  return (container.page_payload_limit() + 63) / 64 * 64 + kGuardBytes;
}

/// What the readers take: table, decoder, and the stored form of the page being read.
std::uint64_t reader_bytes(const ContainerReader& container, unsigned threads) {
  return threads * (kMostSlots * kTableSlotBytes + kDecoderBytes +
                    (std::uint64_t{1} << container.header().page_shift));
}

/// Frames within the cap; more than the pages and a working set for each thread are of no use.
std::uint32_t count_frames(const ContainerReader& container, const CacheOptions& options) {
  const std::uint64_t least = PageCache::least_bytes(container, options.threads);
  if (options.memory_bytes < least) {
    throw std::invalid_argument("page cache: " + std::to_string(options.memory_bytes) +
                                " bytes are too few, " + std::to_string(least) +
                                " are needed for " + std::to_string(options.threads) + " threads");
  }
  const std::uint64_t pages = container.page_count();
  const std::uint64_t fixed = PageCache::bytes_for(container, options.threads, 0);
  const std::uint64_t each = frame_bytes(container) + FrameTable::bytes(0, 1);
  const std::uint64_t wanted = std::max<std::uint64_t>(
      pages, std::uint64_t{2} * options.threads * std::max(1u, options.local_slots));
  return static_cast<std::uint32_t>(
      std::min({(options.memory_bytes - fixed) / each, wanted, std::uint64_t{kNoFrame - 1}}));
}

std::uint32_t choose_slots(const CacheOptions& options, std::uint32_t frames) {
  const std::uint64_t threads = options.threads;
  if (options.local_slots == 0) {
    const auto fair = static_cast<std::uint32_t>(frames / (2 * threads));
    return std::bit_floor(std::clamp(fair, 1u, kMostSlots));
  }
  if (!std::has_single_bit(options.local_slots) || options.local_slots > kMostSlots ||
      threads * options.local_slots > frames) {
    throw std::invalid_argument("page cache: local_slots is no power of two up to 256, or " +
                                std::to_string(frames) + " frames are too few for it");
  }
  return options.local_slots;
}

}  // namespace

struct PageCache::Impl {
  Impl(const ContainerReader& from, const CacheOptions& with)
      : container(from),
        options(with),
        table(from.page_count(), count_frames(from, with)),
        slots(choose_slots(with, table.size())),
        frame_stride(frame_bytes(from)),
        arena(table.size() * frame_stride) {}

  struct Held {
    std::uint32_t frame;
    PageReader::Page view;
  };

  Held hold(std::uint32_t frame) const noexcept {
    return {
        frame,
        {arena.data() + frame * frame_stride, table.page_bytes(frame), table.record_count(frame)}};
  }

  /// Pins `page`, after it has unpinned the frame `released` (or kNoFrame).
  /// @param lookups  of the reader since it last told, this one included
  Held acquire(std::uint32_t page, std::uint32_t released, std::uint64_t lookups,
               PageDecoder& decoder) {
    std::unique_lock lock(mutex);
    told.lookups += lookups;
    told.local_hits += lookups - 1;
    if (released != kNoFrame) table.unpin(released);
    const std::uint32_t frame = table.find(page);
    if (frame == kNoFrame) return load(lock, page, decoder);
    ++told.shared_hits;
    return join(lock, frame);
  }

  Held join(std::unique_lock<std::mutex>& lock, std::uint32_t frame) {
    table.pin(frame);
    loaded.wait(lock, [&] { return table.state(frame) != FrameTable::State::loading; });
    if (table.state(frame) == FrameTable::State::ready) return hold(frame);
    const std::exception_ptr error = table.error(frame);
    table.unpin(frame);
    lock.unlock();
    std::rethrow_exception(error);
  }

  Held load(std::unique_lock<std::mutex>& lock, std::uint32_t page, PageDecoder& decoder) {
    ++told.misses;
    const std::uint32_t frame = table.claim(page);
    lock.unlock();
    PageHeader header;
    try {
      header = container.read_page(
          page, {arena.data() + frame * frame_stride, frame_stride - kGuardBytes}, decoder,
          options.access);
    } catch (...) {
      lock.lock();
      table.fail(frame, std::current_exception());
      table.unpin(frame);
      loaded.notify_all();
      throw;
    }
    lock.lock();
    told.bytes_read += kPageHeaderBytes + std::uint64_t{header.stored_bytes};
    table.ready(frame, header.raw_bytes, header.record_count);
    loaded.notify_all();
    return hold(frame);
  }

  const ContainerReader& container;
  const CacheOptions options;
  mutable std::mutex mutex;  ///< guards table, told and readers
  std::condition_variable loaded;
  FrameTable table;
  const std::uint32_t slots;
  const std::uint64_t frame_stride;
  Arena arena;
  CacheStatistics told;
  unsigned readers = 0;
};

double CacheStatistics::hit_rate() const noexcept {
  if (lookups == 0) return 1;
  return 1 - static_cast<double>(misses) / static_cast<double>(lookups);
}

PageCache::PageCache(const ContainerReader& container, const CacheOptions& options) {
  if (options.threads == 0) throw std::invalid_argument("page cache: no threads");
  impl_ = std::make_unique<Impl>(container, options);
}

PageCache::~PageCache() = default;

std::uint64_t PageCache::least_bytes(const ContainerReader& container, unsigned threads) {
  return bytes_for(container, threads, std::uint64_t{2} * threads);
}

std::uint64_t PageCache::bytes_for(const ContainerReader& container, unsigned threads,
                                   std::uint64_t frames) {
  return reader_bytes(container, threads) + FrameTable::bytes(container.page_count(), frames) +
         frames * frame_bytes(container);
}

const ContainerReader& PageCache::container() const noexcept {
  return impl_->container;
}

std::uint32_t PageCache::local_slots() const noexcept {
  return impl_->slots;
}

CacheStatistics PageCache::statistics() const {
  const std::lock_guard lock(impl_->mutex);
  CacheStatistics sum = impl_->told;
  sum.evictions = impl_->table.evictions();
  sum.frames = impl_->table.size();
  sum.peak_frames = impl_->table.peak();
  return sum;
}

PageReader::PageReader(PageCache& cache)
    : cache_(cache),
      table_(std::make_unique<Slot[]>(cache.impl_->slots)),
      mask_(cache.impl_->slots - 1) {
  static_assert(sizeof(Slot) <= kTableSlotBytes);
  const std::lock_guard lock(cache_.impl_->mutex);
  if (cache_.impl_->readers == cache_.impl_->options.threads) {
    throw std::invalid_argument("page cache: more readers than it was made for");
  }
  ++cache_.impl_->readers;
}

PageReader::~PageReader() {
  PageCache::Impl& shared = *cache_.impl_;
  const std::lock_guard lock(shared.mutex);
  for (std::uint32_t i = 0; i <= mask_; ++i) {
    if (table_[i].page != kEmpty) shared.table.unpin(table_[i].frame);
  }
  shared.told.lookups += lookups_;
  shared.told.local_hits += lookups_;
  --shared.readers;
}

PageReader::Page PageReader::load(std::uint32_t page) {
  if (page >= cache_.container().page_count()) {
    --lookups_;
    throw std::invalid_argument("page cache: there is no page " + std::to_string(page));
  }
  Slot& slot = table_[page & mask_];
  // The slot is empty while its page is under way, and stays so when the page does not arrive.
  const std::uint32_t released = slot.page == kEmpty ? kNoFrame : slot.frame;
  slot.page = kEmpty;
  const auto held = cache_.impl_->acquire(page, released, std::exchange(lookups_, 0), decoder_);
  slot.frame = held.frame;
  slot.view = held.view;
  slot.page = page;
  return slot.view;
}

}  // namespace ptc
