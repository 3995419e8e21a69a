// Packed columns: every payload survives packing, the bytes are those of the specification, and
// nonsense is refused.
#include "format/packed_columns.h"

#include <catch2/catch.hpp>

#include "format/codec.h"
#include "format/point_page.h"
#include "tests/format/support.h"

using namespace ptc;
using ptc::test::clause_of;
using ptc::test::get;
using ptc::test::put;
using ptc::test::Random;
using Bytes = std::vector<std::byte>;

namespace {

constexpr char kPacked[] = "spec/points.md#packed-columns";

/// Points along a Z-curve whose coordinates end in `zeros` zero bits, other numbers within `spread`
/// bits.
Bytes point_payload(std::uint32_t count, unsigned zeros, unsigned spread, std::uint64_t seed,
                    std::uint8_t point_bytes = kPointBytes) {
  Random random(seed);
  std::vector<PointRecord> points(count);
  for (PointRecord& point : points) {
    LatticePoint q{};
    for (auto& c : q) c = random.below(std::uint64_t{1} << (42 - zeros)) << zeros;
    point.key = encode_morton(q);
    point.radius = static_cast<float>(random.unit());
    for (auto& n : point.normal) n = static_cast<std::int16_t>(random.bits());
    for (Half3* const light : {&point.radiance, &point.emission}) {
      for (auto& c : *light)
        c = static_cast<std::uint16_t>(random.below(std::uint64_t{1} << spread) % 0x7c00);
    }
    for (auto& c : point.albedo)
      c = static_cast<std::uint8_t>(random.below(std::uint64_t{1} << spread));
  }
  std::ranges::sort(points, {}, &PointRecord::key);
  return encode_point_page(points, point_bytes);
}

Bytes pack(const Bytes& payload, std::uint32_t count, std::span<const PackedColumn> columns) {
  Bytes packed;
  pack_columns(payload, count, columns, packed, InstructionSet::baseline);
  for (const InstructionSet set : kInstructionSets) {
    if (!has_instructions(set)) continue;
    Bytes again;
    pack_columns(payload, count, columns, again, set);
    CHECK(again == packed);
  }
  return packed;
}

Bytes bytes_of(std::initializer_list<int> values) {
  Bytes out;
  for (const int value : values) out.push_back(static_cast<std::byte>(value));
  return out;
}

}  // namespace

TEST_CASE("packed columns: points of every kind survive packing and unpacking",
          "[format][packed]") {
  for (const std::uint8_t point_bytes : {kPointBytes, kEmittingPointBytes}) {
    const auto columns = packed_point_columns(point_bytes);
    for (const std::uint32_t count : {1u, 2u, 7u, 120u, 1920u}) {
      for (const unsigned zeros : {0u, 1u, 13u, 30u, 31u, 32u, 41u}) {
        for (const unsigned spread : {0u, 4u, 16u}) {
          const Bytes payload =
              point_payload(count, zeros, spread, count + zeros + spread, point_bytes);
          const Bytes packed = pack(payload, count, columns);
          Bytes back(payload.size(), std::byte{0xee});
          unpack_columns(packed, count, columns, back);
          CHECK(back == payload);
        }
      }
    }
  }
}

TEST_CASE("packed columns: those of emission follow the others, green first", "[format][packed]") {
  PointRecord point;
  point.emission = {0x1234, 0x1200, 0x1230};
  const Bytes payload = encode_point_page(std::vector{point}, kEmittingPointBytes);
  const Bytes packed = pack(payload, 1, packed_point_columns(kEmittingPointBytes));
  const Bytes plain = pack(encode_point_page(std::vector{point}, kPointBytes), 1,
                           packed_point_columns(kPointBytes));
  REQUIRE(packed.size() == plain.size() + 30);
  CHECK(std::ranges::equal(std::span(packed).first(plain.size()), plain));
  CHECK(Bytes(packed.end() - 30, packed.end()) ==
        bytes_of({9, 0, 0,    0x12, 0, 0, 0, 0, 0, 0,     // 0x1200
                  2, 0, 0x34, 0,    0, 0, 0, 0, 0, 0,     // red less green: 0x34
                  4, 0, 0x30, 0,    0, 0, 0, 0, 0, 0}));  // blue less green: 0x30
}

TEST_CASE("packed columns: channels of every type survive packing and unpacking",
          "[format][packed]") {
  const std::vector<Channel> channels{
      {"a", ChannelType::u8, 3, 1},   {"b", ChannelType::f32, 2, 1},
      {"c", ChannelType::u16, 1, 2},  {"d", ChannelType::half, 16, 3},
      {"e", ChannelType::u64, 2, 4},  {"f", ChannelType::i8, 3, 4},
      {"g", ChannelType::i64, 1, 5},  {"h", ChannelType::f64, 3, 5},
      {"i", ChannelType::u32, 1, 6},  {"j", ChannelType::i16, 5, 6},
      {"k", ChannelType::i32, 2, 255}};
  Random random(5);
  for (const std::uint8_t group : channel_groups(channels)) {
    const std::vector<PackedColumn> columns = packed_group_columns(channels, group);
    for (const std::uint32_t count : {1u, 3u, 1000u}) {
      // Values of any bits, and values that neighbours share all but the lowest bits of.
      for (const std::uint64_t most : {~std::uint64_t{0}, std::uint64_t{3}}) {
        Bytes payload(count * group_point_bytes(channels, group));
        for (std::byte& b : payload) b = static_cast<std::byte>(random.bits() & most);
        Bytes back(payload.size());
        unpack_columns(pack(payload, count, columns), count, columns, back);
        CHECK(back == payload);
      }
    }
  }
  CHECK(packed_group_columns(channels, 7).empty());
}

TEST_CASE("packed columns: differences of 64 bits wrap around", "[format][packed]") {
  const std::vector<PackedColumn> u64{{.before = 0, .bits = 64}};
  Bytes payload(24);
  put(payload, 0, std::uint64_t{1});
  put(payload, 8, ~std::uint64_t{0});  // -2, zigzag 3
  put(payload, 16, std::uint64_t{1} << 63 | 1);
  const Bytes packed = pack(payload, 3, u64);
  REQUIRE(packed.size() == 10 + 8 * 3);
  CHECK(get<std::uint64_t>(packed, 2) == 1);
  CHECK(packed[11] == std::byte{3});
  Bytes back(24);
  unpack_columns(packed, 3, u64, back);
  CHECK(back == payload);
  // A column that takes no plane, and a shift of all bits but one.
  put(payload, 8, std::uint64_t{1} << 63);
  put(payload, 0, std::uint64_t{0});
  put(payload, 16, std::uint64_t{0});
  const Bytes few = pack(payload, 3, u64);
  CHECK(few[0] == std::byte{63});
  CHECK(few.size() == 10 + 3);
  unpack_columns(few, 3, u64, back);
  CHECK(back == payload);
  Bytes wrong = few;
  wrong[0] = std::byte{64};
  CHECK(clause_of([&] { unpack_columns(wrong, 3, u64, back); }) == kPacked);
  wrong = few;
  wrong[1] = std::byte{9};
  CHECK(clause_of([&] { unpack_columns(wrong, 3, u64, back); }) == kPacked);
}

TEST_CASE("packed columns: the bytes are those of the specification", "[format][packed]") {
  const std::vector<PackedColumn> u16{{.before = 0, .bits = 16}};
  // 8, 24, 16, 16: all end in three zero bits; differences 0, 2, -1, 0 of eight; zigzag 0, 4, 1, 0.
  CHECK(pack(bytes_of({8, 0, 24, 0, 16, 0, 16, 0}), 4, u16) ==
        bytes_of({3, 1, 8, 0, 0, 0, 0, 0, 0, 0, 0, 4, 1, 0}));
  // A column of one value takes no plane; zero has no bits to shift away.
  CHECK(pack(bytes_of({0, 1, 0, 1}), 2, u16) == bytes_of({8, 0, 0, 1, 0, 0, 0, 0, 0, 0}));
  CHECK(pack(bytes_of({0, 0, 0, 0}), 2, u16) == bytes_of({0, 0, 0, 0, 0, 0, 0, 0, 0, 0}));
  // 1, 65535: the difference that wraps around is the shorter one, -2, zigzag 3.
  CHECK(pack(bytes_of({1, 0, 255, 255}), 2, u16) == bytes_of({0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 3}));
  // The second column is stored as its difference to the first: -1, -1.
  const std::vector<PackedColumn> pair{{.before = 0, .bits = 8},
                                       {.before = 1, .bits = 8, .minus = 0}};
  CHECK(pack(bytes_of({10, 20, 9, 19}), 2, pair) ==
        bytes_of({1, 1, 10, 0, 0, 0, 0, 0, 0, 0, 0, 10, 0, 0, 255, 0, 0, 0, 0, 0, 0, 0}));
}

TEST_CASE("packed columns: bytes that are no packed columns are refused", "[format][packed]") {
  const std::uint32_t count = 50;
  const Bytes payload = point_payload(count, 3, 8, 1);
  const Bytes packed = pack(payload, count, packed_point_columns(kPointBytes));
  const auto unpack = [&](const Bytes& bytes) {
    Bytes out(payload.size());
    return clause_of([&] { unpack_columns(bytes, count, packed_point_columns(kPointBytes), out); });
  };
  CHECK(unpack(packed) == "none");
  for (std::size_t n = 0; n < packed.size(); ++n) {
    CHECK(unpack(Bytes(packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(n))) ==
          kPacked);
  }
  Bytes longer = packed;
  longer.push_back(std::byte{0});
  CHECK(unpack(longer) == kPacked);
  const auto changed = [&](std::size_t at, auto value) {
    Bytes bytes = packed;
    put(bytes, at, value);
    return unpack(bytes);
  };
  CHECK(changed(0, std::uint8_t{42}) == kPacked);  // shift of 42 bits
  CHECK(changed(1, std::uint8_t{7}) == kPacked);   // planes of 42 bits
  CHECK(changed(2, std::uint64_t{1} << 42) == kPacked);
  CHECK(changed(2, get<std::uint64_t>(packed, 2) ^ 8) ==
        "none");  // another offset, which this function ignores
}

TEST_CASE("packed columns: a payload of the wrong size is the caller's mistake",
          "[format][packed]") {
  Bytes payload = point_payload(9, 0, 8, 1),
        packed = pack(payload, 9, packed_point_columns(kPointBytes));
  for (const std::uint32_t count : {0u, 8u, 10u}) {
    CHECK_THROWS_AS(pack_columns(payload, count, packed_point_columns(kPointBytes), packed),
                    std::invalid_argument);
    CHECK_THROWS_AS(unpack_columns(packed, count, packed_point_columns(kPointBytes), payload),
                    std::invalid_argument);
  }
}

TEST_CASE("codec: columns are packed where that is shorter, and unpack to the same bytes",
          "[format][codec][packed]") {
  for (const Codec codec : {Codec::zstd, Codec::lz4}) {
    PageEncoder encoder(codec);
    PageDecoder decoder;
    for (const std::uint32_t count : {1u, 60u, 1920u}) {
      const Bytes payload = point_payload(count, 20, 4, count);
      const PayloadColumns columns{count, packed_point_columns(kPointBytes)};
      Bytes stored, plain;
      const Coding coding = encoder.encode(payload, stored, columns);
      CHECK(coding.filter == (count < 60 ? Filter::none : Filter::columns));
      static_cast<void>(encoder.encode(payload, plain));
      if (count == 1920) CHECK(10 * stored.size() < 9 * plain.size());
      Bytes back(payload.size());
      decoder.decode(coding, stored, back, columns);
      CHECK(back == payload);
    }
  }
  Bytes stored;
  CHECK(PageEncoder(Codec::raw)
            .encode(point_payload(60, 20, 4, 1), stored, {60, packed_point_columns(kPointBytes)}) ==
        Coding{});
}

TEST_CASE("codec: LZ4 blocks of the wrong size or shape are refused", "[format][codec]") {
  constexpr char kBlock[] = "spec/container.md#codec-block";
  const Bytes raw(600, std::byte{7});
  Bytes stored;
  REQUIRE(PageEncoder(Codec::lz4).encode(raw, stored) == Coding{.codec = Codec::lz4});
  PageDecoder decoder;
  const auto decode = [&](const Bytes& bytes, std::size_t size) {
    Bytes out(size);
    return clause_of([&] { decoder.decode({.codec = Codec::lz4}, bytes, out); });
  };
  CHECK(decode(stored, 600) == "none");
  CHECK(decode(stored, 599) == kBlock);
  CHECK(decode(stored, 601) == kBlock);
  for (std::size_t n = 0; n < stored.size(); ++n) {
    CHECK(decode(Bytes(stored.begin(), stored.begin() + static_cast<std::ptrdiff_t>(n)), 600) ==
          kBlock);
  }
  Bytes longer = stored;
  longer.push_back(std::byte{0});
  CHECK(decode(longer, 600) == kBlock);
  Bytes less = stored;  // declares the size that the page needs, holds less
  put(less, 0, std::uint32_t{601});
  CHECK(decode(less, 601) == kBlock);
  unsigned wrong = 0;
  for (std::size_t bit = 0; bit < 8 * stored.size(); ++bit) {
    Bytes flipped = stored;
    flipped[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
    const std::string clause = decode(flipped, 600);
    wrong += clause != kBlock && clause != "none";
  }
  CHECK(wrong == 0);
}
