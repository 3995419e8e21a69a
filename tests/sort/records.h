// Records for the tests of the sort: keys of every distribution, and a payload that identifies
// them.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "engine/base/numbers.h"
#include "engine/sort/external_sort.h"
#include "format/morton.h"
#include "format/point_record.h"

namespace ptc::test {

inline bool same_bytes(std::span<const PointRecord> a, std::span<const PointRecord> b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

/// Returns sorted records: the oracle for all sorts.
inline std::vector<PointRecord> stable_sorted(std::vector<PointRecord> records) {
  std::ranges::stable_sort(records, {}, &PointRecord::key);
  return records;
}

/// Makes a record whose payload is its place in the input.
inline PointRecord numbered(const MortonKey& key, std::size_t place) {
  PointRecord r{};
  r.key = key;
  r.radius = std::bit_cast<float>(static_cast<std::uint32_t>(place) & 0x7f7fffff);
  for (std::size_t i = 0; i < r.radiance.size(); ++i)
    r.radiance[i] = static_cast<std::uint16_t>(place >> 16 * i);
  const std::size_t mixed =
      (place + 1) * kSplitMixStep;  // every byte but the reserved ones, which are 0
  r.normal = {static_cast<std::int16_t>(mixed), static_cast<std::int16_t>(mixed >> 16)};
  for (std::size_t i = 0; i < r.albedo.size(); ++i)
    r.albedo[i] = static_cast<std::uint8_t>(mixed >> (32 + 8 * i));
  r.flags = static_cast<std::uint8_t>(mixed >> 56);
  return r;
}

enum class Keys {
  random,   // all 128 bits
  lattice,  // keys of points: the highest bits are 0
  surface,  // points of a wavy sheet, row by row
  ascending,
  descending,
  equal,
  few,           // 5 different keys
  two_clusters,  // at the ends of the lattice, dense
  low_word,      // the same upper word
  nested,        // each next bit halves the rest: the most skewed distribution
  heavy,         // 9 of 10 share one key, the others lie around it
  outlier,       // equal except for the last, which differs in the first bit
};
inline constexpr Keys kAllKeys[] = {Keys::random,    Keys::lattice,      Keys::surface,
                                    Keys::ascending, Keys::descending,   Keys::equal,
                                    Keys::few,       Keys::two_clusters, Keys::low_word,
                                    Keys::nested,    Keys::heavy,        Keys::outlier};

inline MortonKey key_of(Keys keys, std::size_t i, std::size_t count, std::mt19937_64& random) {
  constexpr std::uint64_t kTop = kLatticeMax >> 1;
  const std::uint64_t r = random();
  switch (keys) {
    case Keys::random:
      return {r, random()};
    case Keys::lattice:
      return encode_morton({r >> 22, random() >> 22, random() >> 22});
    case Keys::surface: {
      const std::uint64_t x = i % 512 << 33, y = i / 512 << 33;
      return encode_morton({x + (r & 0xffffff), y + (r >> 40), (x ^ y) >> 6});
    }
    case Keys::ascending:
      return {i / 3, i};
    case Keys::descending:
      return {(count - i) / 3, count - i};
    case Keys::equal:
      return {42, 4711};
    case Keys::few:
      return {r % 5 * 0x1111111111111111, 3 - r % 3};
    case Keys::two_clusters:
      return r % 2 == 0 ? encode_morton({r >> 58, r >> 52 & 63, r >> 46 & 63})
                        : encode_morton({kTop - (r >> 58), kTop, kTop - (r >> 52 & 63)});
    case Keys::low_word:
      return {0x123456789abcdef0, r};
    case Keys::nested: {
      const int bits = std::countr_zero(r | std::uint64_t{1} << 63) * 2;
      return bits < 64 ? MortonKey{std::uint64_t{1} << bits, 0}
                       : MortonKey{0, std::uint64_t{1} << (bits - 64)};
    }
    case Keys::heavy:
      return {77, r % 10 != 0 ? std::uint64_t{1} << 32 : r >> 31};
    case Keys::outlier:
      return {i + 1 == count ? std::uint64_t{1} << 63 : 0, 5};
  }
  return {};
}

inline std::vector<PointRecord> make_records(Keys keys, std::size_t count, std::uint64_t seed = 1) {
  std::mt19937_64 random(seed);
  std::vector<PointRecord> records;
  records.reserve(count);
  for (std::size_t i = 0; i < count; ++i)
    records.push_back(numbered(key_of(keys, i, count, random), i));
  return records;
}

/// Returns every stride-th key.
inline std::vector<MortonKey> sample_of(std::span<const PointRecord> records, std::size_t count) {
  std::vector<MortonKey> sample;
  const std::size_t stride =
      std::max<std::size_t>(1, records.size() / std::max<std::size_t>(1, count));
  for (std::size_t i = 0; i < records.size() && sample.size() < count; i += stride)
    sample.push_back(records[i].key);
  return sample;
}

}  // namespace ptc::test
