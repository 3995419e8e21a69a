// Finding, claiming and loading frames.
//
// Why a claim always finds a frame. Let T be the readers, S the slots of each, F the frames; the
// constructor sees to T * S <= F. A slot holds at most one frame, and that of the page being asked
// for is empty by then: hold() left it so. A frame that is loading or failed is held in a slot of
// its loader and of those who still have to read its error. So when a reader claims, slots hold
// fewer than T * S <= F frames, and some frame is empty, or ready and held by nobody. No claim
// waits, hence there is no deadlock: the only wait is for another reader's read, and who reads
// holds no lock.
#include "engine/cache/page_cache.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <exception>
#include <stdexcept>
#include <string>
#include <utility>

namespace ptc {
namespace {

constexpr std::uint32_t kMaxSlots = 256;
constexpr std::uint64_t kGuardBytes = 64;            // may be read past a payload
constexpr std::uint64_t kDecoderBytes = 128u << 10;  // a zstd context takes 94 KiB
constexpr std::uint64_t kTableSlotBytes = 32;        // of a PageReader, rounded up

std::uint64_t frame_bytes(const ContainerReader& container) {
  return (container.page_payload_limit() + 63) / 64 * 64 + kGuardBytes;
}

std::size_t max_stored(const ContainerReader& container) {
  return std::size_t{1} << container.header().page_shift;
}

/// What the readers take: table, decoder, and the back end's buffers.
std::uint64_t reader_bytes(const ContainerReader& container, unsigned threads, BackEnd back_end) {
  return threads *
         (kMaxSlots * kTableSlotBytes + kDecoderBytes +
          PageSources::most(container) * page_source_bytes(back_end, max_stored(container)));
}

/// Frames within the cap; more than the pages and a working set for each thread are of no use.
std::uint32_t count_frames(const ContainerReader& container, const CacheOptions& options) {
  if (options.threads == 0) throw std::invalid_argument("page cache: no threads");
  const std::uint64_t least = PageCache::min_bytes(container, options.threads, options.back_end);
  if (options.memory_bytes < least) {
    throw std::invalid_argument("page cache: " + std::to_string(options.memory_bytes) +
                                " bytes are too few, " + std::to_string(least) +
                                " are needed for " + std::to_string(options.threads) + " threads");
  }
  const std::uint64_t pages = container.page_count();
  const std::uint64_t fixed = PageCache::bytes_for(container, options.threads, 0, options.back_end);
  const std::uint64_t each = frame_bytes(container) + FrameTable::bytes(0, 1, 0, 0);
  const std::uint64_t wanted = std::max<std::uint64_t>(
      pages, std::uint64_t{2} * options.threads * std::max(1u, options.local_slots));
  constexpr std::uint64_t kMaxFrames = 0x7fffffff;  // FrameTable needs a bit
  return static_cast<std::uint32_t>(
      std::min({(options.memory_bytes - fixed) / each, wanted, kMaxFrames}));
}

std::uint32_t choose_slots(const CacheOptions& options, std::uint32_t frames) {
  const std::uint64_t threads = options.threads;
  if (options.local_slots == 0) {
    const auto fair = static_cast<std::uint32_t>(frames / (2 * threads));
    return std::bit_floor(std::clamp(fair, 1u, kMaxSlots));
  }
  if (!std::has_single_bit(options.local_slots) || options.local_slots > kMaxSlots ||
      threads * options.local_slots > frames) {
    throw std::invalid_argument("page cache: local_slots is no power of two up to 256, or " +
                                std::to_string(frames) + " frames are too few for it");
  }
  return options.local_slots;
}

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

}  // namespace

PageCache::View PageCache::view(std::uint32_t frame) const noexcept {
  return {arena_.data() + frame * frame_stride_, table_.page_bytes(frame),
          table_.record_count(frame)};
}

// Holds a page that hold() did not find.
std::uint32_t PageCache::acquire(std::uint32_t page, const Caller& caller) {
  std::unique_lock lock(mutex_);
  statistics_.lookups += caller.lookups;
  statistics_.shared_hits += caller.shared_hits;
  statistics_.local_hits += caller.lookups - 1 - caller.shared_hits;
  const std::uint32_t frame = table_.join(caller.number, page);
  if (frame == kNoFrame) return load(lock, page, caller);
  ++statistics_.shared_hits;
  const auto begin = Clock::now();
  loaded_.wait(lock, [&] { return table_.state(frame) != FrameTable::State::loading; });
  statistics_.wait_seconds += seconds_since(begin);
  if (table_.state(frame) == FrameTable::State::ready) return frame;
  const std::exception_ptr error = table_.error(frame);
  table_.leave(caller.number, frame);
  lock.unlock();
  std::rethrow_exception(error);
}

std::uint32_t PageCache::load(std::unique_lock<std::mutex>& lock, std::uint32_t page,
                              const Caller& caller) {
  ++statistics_.misses;
  const std::uint32_t frame = table_.claim(caller.number, page);
  lock.unlock();
  PageHeader header;
  double waited = 0;
  try {
    const std::span<const std::byte> image = fetch(page, caller.sources, waited);
    header = container_.decode_page(
        page, image, {arena_.data() + frame * frame_stride_, frame_stride_ - kGuardBytes},
        caller.decoder);
  } catch (...) {
    lock.lock();
    table_.fail(frame, std::current_exception());
    table_.leave(caller.number, frame);
    loaded_.notify_all();
    throw;
  }
  lock.lock();
  statistics_.bytes_read += kPageHeaderBytes + std::uint64_t{header.stored_bytes};
  statistics_.wait_seconds += waited;
  table_.ready(frame, header.raw_bytes, header.record_count);
  loaded_.notify_all();
  return frame;
}

// Pages of a kind follow the Z-curve, and so do receivers: the next one is wanted soon more often
// than not.
std::span<const std::byte> PageCache::fetch(std::uint32_t page, PageSources& sources,
                                            double& waited) const {
  const auto begin = Clock::now();
  const std::uint32_t next = reads_ahead_ ? next_of_kind(page) : kNoPage;
  if (next != kNoPage && !table_.present(next)) {
    const ContainerReader::PageRange range = container_.page_range(next);
    sources.of(range.part).expect(range.offset, range.bytes);
  }
  const ContainerReader::PageRange range = container_.page_range(page);
  if (range.bytes == 0) return {};  // a void page
  const std::span<const std::byte> image = sources.of(range.part).read(range.offset, range.bytes);
  waited = seconds_since(begin);
  return image;
}

std::uint32_t PageCache::next_of_kind(std::uint32_t page) const {
  for (const PageNumbers::Range& kind : {container_.point_pages(), container_.node_pages()}) {
    if (kind.contains(page) && kind.contains(page + 1)) return page + 1;
  }
  return kNoPage;
}

double CacheStatistics::hit_rate() const noexcept {
  if (lookups == 0) return 1;
  return 1 - static_cast<double>(misses) / static_cast<double>(lookups);
}

PageCache::PageCache(const ContainerReader& container, const CacheOptions& options)
    : PageCache(container, options, count_frames(container, options)) {}

PageCache::PageCache(const ContainerReader& container, const CacheOptions& options,
                     std::uint32_t frames)
    : container_(container),
      options_(options),
      reads_ahead_(options.read_ahead && options.back_end == BackEnd::io_uring),
      slots_(choose_slots(options, frames)),
      table_({container.page_count(), frames, options.threads, slots_}, options.replacement),
      frame_stride_(frame_bytes(container)),
      arena_(frames * frame_stride_),
      seats_(options.threads) {}

std::uint64_t PageCache::min_bytes(const ContainerReader& container, unsigned threads,
                                   BackEnd back_end) {
  return bytes_for(container, threads, std::uint64_t{2} * threads, back_end);
}

std::uint64_t PageCache::bytes_for(const ContainerReader& container, unsigned threads,
                                   std::uint64_t frames, BackEnd back_end) {
  return reader_bytes(container, threads, back_end) +
         FrameTable::bytes(container.page_count(), frames, threads, kMaxSlots) +
         frames * frame_bytes(container);
}

CacheStatistics PageCache::statistics() const {
  const std::lock_guard lock(mutex_);
  CacheStatistics sum = statistics_;
  sum.evictions = table_.evictions();
  sum.frames = table_.size();
  sum.peak_frames = table_.peak();
  return sum;
}

PageReader::PageReader(PageCache& cache)
    : shared_(cache),
      table_(std::make_unique<Slot[]>(shared_.slots_)),
      mask_(shared_.slots_ - 1),
      sources_(shared_.options_.back_end, shared_.container_, max_stored(shared_.container_)) {
  static_assert(sizeof(Slot) <= kTableSlotBytes);
  const std::lock_guard lock(shared_.mutex_);
  const auto seat = std::ranges::find(shared_.seats_, false);
  if (seat == shared_.seats_.end()) {
    throw std::invalid_argument("page cache: more readers than it was made for");
  }
  *seat = true;
  number_ = static_cast<std::uint32_t>(seat - shared_.seats_.begin());
}

PageReader::~PageReader() {
  const std::lock_guard lock(shared_.mutex_);
  for (std::uint32_t slot = 0; slot <= mask_; ++slot) shared_.table_.release(number_, slot);
  shared_.statistics_.lookups += lookups_;
  shared_.statistics_.shared_hits += shared_hits_;
  shared_.statistics_.local_hits += lookups_ - shared_hits_;
  shared_.seats_[number_] = false;
}

const PageCache::View& PageReader::find(std::uint32_t page) {
  if (pins_ != 0) {
    --lookups_;
    throw std::logic_error("page cache: a page is asked for while this reader has another pinned");
  }
  if (page >= shared_.container_.page_count()) {
    --lookups_;
    throw std::invalid_argument("page cache: page " + std::to_string(page) + " does not exist");
  }
  Slot& slot = table_[page & mask_];
  slot.page = kEmpty;  // and stays so when the page does not arrive
  std::uint32_t frame = shared_.table_.hold(number_, page);
  if (frame != kNoFrame) {
    ++shared_hits_;
  } else {
    frame = shared_.acquire(page, {number_, decoder_, sources_, std::exchange(lookups_, 0),
                                   std::exchange(shared_hits_, 0)});
  }
  slot.view = shared_.view(frame);
  slot.page = page;
  return slot.view;
}

}  // namespace ptc
