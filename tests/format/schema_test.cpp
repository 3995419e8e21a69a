// The meta page: what is written is read back, and nothing else is accepted.
#include "format/schema.h"

#include <limits>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "format/text.h"
#include "tests/format/support.h"

using namespace ptc;
using ptc::test::clause_of;
using ptc::test::put;
using Bytes = std::vector<std::byte>;

namespace {

Meta example() {
  Meta meta;
  meta.channels = {{"irradiance", ChannelType::half, 3, 1},
                   {"occlusion", ChannelType::u8, 1, 1},
                   {"id.part_0", ChannelType::f32, 2, 7}};
  meta.text = {{"", ""}, {"source", "cit\xc3\xa9"}, {"unit", "m"}};
  meta.text.erase("");
  return meta;
}

std::string clause(const Bytes& payload) {
  return clause_of([&] { (void)decode_meta(payload); });
}

void check_refused(const Meta& meta) {
  CHECK_THROWS_AS(encode_meta(meta), std::invalid_argument);
}

}  // namespace

TEST_CASE("meta: channels and text survive encoding and decoding", "[format][meta]") {
  const Meta meta = example();
  const Meta back = decode_meta(encode_meta(meta));
  CHECK(back.channels == meta.channels);
  CHECK(back.text == meta.text);
  CHECK(encode_meta(back) == encode_meta(meta));
  const Meta empty = decode_meta(encode_meta({}));
  CHECK(empty.channels.empty());
  CHECK(empty.text.empty());
}

TEST_CASE("meta: every proper prefix is truncated, every longer payload too long",
          "[format][meta]") {
  const Bytes whole = encode_meta(example());
  for (std::size_t n = 0; n < whole.size(); ++n) {
    CHECK(clause(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n))) ==
          "spec/points.md#meta-size");
  }
  Bytes longer = whole;
  longer.push_back(std::byte{0});
  CHECK(clause(longer) == "spec/points.md#meta-size");
}

TEST_CASE("meta: any value of any byte is refused or encodes to the same bytes", "[format][meta]") {
  const Bytes whole = encode_meta(example());
  unsigned wrong = 0;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (unsigned value = 0; value < 256; ++value) {
      Bytes changed = whole;
      changed[at] = static_cast<std::byte>(value);
      Meta meta;
      if (clause_of([&] { meta = decode_meta(changed); }) == "none") {
        wrong += encode_meta(meta) != changed;
      }
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("meta: counts beyond the payload are refused before anything is allocated",
          "[format][meta]") {
  for (const std::uint32_t count : {4u, 100u, 0x10000000u, 0xffffffffu}) {
    Bytes payload = encode_meta(example());
    put(payload, 0, count);
    CHECK(clause(payload) != "none");
    payload = encode_meta(example());
    put(payload, 4, count);
    CHECK(clause(payload) == "spec/points.md#meta-size");
    payload = encode_meta(example());
    put(payload, 8 + 3 * 40, count * 10 + 9);  // bytes of the first key
    CHECK(clause(payload) == "spec/points.md#meta-size");
    put(payload, 8 + 3 * 40 + 4, std::numeric_limits<std::uint32_t>::max());
    CHECK(clause(payload) == "spec/points.md#meta-size");
  }
}

TEST_CASE("meta: as many channels as groups hold are decoded, and one more is refused",
          "[format][meta]") {
  Meta meta;
  for (unsigned i = 0; i < 255 * 34; ++i) {
    meta.channels.push_back(
        {std::to_string(i), ChannelType::u8, 1, static_cast<std::uint16_t>(1 + i / 34)});
  }
  Bytes payload = encode_meta(meta);
  CHECK(decode_meta(payload).channels == meta.channels);
  payload.insert(payload.end(), payload.begin() + 8, payload.begin() + 48);
  put(payload, 0, std::uint32_t{255 * 34 + 1});
  CHECK(clause(payload) == "spec/points.md#meta-channel");
}

TEST_CASE("meta: channels that break a rule are refused on both sides", "[format][meta]") {
  const auto with = [](auto&& change) {
    Meta meta = example();
    change(meta);
    return meta;
  };
  check_refused(with([](Meta& m) { m.channels[0].name = std::string(""); }));
  check_refused(with([](Meta& m) { m.channels[0].name = std::string(32, 'a'); }));
  check_refused(with([](Meta& m) { m.channels[0].name = std::string("Upper"); }));
  check_refused(with([](Meta& m) { m.channels[0].name = m.channels[1].name; }));
  check_refused(with([](Meta& m) { m.channels[0].type = ChannelType{5}; }));
  check_refused(with([](Meta& m) { m.channels[0].type = ChannelType{0}; }));
  check_refused(with([](Meta& m) { m.channels[0].components = 0; }));
  check_refused(with([](Meta& m) { m.channels[0].components = 17; }));
  check_refused(with([](Meta& m) { m.channels[0].group = 0; }));
  check_refused(with([](Meta& m) { m.channels[2].group = 256; }));
  check_refused(with([](Meta& m) { m.channels[0].group = 8; }));
  check_refused(with([](Meta& m) { m.channels[2].components = 9; }));
  check_refused(with([](Meta& m) { m.text["Upper"] = std::string(""); }));
  check_refused(with([](Meta& m) { m.text["nul"] = std::string(1, '\0'); }));
  check_refused(with([](Meta& m) { m.text["utf8"] = std::string("\xff"); }));
  CHECK_NOTHROW(encode_meta(with([](Meta& m) { m.channels[0].name = std::string(31, 'a'); })));

  Bytes payload = encode_meta(example());
  put(payload, 8 + 33, std::uint8_t{0});
  CHECK(clause(payload) == "spec/points.md#meta-channel");
  payload = encode_meta(example());
  put(payload, 8 + 36, std::uint32_t{1});
  CHECK(clause(payload) == "spec/points.md#meta-zero");
  payload = encode_meta(example());
  put(payload, 8 + 31, 'x');
  CHECK(clause(payload) == "spec/points.md#meta-zero");
  payload = encode_meta(example());
  put(payload, 8 + 3 * 40 + 8, 'z');  // "zource" comes after "unit"
  CHECK(clause(payload) == "spec/points.md#meta-text");
}

TEST_CASE("meta: the bytes of a group per point are those of its channels", "[format][meta]") {
  const Meta meta = example();
  CHECK(group_point_bytes(meta.channels, 1) == 7);
  CHECK(group_point_bytes(meta.channels, 7) == 8);
  CHECK(group_point_bytes(meta.channels, 2) == 0);
  CHECK(channel_bytes(ChannelType::u16) == 2);
}

TEST_CASE("text: UTF-8 is well-formed as RFC 3629 defines it", "[format][meta]") {
  CHECK(is_utf8(""));
  CHECK(is_utf8("\x7f \xc2\x80 \xdf\xbf \xe0\xa0\x80 \xed\x9f\xbf \xee\x80\x80 \xef\xbf\xbf"));
  CHECK(is_utf8("\xf0\x90\x80\x80 \xf4\x8f\xbf\xbf"));
  for (const char* const bad :
       {"\x80", "\xc0\x80", "\xc1\xbf", "\xc2", "\xc2 ", "\xe0\x9f\xbf", "\xed\xa0\x80", "\xe1\x80",
        "\xf0\x8f\xbf\xbf", "\xf4\x90\x80\x80", "\xf5\x80\x80\x80", "\xff", "\xf1\x80\x80"}) {
    CHECK_FALSE(is_utf8(bad));
  }
  CHECK_FALSE(is_utf8(std::string_view("a\0b", 3)));
}
