// The stable partition of records into classes, by many threads and past the processor's cache.
//
// Each thread takes one block of the records. A first pass counts how many records of each block
// fall into each class; from the counts follows where every block's records of every class go, so
// that a second pass can write them all at once, in order and without a lock:
//
//   from   | block 0: a b a c | block 1: b a b c |
//   to     | a0 a0 a1 | b0 b1 b1 | c0 c1 |           letter: class, digit: block
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "format/point_record.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace ptc {

inline constexpr std::size_t kCacheLineBytes = 64;
/// Bytes that a WriteCombiner writes to memory at once.
inline constexpr std::size_t kBurstBytes = 4 * kCacheLineBytes;

/// Writes the first kBytes of records to many places at once, a burst of cache lines at a time. A
/// record stored on its own would fetch the cache line it goes to and, with more places than the
/// TLB has entries, the translation of its page as well.
///
///   destination   | ......## | ######## | ####.... |   bursts begin at the start of a line
///                        ^ begin of the class          the first and the last one may be partial
template <std::size_t kBytes>
class WriteCombiner {
 public:
  /// @param to     destination of all classes; must outlive this
  /// @param begin  for each class, where its first record goes, in records from `to`
  WriteCombiner(std::byte* to, std::span<const std::size_t> begin)
      : places_(begin.size()), bursts_(std::make_unique_for_overwrite<Burst[]>(begin.size())) {
    for (std::size_t c = 0; c < begin.size(); ++c) {
      std::byte* const first = to + begin[c] * kBytes;
      const std::size_t in_line = reinterpret_cast<std::uintptr_t>(first) % kCacheLineBytes;
      places_[c] = {first - in_line, in_line, in_line};
    }
  }

  /// Appends a record to class `c`.
  void put(std::size_t c, const PointRecord& record) noexcept {
    Place& place = places_[c];
    std::memcpy(bursts_[c].bytes + place.filled, &record, sizeof(PointRecord));
    place.filled += kBytes;
    if (place.filled >= kBurstBytes) flush(c);
  }

  /// Writes the partial bursts that are left. Call once, after the last put().
  void finish() noexcept {
    for (std::size_t c = 0; c < places_.size(); ++c) copy(c, places_[c].filled);
#if defined(__SSE2__)
    _mm_sfence();  // makes the streamed lines visible to other threads
#endif
  }

 private:
  // A burst with room for the end of a record that crosses into the next burst.
  struct alignas(kCacheLineBytes) Burst {
    std::byte bytes[kBurstBytes + kCacheLineBytes];
  };
  struct Place {
    std::byte* line = nullptr;  ///< destination of the current burst
    std::size_t skipped = 0;    ///< its first bytes that belong to the class before
    std::size_t filled = 0;     ///< bytes in the burst, including those skipped
  };
  static_assert(kBytes <= sizeof(PointRecord) && sizeof(PointRecord) <= kCacheLineBytes);

  /// Writes a full burst, and moves what lies behind it to the front.
  void flush(std::size_t c) noexcept {
    Place& place = places_[c];
    if (place.skipped > 0) {
      copy(c, kBurstBytes);
      place.skipped = 0;
    } else {
#if defined(__SSE2__)
      const auto* from = reinterpret_cast<const __m128i*>(bursts_[c].bytes);
      auto* to = reinterpret_cast<__m128i*>(place.line);
      for (std::size_t i = 0; i < kBurstBytes / sizeof(__m128i); ++i)
        _mm_stream_si128(to + i, _mm_load_si128(from + i));
#else
      std::memcpy(place.line, bursts_[c].bytes, kBurstBytes);
#endif
    }
    std::memcpy(bursts_[c].bytes, bursts_[c].bytes + kBurstBytes, kCacheLineBytes);
    place.line += kBurstBytes;
    place.filled -= kBurstBytes;
  }

  /// Copies the burst's own bytes before `end` to their place.
  void copy(std::size_t c, std::size_t end) noexcept {
    const Place& place = places_[c];
    std::memcpy(place.line + place.skipped, bursts_[c].bytes + place.skipped, end - place.skipped);
  }

  std::vector<Place> places_;
  std::unique_ptr<Burst[]> bursts_;
};

/// Returns the bytes that ClassCounts::scatter() allocates for each block.
[[nodiscard]] constexpr std::size_t partition_bytes(std::size_t classes) noexcept {
  return classes * (kBurstBytes + kCacheLineBytes + 4 * sizeof(std::size_t));
}

/// Returns the number of blocks for a partition: one for each thread, but not so many that their
/// bursts exceed 1/32 of the records' bytes, or that a block is not worth a thread.
[[nodiscard]] inline std::size_t partition_blocks(std::size_t records, std::size_t classes,
                                                  unsigned threads) noexcept {
  constexpr std::size_t kMinRecords = 1 << 15;
  const std::size_t affordable = records * sizeof(PointRecord) / 32 / partition_bytes(classes);
  return std::clamp<std::size_t>(std::min(affordable, records / kMinRecords), 1, threads);
}

/// Counts how many records of each block fall into each class, and in which bits their keys differ;
/// then moves the records into place.
class ClassCounts {
 public:
  /// @param from      at least one record; must outlive this
  /// @param classes   number of classes
  /// @param classify  returns the class of a record, which it is given by reference into `from`;
  ///                  the same each time
  template <class Classify>
  ClassCounts(std::span<const PointRecord> from, std::size_t classes, std::size_t blocks,
              const Classify& classify, const Executor& executor)
      : from_(from),
        classes_(classes),
        counts_(blocks, std::vector<std::size_t>(classes, 0)),
        differences_(blocks) {
    each_block(executor, [&](std::size_t b) {
      const std::span<std::size_t> counts = counts_[b];
      const MortonKey first = from_.front().key;
      MortonKey differ;
      for (const PointRecord& record : block(b)) {
        ++counts[classify(record)];
        differ.high |= record.key.high ^ first.high;
        differ.low |= record.key.low ^ first.low;
      }
      differences_[b] = differ;
    });
  }

  /// Counts classes that are known already, without reading the records.
  /// @param class_of  the class of each record, in the same order
  ClassCounts(std::span<const PointRecord> from, std::span<const std::uint16_t> class_of,
              std::size_t classes, std::size_t blocks, const Executor& executor)
      : from_(from), classes_(classes), counts_(blocks, std::vector<std::size_t>(classes, 0)) {
    each_block(executor, [&](std::size_t b) {
      const std::span<std::size_t> counts = counts_[b];
      const auto records = block(b);
      const auto first = static_cast<std::size_t>(records.data() - from_.data());
      for (const std::uint16_t c : class_of.subspan(first, records.size())) ++counts[c];
    });
  }

  /// Returns a key whose bits are set where not all keys agree. @pre the constructor classified the
  /// records itself
  [[nodiscard]] MortonKey differences() const noexcept {
    MortonKey all;
    for (const MortonKey& d : differences_) all = {all.high | d.high, all.low | d.low};
    return all;
  }

  /// Returns where each class begins after the move, and the end of the last one: classes + 1
  /// record numbers.
  [[nodiscard]] std::vector<std::size_t> starts() const {
    std::vector<std::size_t> starts(classes_ + 1, 0);
    for (std::size_t c = 0; c < classes_; ++c) {
      starts[c + 1] = starts[c];
      for (const auto& counts : counts_) starts[c + 1] += counts[c];
    }
    return starts;
  }

  /// Moves the records to `to`, class by class, in their order within each class.
  /// @param to        room for all records, outside of `from`
  /// @param classify  as for the constructor
  template <class Classify>
  void scatter(PointRecord* to, const Classify& classify, const Executor& executor) const {
    scatter_packed<sizeof(PointRecord)>(reinterpret_cast<std::byte*>(to), classify, executor);
  }

  /// Moves the first kBytes of each record to `to` as scatter() does, without gaps between them.
  template <std::size_t kBytes, class Classify>
  void scatter_packed(std::byte* to, const Classify& classify, const Executor& executor) const {
    each_block(executor, [&](std::size_t b) {
      WriteCombiner<kBytes> out(to, begins(b));
      for (const PointRecord& record : block(b)) out.put(classify(record), record);
      out.finish();
    });
  }

 private:
  template <class Body>
  void each_block(const Executor& executor, const Body& body) const {
    if (counts_.size() == 1) return body(std::size_t{0});
    executor.for_each(counts_.size(), [&](std::size_t b, unsigned) { body(b); });
  }

  /// Returns the records of one block. Blocks are equally long, except that the last takes the
  /// rest.
  [[nodiscard]] std::span<const PointRecord> block(std::size_t b) const noexcept {
    const std::size_t size = from_.size() / counts_.size();
    return b + 1 < counts_.size() ? from_.subspan(b * size, size) : from_.subspan(b * size);
  }

  /// Returns where block b's records of each class go: after all records of the classes before, and
  /// after those of the same class in the blocks before.
  [[nodiscard]] std::vector<std::size_t> begins(std::size_t b) const {
    std::vector<std::size_t> begin(classes_);
    std::size_t at = 0;
    for (std::size_t c = 0; c < classes_; ++c)
      for (std::size_t other = 0; other < counts_.size(); ++other) {
        if (other == b) begin[c] = at;
        at += counts_[other][c];
      }
    return begin;
  }

  std::span<const PointRecord> from_;
  std::size_t classes_;
  std::vector<std::vector<std::size_t>> counts_;  ///< by block and class
  std::vector<MortonKey> differences_;            ///< by block
};

}  // namespace ptc
