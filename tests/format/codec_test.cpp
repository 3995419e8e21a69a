// Page compression: exact sizes, hostile frames, and the same bytes from a used context.
#include "format/codec.h"

#include <catch2/catch.hpp>
#include <zstd.h>

#include "tests/format/support.h"

using namespace ptc;
using ptc::test::clause_of;
using ptc::test::Random;
using Bytes = std::vector<std::byte>;

namespace {

constexpr char kFrame[] = "spec/container.md#codec-frame";

Bytes compressible(std::size_t size, std::uint64_t seed) {
  Random random(seed);
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) {
    bytes[i] = static_cast<std::byte>(i % 4 == 0 ? random.below(256) : i / 64 % 7);
  }
  return bytes;
}

Bytes noise(std::size_t size) {
  Random random(9);
  Bytes bytes(size);
  for (std::byte& b : bytes) b = static_cast<std::byte>(random.bits());
  return bytes;
}

Bytes zstd_frame(const Bytes& raw, bool content_size, int window_log) {
  Bytes out(ZSTD_compressBound(raw.size()));
  ZSTD_CCtx* const context = ZSTD_createCCtx();
  ZSTD_CCtx_setParameter(context, ZSTD_c_contentSizeFlag, content_size ? 1 : 0);
  ZSTD_CCtx_setParameter(context, ZSTD_c_windowLog, window_log);
  out.resize(ZSTD_compress2(context, out.data(), out.size(), raw.data(), raw.size()));
  ZSTD_freeCCtx(context);
  return out;
}

std::string decode_clause(const Bytes& stored, std::size_t raw_bytes) {
  PageDecoder decoder;
  Bytes out(raw_bytes);
  return clause_of([&] { decoder.decode({Codec::zstd}, stored, out); });
}

}  // namespace

TEST_CASE("codec: pages of every size survive encoding and decoding", "[format][codec]") {
  const Codec kind = GENERATE(Codec::zstd, Codec::lz4);
  PageEncoder encoder(kind);
  PageDecoder decoder;
  for (const std::size_t size : {1u, 5u, 16u, 100u, 4032u, 65472u, (1u << 20) - 64}) {
    const Bytes raw = compressible(size, size);
    Bytes stored;
    const Coding coding = encoder.encode(raw, stored);
    if (size > 4000) CHECK(coding == Coding{.codec = kind});
    Bytes back(size);
    decoder.decode(coding, stored, back);
    CHECK(back == raw);
  }
}

TEST_CASE("codec: a page that compression does not shrink by a sixteenth is stored raw",
          "[format][codec]") {
  PageEncoder encoder(Codec::zstd);
  Bytes stored;
  const Bytes raw = noise(4096);
  CHECK(encoder.encode(raw, stored).codec == Codec::raw);
  CHECK(stored == raw);
  // Half noise, half zeros compresses; the share of zeros decides, and the limit is 15/16.
  for (std::size_t zeros = 0; zeros <= 1024; zeros += 16) {
    Bytes mixed = raw;
    std::fill(mixed.begin(), mixed.begin() + static_cast<std::ptrdiff_t>(zeros), std::byte{0});
    const Codec codec = encoder.encode(mixed, stored).codec;
    CHECK((codec == Codec::raw ? stored.size() == 4096 : stored.size() * 16 <= 4096 * 15));
    if (zeros >= 400) CHECK(codec == Codec::zstd);
  }
}

TEST_CASE("codec: a used encoder gives the same bytes as a fresh one", "[format][codec]") {
  PageEncoder used(Codec::zstd);
  for (std::uint64_t i = 0; i < 8; ++i) {
    Bytes stored;
    used.encode(compressible(30000 + 1000 * i, i), stored);
  }
  Bytes first;
  Bytes second;
  PageEncoder fresh(Codec::zstd);
  CHECK(used.encode(compressible(65472, 3), first) == fresh.encode(compressible(65472, 3), second));
  CHECK(first == second);
}

TEST_CASE("codec: every truncation and every flipped bit is refused or harmless",
          "[format][codec]") {
  const Bytes raw = compressible(600, 1);
  Bytes stored;
  PageEncoder encoder(Codec::zstd);
  REQUIRE(encoder.encode(raw, stored).codec == Codec::zstd);
  for (std::size_t n = 0; n < stored.size(); ++n) {
    CHECK(decode_clause(Bytes(stored.begin(), stored.begin() + static_cast<std::ptrdiff_t>(n)),
                        600) == kFrame);
  }
  unsigned wrong = 0;
  for (std::size_t bit = 0; bit < 8 * stored.size(); ++bit) {
    Bytes flipped = stored;
    flipped[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
    const std::string clause = decode_clause(flipped, 600);  // damaged content may still decode
    wrong += clause != kFrame && clause != "none";
  }
  CHECK(wrong == 0);
}

TEST_CASE("codec: frames of the wrong size, shape or number are refused", "[format][codec]") {
  const Bytes raw = compressible(2000, 2);
  const Bytes frame = zstd_frame(raw, true, 20);
  CHECK(decode_clause(frame, 2000) == "none");
  CHECK(decode_clause(frame, 1999) == kFrame);
  CHECK(decode_clause(frame, 2001) == kFrame);
  CHECK(decode_clause(zstd_frame(raw, false, 20), 2000) == kFrame);
  CHECK(decode_clause(zstd_frame(raw, false, 10), 2000) == kFrame);
  Bytes twice = frame;
  twice.insert(twice.end(), frame.begin(), frame.end());
  CHECK(decode_clause(twice, 2000) == kFrame);
  CHECK(decode_clause(twice, 4000) == kFrame);
  Bytes trailing = frame;
  trailing.push_back(std::byte{0});
  CHECK(decode_clause(trailing, 2000) == kFrame);
  CHECK(decode_clause({}, 2000) == kFrame);
  Bytes skippable{std::byte{0x50}, std::byte{0x2a}, std::byte{0x4d}, std::byte{0x18}};
  skippable.resize(8);
  CHECK(decode_clause(skippable, 2000) == kFrame);
}

TEST_CASE("codec: frames that zstd itself would skip are refused", "[format][codec]") {
  // 34 zeros as one block that repeats a byte: magic, descriptor, content size, block.
  const auto bytes = [](std::initializer_list<int> values) {
    Bytes out;
    for (const int value : values) out.push_back(static_cast<std::byte>(value));
    return out;
  };
  CHECK(decode_clause(bytes({0x28, 0xb5, 0x2f, 0xfd, 0x20, 34, 0x13, 1, 0, 0}), 34) == "none");
  // A dictionary id of 0, which zstd treats as no dictionary.
  CHECK(decode_clause(bytes({0x28, 0xb5, 0x2f, 0xfd, 0x21, 0, 34, 0x13, 1, 0, 0}), 34) == kFrame);
  // A skippable frame after the frame.
  CHECK(decode_clause(bytes({0x28, 0xb5, 0x2f, 0xfd, 0x20, 34, 0x13, 1, 0, 0, 0x50, 0x2a, 0x4d,
                             0x18, 1, 0, 0, 0x00, 0x07}),
                      34) == kFrame);
}

TEST_CASE("codec: a frame that needs a wider window than the page is refused", "[format][codec]") {
  const Bytes raw = compressible(100000, 3);
  const Bytes frame = zstd_frame(raw, true, 12);  // not a single segment
  CHECK(decode_clause(frame, 100000) == kFrame);
}

TEST_CASE("codec: raw payloads keep their size", "[format][codec]") {
  PageDecoder decoder;
  Bytes out(10);
  decoder.decode({}, Bytes(10, std::byte{3}), out);
  CHECK(out == Bytes(10, std::byte{3}));
  CHECK(clause_of([&] { decoder.decode({}, Bytes(9), out); }) == "spec/container.md#page-length");
}
