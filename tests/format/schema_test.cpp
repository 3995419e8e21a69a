// The meta page: what is written is read back, and nothing else is accepted.
#include "format/schema.h"

#include <algorithm>
#include <array>
#include <cstring>
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
  meta.channels[0].role = ChannelRole::colour;
  meta.channels[0].colour_space = ColourSpace::rec709;
  meta.channels[0].unit = "W/m^2";
  meta.channels[1].no_value = 255;
  meta.channels[1].scale = 1.0 / 254;
  meta.channels[2].unit = "\xc2\xb5m";
  meta.channels[2].offset = -0.5;
  meta.text = {{"", ""}, {"source", "cit\xc3\xa9"}, {"unit", "m"}};
  meta.text.erase("");
  return meta;
}

Bytes encode(const Meta& meta, std::size_t point_bytes = 34) {
  return encode_meta(meta, point_bytes);
}

Meta decode(const Bytes& payload, std::size_t point_bytes = 34) {
  return decode_meta(payload, point_bytes);
}

std::string clause(const Bytes& payload, std::size_t point_bytes = 34) {
  return clause_of([&] { (void)decode(payload, point_bytes); });
}

void check_refused(const Meta& meta) {
  CHECK_THROWS_AS(encode(meta), std::invalid_argument);
}

// Returns the clause that the example's payload breaks when bytes of its k-th channel change.
template <class T>
std::string changed(std::size_t k, std::size_t at, T value) {
  Bytes payload = encode(example());
  put(payload, 8 + 88 * k + at, value);
  return clause(payload);
}

template <class Change>
Meta with(const Change& change) {
  Meta meta = example();
  change(meta);
  return meta;
}

// Checks that one channel, with this change, is refused by the encoder.
template <class Change>
void check_channel_refused(const Change& change) {
  check_refused(with([&](Meta& m) { change(m.channels[0]); }));
}

constexpr char kChannel[] = "spec/points.md#meta-channel";
constexpr char kZero[] = "spec/points.md#meta-zero";
constexpr char kFact[] = "spec/points.md#meta-fact";

}  // namespace

TEST_CASE("meta: channels and text survive encoding and decoding", "[format][meta]") {
  const Meta meta = example();
  const Meta back = decode(encode(meta));
  CHECK(back.channels == meta.channels);
  CHECK(back.text == meta.text);
  CHECK(encode(back) == encode(meta));
  const Meta empty = decode(encode({}));
  CHECK(empty.channels.empty());
  CHECK(empty.text.empty());
}

TEST_CASE("meta: the fields of a channel lie where the spec says", "[format][meta]") {
  Meta meta;
  meta.channels = {{"a", ChannelType::i16, 3, 200}};
  Channel& channel = meta.channels[0];
  channel.role = ChannelRole::vector;
  channel.colour_space = ColourSpace::acescg;
  channel.unit = "m/s";
  channel.no_value = 0x8000;
  channel.scale = 0.25;
  channel.offset = -7;
  const Bytes bytes = encode(meta);
  REQUIRE(bytes.size() == 8 + 88);
  const auto u8 = [&](std::size_t at) { return test::get<std::uint8_t>(bytes, 8 + at); };
  CHECK(u8(0) == 'a');
  CHECK(u8(1) == 0);
  CHECK(u8(32) == 8);
  CHECK(u8(33) == 3);
  CHECK(u8(34) == 200);
  CHECK(u8(35) == 3);
  CHECK(u8(36) == 3);
  CHECK(u8(37) == 1);
  CHECK(u8(38) == 2);
  CHECK(u8(39) == 0);
  CHECK(std::memcmp(&bytes[8 + 40], "m/s", 4) == 0);
  CHECK(test::get<std::uint64_t>(bytes, 8 + 56) == 0x8000);
  CHECK(test::get<double>(bytes, 8 + 64) == 0.25);
  CHECK(test::get<double>(bytes, 8 + 72) == -7);
  CHECK(test::get<std::uint64_t>(bytes, 8 + 80) == 0);
}

TEST_CASE("meta: every proper prefix is truncated, every longer payload too long",
          "[format][meta]") {
  const Bytes whole = encode(example());
  for (std::size_t n = 0; n < whole.size(); ++n) {
    CHECK(clause(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n))) ==
          "spec/points.md#meta-size");
  }
  Bytes longer = whole;
  longer.push_back(std::byte{0});
  CHECK(clause(longer) == "spec/points.md#meta-size");
}

TEST_CASE("meta: any value of any byte is refused or encodes to the same bytes", "[format][meta]") {
  const Bytes whole = encode(example());
  unsigned wrong = 0;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (unsigned value = 0; value < 256; ++value) {
      Bytes changed = whole;
      changed[at] = static_cast<std::byte>(value);
      Meta meta;
      if (clause_of([&] { meta = decode(changed); }) == "none") {
        wrong += encode(meta) != changed;
      }
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("meta: counts beyond the payload are refused before anything is allocated",
          "[format][meta]") {
  for (const std::uint32_t count : {4u, 100u, 0x10000000u, 0xffffffffu}) {
    Bytes payload = encode(example());
    put(payload, 0, count);
    CHECK(clause(payload) != "none");
    payload = encode(example());
    put(payload, 4, count);
    CHECK(clause(payload) == "spec/points.md#meta-size");
    payload = encode(example());
    put(payload, 8 + 3 * 88, count * 10 + 9);  // bytes of the first key
    CHECK(clause(payload) == "spec/points.md#meta-size");
    put(payload, 8 + 3 * 88 + 4, std::numeric_limits<std::uint32_t>::max());
    CHECK(clause(payload) == "spec/points.md#meta-size");
  }
}

TEST_CASE("meta: as many channels as groups hold are decoded, and one more is refused",
          "[format][meta]") {
  for (const unsigned point_bytes : {34U, 40U}) {
    Meta meta;
    for (unsigned i = 0; i < 255 * point_bytes; ++i) {
      meta.channels.push_back(
          {std::to_string(i), ChannelType::u8, 1, static_cast<std::uint8_t>(1 + i / point_bytes)});
    }
    Bytes payload = encode(meta, point_bytes);
    CHECK(decode(payload, point_bytes).channels == meta.channels);
    payload.insert(payload.end(), payload.begin() + 8, payload.begin() + 8 + 88);
    put(payload, 0, std::uint32_t{255 * point_bytes + 1});
    CHECK(clause(payload, point_bytes) == kChannel);
  }
}

TEST_CASE("meta: the channels of a group take no more bytes than a point", "[format][meta]") {
  for (const std::size_t point_bytes : {std::size_t{34}, std::size_t{40}}) {
    const auto of_bytes = [](std::size_t bytes) {
      Meta meta;
      meta.channels = {{"wide", ChannelType::u64, 4, 9},
                       {"rest", ChannelType::i8, static_cast<std::uint8_t>(bytes - 32), 9},
                       {"other", ChannelType::u8, 1, 10}};
      return meta;
    };
    const Bytes full = encode(of_bytes(point_bytes), point_bytes);
    CHECK(clause(full, point_bytes) == "none");
    CHECK(clause(full, point_bytes - 1) == kChannel);
    CHECK_THROWS_AS(encode(of_bytes(point_bytes + 1), point_bytes), std::invalid_argument);
  }
}

TEST_CASE("meta: channels that break a rule are refused on both sides", "[format][meta]") {
  check_refused(with([](Meta& m) { m.channels[0].name = std::string(""); }));
  check_refused(with([](Meta& m) { m.channels[0].name = std::string(32, 'a'); }));
  check_refused(with([](Meta& m) { m.channels[0].name = std::string("Upper"); }));
  check_refused(with([](Meta& m) { m.channels[0].name = m.channels[1].name; }));
  check_refused(with([](Meta& m) { m.channels[0].type = ChannelType{0}; }));
  check_refused(with([](Meta& m) { m.channels[0].type = ChannelType{12}; }));
  check_refused(with([](Meta& m) { m.channels[0].components = 0; }));
  check_refused(with([](Meta& m) { m.channels[0].components = 17; }));
  check_refused(with([](Meta& m) { m.channels[0].group = 0; }));
  check_refused(with([](Meta& m) { m.channels[0].group = 8; }));
  check_refused(with([](Meta& m) { m.channels[2].components = 9; }));
  check_refused(with([](Meta& m) { m.text["Upper"] = std::string(""); }));
  check_refused(with([](Meta& m) { m.text["nul"] = std::string(1, '\0'); }));
  check_refused(with([](Meta& m) { m.text["utf8"] = std::string("\xff"); }));
  CHECK_NOTHROW(encode(with([](Meta& m) { m.channels[0].name = std::string(31, 'a'); })));

  CHECK(changed(0, 0, 'I') == kChannel);
  CHECK(changed(0, 31, 'x') == kZero);
  CHECK(changed(0, 33, std::uint8_t{0}) == kChannel);
  CHECK(changed(0, 33, std::uint8_t{17}) == kChannel);
  CHECK(changed(0, 34, std::uint8_t{0}) == kChannel);
  CHECK(changed(0, 34, std::uint8_t{8}) == kChannel);  // the next one is of group 1
  Bytes payload = encode(example());
  put(payload, 8 + 3 * 88 + 8, 'z');  // "zource" comes after "unit"
  CHECK(clause(payload) == "spec/points.md#meta-text");
}

TEST_CASE("meta: every type of a channel has its size", "[format][meta]") {
  constexpr std::array<std::size_t, 11> kBytes{1, 2, 2, 4, 4, 8, 1, 2, 4, 8, 8};
  for (std::uint8_t type = 1; type <= 11; ++type) {
    INFO(unsigned{type});
    Meta meta;
    meta.channels = {{"a", static_cast<ChannelType>(type), 2, 1}};
    CHECK(channel_bytes(meta.channels[0].type) == kBytes[type - 1U]);
    CHECK(meta.channels[0].component_bytes() == kBytes[type - 1U]);
    const Bytes payload = encode(meta);
    CHECK(decode(payload).channels == meta.channels);
    for (unsigned size = 0; size < 256; ++size) {
      Bytes other = payload;
      put(other, 8 + 38, static_cast<std::uint8_t>(size));
      CHECK(clause(other) == (size == kBytes[type - 1U] ? "none" : kChannel));
    }
    meta.channels[0].size = kBytes[type - 1U] == 1 ? 2 : 1;
    check_refused(meta);
  }
}

TEST_CASE("meta: a type, role or colour space of a later version is read as bytes",
          "[format][meta]") {
  for (unsigned type = 0; type < 256; ++type) {
    if (type >= 1 && type <= 11) continue;
    for (unsigned size = 0; size < 256; ++size) {
      Meta meta;
      meta.channels = {{"a", ChannelType::u64, 1, 1}};
      Bytes payload = encode(meta);
      put(payload, 8 + 32, static_cast<std::uint8_t>(type));
      put(payload, 8 + 38, static_cast<std::uint8_t>(size));
      const bool allowed = size == 1 || size == 2 || size == 4 || size == 8;
      if (clause(payload) != (allowed ? "none" : kChannel)) FAIL(type << " of " << size);
      if (!allowed) continue;
      const Meta back = decode(payload);
      CHECK(back.channels[0].component_bytes() == size);
      CHECK(group_point_bytes(back.channels, 1) == size);
      CHECK(encode(back) == payload);
    }
  }
  for (unsigned value = 0; value < 256; ++value) {
    const bool three = value == 2 || value == 3;  // the example's second channel has 1 component
    CHECK(changed(1, 35, static_cast<std::uint8_t>(value)) ==
          (three || value == 5 ? kChannel : "none"));
    CHECK(changed(1, 36, static_cast<std::uint8_t>(value)) == "none");
  }
}

TEST_CASE("meta: directions and vectors have 3 components, an index is one u32 or u64",
          "[format][meta]") {
  for (unsigned role = 0; role <= 7; ++role) {
    for (std::uint8_t type = 1; type <= 12; ++type) {
      for (std::uint8_t components = 1; components <= 4; ++components) {
        Meta meta;
        meta.channels = {{"a", static_cast<ChannelType>(type), components, 1}};
        meta.channels[0].role = static_cast<ChannelRole>(role);
        if (type == 12) meta.channels[0].size = 4;
        const bool vector = role == 2 || role == 3;
        const bool allowed = (!vector || components == 3) &&
                             (role != 5 || (components == 1 && (type == 5 || type == 6)));
        INFO(role << " " << unsigned{type} << " " << unsigned{components});
        if (allowed) {
          CHECK(decode(encode(meta)).channels == meta.channels);
        } else {
          check_refused(meta);
        }
      }
    }
  }
  CHECK(changed(1, 35, std::uint8_t{2}) == kChannel);
  CHECK(changed(1, 35, std::uint8_t{3}) == kChannel);
  CHECK(changed(1, 35, std::uint8_t{5}) == kChannel);
  CHECK(changed(0, 35, std::uint8_t{2}) == "none");
}

TEST_CASE("meta: a unit is text of at most 15 bytes", "[format][meta]") {
  for (const char* const unit : {"", "m", "W/(m^2 sr)", "123456789012345"}) {
    const Meta meta = with([&](Meta& m) { m.channels[0].unit = unit; });
    CHECK(decode(encode(meta)).channels == meta.channels);
  }
  check_channel_refused([](Channel& c) { c.unit = std::string(16, 'm'); });
  check_channel_refused([](Channel& c) { c.unit = std::string("\xff"); });
  check_channel_refused([](Channel& c) { c.unit = std::string("m\0m", 3); });
  CHECK(changed(0, 40, '\xff') == kChannel);
  CHECK(changed(0, 40 + 15, 'm') == kZero);  // behind the zeros
  CHECK(changed(0, 40 + 6, 'm') == kZero);
  CHECK(changed(0, 40 + 5, 'm') == "none");
  Bytes payload = encode(example());
  std::fill_n(payload.begin() + 8 + 40, 16, std::byte{'m'});
  CHECK(clause(payload) == kChannel);
}

TEST_CASE("meta: no_value fits the type, and is 0 where it does not hold", "[format][meta]") {
  for (std::uint8_t type = 1; type <= 11; ++type) {
    INFO(unsigned{type});
    Meta meta;
    meta.channels = {{"a", static_cast<ChannelType>(type), 1, 1}};
    const std::size_t bits = 8 * channel_bytes(meta.channels[0].type);
    const std::uint64_t most = ~std::uint64_t{0} >> (64 - bits);
    for (const std::uint64_t value : {std::uint64_t{0}, std::uint64_t{1}, most}) {
      meta.channels[0].no_value = value;
      CHECK(decode(encode(meta)).channels == meta.channels);
    }
    if (bits == 64) continue;
    meta.channels[0].no_value = most + 1;
    check_refused(meta);
    meta.channels[0].no_value = most;
    Bytes payload = encode(meta);
    put(payload, 8 + 56, most + 1);
    CHECK(clause(payload) == kChannel);
    put(payload, 8 + 56, std::uint64_t{1} << 63);
    CHECK(clause(payload) == kChannel);
  }
  CHECK(changed(0, 56, std::uint64_t{1}) == kZero);  // the flag is not set
  CHECK(changed(0, 37, std::uint8_t{1}) == "none");
  for (unsigned flags = 2; flags < 256; ++flags) {
    CHECK(changed(0, 37, static_cast<std::uint8_t>(flags)) == kZero);
  }
  CHECK(changed(1, 37, std::uint8_t{0}) == kZero);  // its value would hold without the flag
}

TEST_CASE("meta: scale and offset are finite, and scale is not 0", "[format][meta]") {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const double bad : {kNan, kInfinity, -kInfinity, 0.0, -0.0}) {
    check_channel_refused([=](Channel& c) { c.scale = bad; });
    CHECK(changed(0, 64, bad) == kChannel);
  }
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    check_channel_refused([=](Channel& c) { c.offset = bad; });
    CHECK(changed(0, 72, bad) == kChannel);
  }
  for (const double good : {-1.0, 5e-324, 1e308}) {
    CHECK(changed(0, 64, good) == "none");
    CHECK(changed(0, 72, good) == "none");
  }
  CHECK(changed(0, 72, 0.0) == "none");
}

TEST_CASE("meta: reserved bytes of a channel are zero", "[format][meta]") {
  CHECK(changed(0, 39, std::uint8_t{1}) == kZero);
  for (std::size_t at = 80; at < 88; ++at) CHECK(changed(0, at, std::uint8_t{1}) == kZero);
}

TEST_CASE("meta: texts that every reader may rely on have one form", "[format][meta]") {
  const auto check = [](const char* key, const char* value, bool allowed) {
    INFO(key << " " << value);
    Meta meta;
    meta.text[key] = value;
    meta.text["other"] = value;  // which has no form
    if (allowed) {
      CHECK(decode(encode(meta)).text == meta.text);
    } else {
      check_refused(meta);
    }
    // The same on the side of the reader: the key is replaced by one that has a form.
    const std::string any(std::string_view(key).size(), 'a');
    meta.text = {{any, value}};
    Bytes payload = encode(meta);
    std::memcpy(payload.data() + 16, key, any.size());
    CHECK(clause(payload) == (allowed ? "none" : kFact));
  };
  for (const char* const good : {"x", "y", "z"}) check("up", good, true);
  for (const char* const bad : {"", "X", "xy", "-z", " y", "w"}) check("up", bad, false);
  constexpr std::array kNumbers{"1",       "0.01", "12.50", "0.3048006096012192", "1e3", "1e+3",
                                "25.4e-3", "0001", "1.0e00"};
  for (const char* const number : kNumbers) {
    check("metres_per_unit", number, true);
    check("time", number, true);
  }
  for (const char* const number : {"0", "-1", "-0.5e2", "0.0", "0e5", "-0"}) {
    check("metres_per_unit", number, false);
    check("time", number, true);
  }
  for (const char* const bad : {"", "-", ".5", "1.", "1.e3", "e3", "1e", "1e+", "+1", " 1", "1 ",
                                "1,5", "0x10", "inf", "nan", "1e3.5", "1.5.2", "--1", "1E3"}) {
    check("metres_per_unit", bad, false);
    check("time", bad, false);
  }
}

TEST_CASE("meta: the bytes of a group per point are those of its channels", "[format][meta]") {
  const Meta meta = example();
  CHECK(group_point_bytes(meta.channels, 1) == 7);
  CHECK(group_point_bytes(meta.channels, 7) == 8);
  CHECK(group_point_bytes(meta.channels, 2) == 0);
  CHECK(channel_bytes(ChannelType::u16) == 2);
  CHECK(channel_bytes(ChannelType{0}) == 0);
  CHECK(channel_bytes(ChannelType{12}) == 0);
  CHECK(channel_groups(meta.channels) == std::vector<std::uint8_t>{1, 7});
  CHECK(channel_groups({}).empty());
}

TEST_CASE("meta: a void page has the value for not known in every channel, or 0",
          "[format][meta]") {
  std::vector<Channel> channels{{"a", ChannelType::u8, 2, 1},
                                {"b", ChannelType::f32, 1, 2},
                                {"c", ChannelType::i16, 3, 2},
                                {"d", ChannelType::u64, 1, 2}};
  channels[1].no_value = 0x7fc00000;
  channels[3].no_value = 0x0123456789abcdef;
  Bytes payload(3 * (4 + 6 + 8), std::byte{0xee});
  fill_void(channels, 2, payload);
  CHECK(is_void(channels, 2, payload));
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(test::get<std::uint32_t>(payload, 4 * i) == 0x7fc00000);
    CHECK(test::get<std::uint64_t>(payload, 30 + 8 * i) == 0x0123456789abcdef);
  }
  CHECK(std::all_of(payload.begin() + 12, payload.begin() + 30,
                    [](std::byte b) { return b == std::byte{0}; }));
  Bytes bytes(10, std::byte{0xee});
  fill_void(channels, 1, bytes);
  CHECK(bytes == Bytes(10));
  CHECK(is_void(channels, 1, bytes));
}

TEST_CASE("meta: a page with one known value is not void", "[format][meta]") {
  std::vector<Channel> channels{{"a", ChannelType::u16, 1, 1}, {"b", ChannelType::u8, 3, 1}};
  channels[0].no_value = 0x1234;
  Bytes payload(4 * (2 + 3));
  fill_void(channels, 1, payload);
  for (std::byte& b : payload) {
    b ^= std::byte{1};
    CHECK_FALSE(is_void(channels, 1, payload));
    b ^= std::byte{1};
  }
  CHECK(is_void(channels, 1, payload));
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
