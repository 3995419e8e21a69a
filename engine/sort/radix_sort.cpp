// Stable MSD radix sort. A piece that is too large for the processor's cache is partitioned by the
// first bits in which its keys differ, with write combining, and its parts are sorted on their own.
// A piece that fits is sorted as 64-bit words of 32 key bits and an index, and its records move
// once:
//
//   key     ....same bits....|<- window, 32 bits ->|........   128 bits
//   word    | window | index of the record |
//
// Where windows are equal, the records between them are sorted by the bits behind. Records move
// back and forth between two arrays; each piece knows in which one its result has to end.
//
//   a  [ whole ]           [ result ]
//   b         [ p0 | p1 | p2 ]           each part ends in the array where the whole has to
#include "engine/sort/radix_sort.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "engine/sort/partition.h"
#include "engine/sort/radix_sort.h"

namespace ptc {
namespace {

constexpr int kKeyBits = 128;
constexpr int kMaxClassBits = 11;  // at most 2048 classes
constexpr int kExtraBits = 5;      // a prefix has this many bits more than class numbers have
constexpr std::size_t kSamplesPerClass = 16;
constexpr std::size_t kSampleRecords = 256;  // looked at for the first bit in which keys differ
constexpr std::size_t kCacheRecords = std::size_t{1} << 13;     // 448 KiB with their words
constexpr std::size_t kParallelRecords = std::size_t{1} << 17;  // fewer are not worth threads

// A word of the sort in the cache holds 32 bits of the key above the index of the record.
constexpr int kWindowBits = 32;
constexpr int kIndexBits = 32;
constexpr std::uint64_t kIndexMask = 0xffffffff;
constexpr std::size_t kDigitBits = 8, kDigits = std::size_t{1} << kDigitBits;
constexpr std::size_t kInsertionWords = 24;  // no more words are sorted by insertion

using WordBuffer = std::unique_ptr<std::uint64_t[]>;

// Records to be sorted that agree in all bits before some bit.
struct Piece {
  PointRecord* at;
  PointRecord* other;  // room for as many records in the other array
  std::size_t count;
  bool stay;  // whether the result has to end at `at`; otherwise it ends at `other`

  [[nodiscard]] std::span<const PointRecord> records() const noexcept { return {at, count}; }
  [[nodiscard]] PointRecord* target() const noexcept { return stay ? at : other; }
};

// The number of the highest bit that is set, 0 the highest of a key; kKeyBits when there is none.
int first_bit(const MortonKey& bits) noexcept {
  return bits.high != 0 ? std::countl_zero(bits.high) : 64 + std::countl_zero(bits.low);
}

// The first bit in which the keys of every `stride`-th record differ; kKeyBits when they are equal.
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

// Sorts words by their windows, with a stable pass for each 8-bit digit, the lowest first. The
// result ends at `at`.
void sort_words(std::uint64_t* at, std::uint64_t* other, std::size_t count) noexcept {
  if (count <= kInsertionWords) return insertion_sort(at, count);
  // Count the values of all digits in one pass.
  std::array<std::array<std::uint16_t, kDigits>, kWindowBits / kDigitBits> starts{};
  const auto digit = [](std::uint64_t word, std::size_t k) {
    return word >> (kIndexBits + k * kDigitBits) & (kDigits - 1);
  };
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < starts.size(); ++k) ++starts[k][digit(at[i], k)];
  }
  // Move the words digit by digit, except where all words have the same digit.
  std::uint64_t *from = at, *to = other;
  for (std::size_t k = 0; k < starts.size(); ++k) {
    if (starts[k][digit(at[0], k)] == count) continue;
    std::exclusive_scan(starts[k].begin(), starts[k].end(), starts[k].begin(), std::uint16_t{0});
    for (std::size_t i = 0; i < count; ++i) to[starts[k][digit(from[i], k)]++] = from[i];
    std::swap(from, to);
  }
  if (from != at) std::memcpy(at, from, count * sizeof(std::uint64_t));
}

// The 32 bits of a key from `bit` on, with zeros behind its end.
std::uint64_t window(const MortonKey& key, int bit) noexcept {
  if (bit >= 64) return key.low << (bit - 64) >> (64 - kWindowBits);
  const std::uint64_t from_low = bit == 0 ? 0 : key.low >> (64 - bit);
  return (key.high << bit | from_low) >> (64 - kWindowBits);
}

void sort_in_cache(const Piece& p, std::uint64_t* words) noexcept;

// Sorts each range of records that agree in the window at `bit` by the bits behind that window.
void sort_equal_windows(PointRecord* sorted, PointRecord* other, std::size_t count, int bit,
                        std::uint64_t* words) noexcept {
  for (std::size_t begin = 0, end = 0; begin < count; begin = end) {
    const std::uint64_t value = window(sorted[begin].key, bit);
    for (end = begin + 1; end < count && window(sorted[end].key, bit) == value;) ++end;
    if (end - begin > 1) sort_in_cache({sorted + begin, other + begin, end - begin, true}, words);
  }
}

// Sorts a piece that fits in the cache.
// @param words  room for twice as many words as records
void sort_in_cache(const Piece& p, std::uint64_t* words) noexcept {
  const int bit = first_difference(p.records(), 1);
  if (bit >= kKeyBits) return move_to_target(p);

  // Sort words instead of records.
  for (std::size_t i = 0; i < p.count; ++i) words[i] = window(p.at[i].key, bit) << kIndexBits | i;
  sort_words(words, words + p.count, p.count);

  // Move the records into the order of the words.
  PointRecord* const sorted = p.other;
  bool equal_windows = false;
  for (std::size_t i = 0; i < p.count; ++i) {
    sorted[i] = p.at[words[i] & kIndexMask];
    equal_windows |= i > 0 && words[i] >> kIndexBits == words[i - 1] >> kIndexBits;
  }
  // Sort records with equal windows by the bits behind.
  if (equal_windows && bit + kWindowBits < kKeyBits)
    sort_equal_windows(sorted, p.at, p.count, bit, words);
  if (p.stay) std::memcpy(p.at, sorted, p.count * sizeof(PointRecord));
}

// Beyond the cache --------------------------------------------------------------------------------

// The bits of as many classes as give each 2048 to 4096 records.
int class_bits(std::size_t count) noexcept {
  return std::clamp(static_cast<int>(std::bit_width(count)) - 12, 5, kMaxClassBits);
}

// Divides keys that agree in all bits before `bit` into ascending classes of about equal size.
//
// The class of a key follows from a prefix of a few more bits than class numbers have, by a table:
//
//   prefix   000 001 010 011 100 101 110 111
//   samples    0   4   0   1   0   4   1   0
//   class      0   0   0   1   2   2   3   3      at most 4 samples each, and a cut in the middle
//
// Points on surfaces leave most prefixes empty, so that one class for each value of a shorter
// prefix would hold very different numbers of records.
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

  // Assigns prefixes to classes. A class ends when it has enough samples, and in the middle of the
  // prefixes: if `bit` is the first in which keys differ, both halves have keys, so that every
  // partition yields at least two parts and the recursion ends.
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

// Partitions a piece into the other array and returns its parts. Where all keys are equal it moves
// the piece to its target instead and returns none.
std::vector<Piece> partition(const Piece& p, unsigned threads, const Executor& executor) {
  const auto count = [&](const PrefixClasses& classes) {
    const std::size_t blocks = partition_blocks(p.count, classes.size(), threads);
    return ClassCounts(p.records(), classes.size(), blocks, classes, executor);
  };
  // Guess from a few records where keys differ first, and classify by the bits from there on.
  const int bit = first_difference(p.records(), p.count / kSampleRecords);
  PrefixClasses classes(p.records(), std::min(bit, kKeyBits - 1));
  ClassCounts counts = count(classes);
  // Classify again if another record differs before; the first pass has compared all keys.
  const int exact = first_bit(counts.differences());
  if (exact >= kKeyBits) {
    move_to_target(p);
    return {};
  }
  if (exact < bit) {
    classes = PrefixClasses(p.records(), exact);
    counts = count(classes);
  }
  // Move the records, and return the parts.
  counts.scatter(p.other, classes, executor);

  std::vector<Piece> parts;
  const std::vector<std::size_t> starts = counts.starts();
  for (std::size_t c = 0; c < classes.size(); ++c) {
    const std::size_t begin = starts[c], size = starts[c + 1] - begin;
    if (size > 0) parts.push_back({p.other + begin, p.at + begin, size, !p.stay});
  }
  return parts;
}

// Sorts a piece by one thread.
void sort_piece(const Piece& p, std::uint64_t* words, const Executor& executor) {
  if (p.count <= kCacheRecords) return sort_in_cache(p, words);
  for (const Piece& part : partition(p, 1, executor)) sort_piece(part, words, executor);
}

// Sorts a piece by all threads: large parts one after another by all of them, then the small parts
// side by side, each by one thread.
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
  // The bursts of a partition take at most 1/32 of the records (partition_blocks()); allow as much
  // again for all the rest.
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
