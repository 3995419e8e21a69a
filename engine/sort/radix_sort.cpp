// Stable MSD radix sort. Pieces beyond the cache are partitioned with write combining; pieces in
// the cache are sorted as 64-bit words of 32 key bits and an index, then moved once.
//
// Records move back and forth between the two arrays; each piece knows where it has to end.
#include "engine/sort/radix_sort.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "engine/sort/external_sort.h"
#include "engine/sort/partition.h"

namespace ptc {
namespace {

constexpr int kKeyBits = 128;
constexpr int kMaxClassBits = 11;
constexpr int kExtraBits = 5;
constexpr std::size_t kSamplesPerClass = 16;
constexpr std::size_t kSampleRecords = 256;
constexpr std::size_t kCacheRecords = std::size_t{1} << 13;     // with their words: 448 KiB
constexpr std::size_t kParallelRecords = std::size_t{1} << 17;  // fewer are not worth a thread

// A word of the sort in the cache: 32 bits of the key above the index of the record.
constexpr int kWindowBits = 32;
constexpr int kIndexBits = 32;
constexpr std::uint64_t kIndexMask = 0xffffffff;
constexpr std::size_t kDigitBits = 8, kDigits = std::size_t{1} << kDigitBits;
constexpr std::size_t kInsertionWords = 24;

using WordBuffer = std::unique_ptr<std::uint64_t[]>;

// Records to be sorted.
struct Piece {
  PointRecord* at;
  PointRecord* other;  // as many records to work in
  std::size_t count;
  bool stay;  // whether the result goes to `at`, else to `other`

  [[nodiscard]] std::span<const PointRecord> records() const noexcept { return {at, count}; }
  [[nodiscard]] PointRecord* target() const noexcept { return stay ? at : other; }
};

int first_bit(const MortonKey& bits) noexcept {
  return bits.high != 0 ? std::countl_zero(bits.high) : 64 + std::countl_zero(bits.low);
}

// The first bit in which keys of every `stride`-th record differ; kKeyBits when they are equal.
int first_difference(std::span<const PointRecord> records, std::size_t stride) noexcept {
  const MortonKey first = records.front().key;
  MortonKey differ;
  for (std::size_t i = 0; i < records.size(); i += stride) {
    differ.high |= records[i].key.high ^ first.high;
    differ.low |= records[i].key.low ^ first.low;
  }
  return first_bit(differ);
}

void move_to_target(const Piece& p) noexcept {
  if (!p.stay) std::memcpy(p.other, p.at, p.count * sizeof(PointRecord));
}

// In the cache ------------------------------------------------------------------------------------

void insertion_sort(std::uint64_t* words, std::size_t count) noexcept {
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t word = words[i];
    std::size_t j = i;
    for (; j > 0 && word < words[j - 1]; --j) words[j] = words[j - 1];
    words[j] = word;
  }
}

// Sorts words by their windows, into `at`: a stable pass for each digit that is not the same in
// all, the lowest first.
void sort_words(std::uint64_t* at, std::uint64_t* other, std::size_t count) noexcept {
  if (count <= kInsertionWords) return insertion_sort(at, count);
  std::array<std::array<std::uint16_t, kDigits>, kWindowBits / kDigitBits> starts{};
  const auto digit = [](std::uint64_t word, std::size_t k) {
    return word >> (kIndexBits + k * kDigitBits) & (kDigits - 1);
  };
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < starts.size(); ++k) ++starts[k][digit(at[i], k)];
  }
  std::uint64_t *from = at, *to = other;
  for (std::size_t k = 0; k < starts.size(); ++k) {
    if (starts[k][digit(at[0], k)] == count) continue;
    std::exclusive_scan(starts[k].begin(), starts[k].end(), starts[k].begin(), std::uint16_t{0});
    for (std::size_t i = 0; i < count; ++i) to[starts[k][digit(from[i], k)]++] = from[i];
    std::swap(from, to);
  }
  if (from != at) std::memcpy(at, from, count * sizeof(std::uint64_t));
}

// 32 bits of a key from `bit` on, zeros behind its end.
std::uint64_t window(const MortonKey& key, int bit) noexcept {
  if (bit >= 64) return key.low << (bit - 64) >> (64 - kWindowBits);
  const std::uint64_t from_low = bit == 0 ? 0 : key.low >> (64 - bit);
  return (key.high << bit | from_low) >> (64 - kWindowBits);
}

void sort_in_cache(const Piece& p, std::uint64_t* words) noexcept;

// Sorts on, by the next bits, where sorted records agree in the window at `bit`.
void sort_equal_windows(PointRecord* sorted, PointRecord* other, std::size_t count, int bit,
                        std::uint64_t* words) noexcept {
  for (std::size_t begin = 0, end = 0; begin < count; begin = end) {
    const std::uint64_t value = window(sorted[begin].key, bit);
    for (end = begin + 1; end < count && window(sorted[end].key, bit) == value;) ++end;
    if (end - begin > 1) sort_in_cache({sorted + begin, other + begin, end - begin, true}, words);
  }
}

// @param words  room for two times the records
void sort_in_cache(const Piece& p, std::uint64_t* words) noexcept {
  const int bit = first_difference(p.records(), 1);
  if (bit >= kKeyBits) return move_to_target(p);

  for (std::size_t i = 0; i < p.count; ++i) words[i] = window(p.at[i].key, bit) << kIndexBits | i;
  sort_words(words, words + p.count, p.count);

  PointRecord* const sorted = p.other;
  bool equal_windows = false;
  for (std::size_t i = 0; i < p.count; ++i) {
    sorted[i] = p.at[words[i] & kIndexMask];
    equal_windows |= i > 0 && words[i] >> kIndexBits == words[i - 1] >> kIndexBits;
  }
  if (equal_windows && bit + kWindowBits < kKeyBits)
    sort_equal_windows(sorted, p.at, p.count, bit, words);
  if (p.stay) std::memcpy(p.at, sorted, p.count * sizeof(PointRecord));
}

// Beyond the cache --------------------------------------------------------------------------------

// As many classes as give each some 2048 records.
int class_bits(std::size_t count) noexcept {
  return std::clamp(static_cast<int>(std::bit_width(count)) - 12, 5, kMaxClassBits);
}

// Ascending classes of keys that agree in all bits before `bit`, of about equal size.
//
// Keys are told apart by a prefix of more bits than there are classes; which prefixes share a class
// is taken from a sample. Points on surfaces leave most prefixes empty, so as many classes of a
// prefix each would hold very different numbers of records.
class PrefixClasses {
 public:
  PrefixClasses(std::span<const PointRecord> records, int bit)
      : high_(bit < 64), bits_(std::min(class_bits(records.size()) + kExtraBits, 64 - bit % 64)) {
    shift_ = 64 - bit % 64 - bits_;
    const std::size_t wanted = std::size_t{1} << class_bits(records.size());
    const std::size_t stride =
        std::max<std::size_t>(1, records.size() / (wanted * kSamplesPerClass));
    std::vector<std::uint32_t> hits(std::size_t{1} << bits_, 0);
    std::size_t samples = 0;
    for (std::size_t i = 0; i < records.size(); i += stride, ++samples)
      ++hits[prefix(records[i].key)];
    assign(hits, (samples + wanted - 1) / wanted);
  }

  [[nodiscard]] std::size_t operator()(const PointRecord& record) const noexcept {
    return class_of_[prefix(record.key)];
  }
  [[nodiscard]] std::size_t size() const noexcept { return std::size_t{class_of_.back()} + 1; }

 private:
  [[nodiscard]] std::size_t prefix(const MortonKey& key) const noexcept {
    return static_cast<std::size_t>((high_ ? key.high : key.low) >> shift_) &
           ((std::size_t{1} << bits_) - 1);
  }

  // A class ends when its samples are enough, and in the middle: when `bit` is the first in which
  // keys differ, there are some in both halves, and the partition makes headway.
  void assign(std::span<const std::uint32_t> hits, std::size_t samples_per_class) {
    class_of_.resize(hits.size());
    std::uint16_t current = 0;
    std::size_t samples = 0;
    for (std::size_t i = 0; i < hits.size(); ++i) {
      if (i > 0 && (i == hits.size() / 2 || samples + hits[i] > samples_per_class)) {
        ++current;
        samples = 0;
      }
      samples += hits[i];
      class_of_[i] = current;
    }
  }

  bool high_;
  int bits_;
  int shift_;
  std::vector<std::uint16_t> class_of_;
};

// Partitions a piece into the other array and returns the parts; there are none, and nothing is
// left to do, when all keys are equal.
std::vector<Piece> partition(const Piece& p, unsigned threads, const Executor& executor) {
  const auto count = [&](const PrefixClasses& classes) {
    const std::size_t blocks = partition_blocks(p.count, classes.size(), threads);
    return ClassCounts(p.records(), classes.size(), blocks, classes, executor);
  };
  // A few records tell where keys differ first, unless one of the others differs before.
  const int bit = first_difference(p.records(), p.count / kSampleRecords);
  PrefixClasses classes(p.records(), std::min(bit, kKeyBits - 1));
  ClassCounts counts = count(classes);
  const int exact = first_bit(counts.differences());
  if (exact >= kKeyBits) {
    move_to_target(p);
    return {};
  }
  if (exact < bit) {
    classes = PrefixClasses(p.records(), exact);
    counts = count(classes);
  }
  counts.scatter(p.other, classes, executor);

  std::vector<Piece> parts;
  const std::vector<std::size_t> starts = counts.starts();
  for (std::size_t c = 0; c < classes.size(); ++c) {
    const std::size_t begin = starts[c], size = starts[c + 1] - begin;
    if (size > 0) parts.push_back({p.other + begin, p.at + begin, size, !p.stay});
  }
  return parts;
}

// By one thread.
void sort_piece(const Piece& p, std::uint64_t* words, const Executor& executor) {
  if (p.count <= kCacheRecords) return sort_in_cache(p, words);
  for (const Piece& part : partition(p, 1, executor)) sort_piece(part, words, executor);
}

// By all threads: together where a part is large, else each part by one of them.
void sort_by_all(const Piece& p, std::span<const WordBuffer> words, const Executor& executor) {
  std::vector<Piece> parts = partition(p, executor.threads(), executor);
  const std::size_t large = std::max(kParallelRecords, p.count / (4 * executor.threads()));
  const auto small = std::partition(parts.begin(), parts.end(),
                                    [large](const Piece& part) { return part.count > large; });
  for (auto part = parts.begin(); part != small; ++part) sort_by_all(*part, words, executor);
  executor.for_each(
      static_cast<std::size_t>(parts.end() - small), [&](std::size_t i, unsigned thread) {
        sort_piece(small[static_cast<std::ptrdiff_t>(i)], words[thread].get(), executor);
      });
}

std::size_t word_count(std::size_t records) noexcept {
  return 2 * std::min(records, kCacheRecords);
}

unsigned threads_for(std::size_t records, unsigned threads) noexcept {
  return records < kParallelRecords ? 1 : threads;
}

}  // namespace

std::size_t radix_sort_bytes(std::size_t records, unsigned threads) noexcept {
  const std::size_t words = word_count(records) * sizeof(std::uint64_t);
  // Groups of the partition, see partition_blocks(), and as much again for all the rest.
  return threads_for(records, threads) * words + records * sizeof(PointRecord) / 16;
}

void radix_sort(std::span<PointRecord> records, std::span<PointRecord> scratch,
                const Executor& executor) {
  if (scratch.size() < records.size())
    throw std::invalid_argument("radix_sort: scratch is smaller than records");
  if (records.empty()) return;

  std::vector<WordBuffer> words(threads_for(records.size(), executor.threads()));
  for (WordBuffer& buffer : words)
    buffer = std::make_unique_for_overwrite<std::uint64_t[]>(word_count(records.size()));
  const Piece whole{records.data(), scratch.data(), records.size(), true};
  if (words.size() == 1)
    sort_piece(whole, words.front().get(), executor);
  else
    sort_by_all(whole, words, executor);
}

}  // namespace ptc
