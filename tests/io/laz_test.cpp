// Clouds from LAZ. Other programs made the compressed bytes of the records of make_records(), so
// that no code of this project has a part in them.
#include <array>
#include <string_view>

#include <catch2/catch.hpp>

#include "engine/io/cloud/formats.h"
#include "engine/io/laz/median.h"
#include "tests/io/files.h"
#include "tests/io/las_files.h"
#include "tests/io/laz_chunks.h"

using namespace ptc;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;
using test::las_fault;
using test::LasCloud;
using test::LasFile;
using test::read_las;

namespace {

// Numbers that look random (a linear congruence modulo 2^32).
class Numbers {
 public:
  int next(int below) {
    state_ = state_ * 1103515245U + 12345U;
    return static_cast<int>(state_ >> 16 & 0x7fff) % below;
  }

 private:
  std::uint32_t state_ = 1;
};

std::string u8(int value) {
  return raw(static_cast<std::uint8_t>(value));
}
std::string u16(int value) {
  return raw(static_cast<std::uint16_t>(value));
}

// Returns a wave packet at `offset`.
std::string make_wave_packet(Numbers& numbers, std::uint64_t offset) {
  std::string out = u8(numbers.next(3)) + raw(offset) + raw(std::uint32_t{256});
  out += raw(static_cast<float>(numbers.next(100)) * 0.5F);
  for (int axis = 0; axis < 3; ++axis) out += raw(static_cast<float>(numbers.next(9)) * 0.25F);
  return out;
}

// Returns `count` records of a format, each with `extra` extra bytes.
std::string make_records(unsigned format, int extra, int count) {
  const bool late = format >= 6;
  Numbers numbers;
  std::int32_t x = 100'000, y = -20'000, z = 500;
  std::int64_t ticks = 4000;
  int channel = 0, nir = 77;
  std::uint64_t offset = 1000;
  std::array<int, 3> rgb = {10, 20, 30};
  std::string out;
  for (int i = 0; i < count; ++i) {
    // Draw the fields, also those that the format does not have.
    const bool jump = numbers.next(13) == 0;
    x += numbers.next(41) - 20;
    y += numbers.next(41) - 20;
    z += numbers.next(9) - 4;
    if (jump) {
      x += 100'000 * (numbers.next(7) - 3);
      y += 70'000 * (numbers.next(7) - 3);
    }
    if (numbers.next(3) == 0) ticks += jump ? 1'000'000'000 : 1 + numbers.next(3);
    const int intensity = numbers.next(4) == 0 ? numbers.next(32768) : 40;
    const int returns = 1 + numbers.next(late ? 15 : 5);
    const int number = 1 + numbers.next(returns);
    const int direction = numbers.next(2);
    const int edge = numbers.next(10) == 0 ? 1 : 0;
    const int classification = numbers.next(5) == 0 ? numbers.next(late ? 200 : 32) : 2;
    const int flags = numbers.next(9) == 0 ? numbers.next(8) : 0;
    if (numbers.next(5) == 0) channel = numbers.next(4);
    const int angle = numbers.next(40) - 20;
    const int user = numbers.next(6) == 0 ? numbers.next(256) : 9;
    const int source = numbers.next(7) == 0 ? numbers.next(5) : 1;
    if (numbers.next(2) == 0) {
      const auto c = static_cast<std::size_t>(numbers.next(3));
      rgb[c] = numbers.next(32768);
    }
    if (numbers.next(6) == 0) rgb.fill(rgb[0]);
    if (numbers.next(3) == 0) nir = numbers.next(32768);
    const int how = numbers.next(4);
    if (how == 1) offset += 256;
    if (how == 2) offset += static_cast<std::uint64_t>(numbers.next(9999));
    if (how == 3) offset += static_cast<std::uint64_t>(numbers.next(9)) << 33;

    // Write the record.
    const double time = static_cast<double>(ticks) * 0.25;
    out += raw(x) + raw(y) + raw(z) + u16(intensity);
    if (late) {
      out += u8(number | returns << 4) + u8(flags | channel << 4 | direction << 6 | edge << 7) +
             u8(classification) + u8(user) + u16(angle * 100) + u16(source) + raw(time);
    } else {
      out += u8(number | returns << 3 | direction << 6 | edge << 7) +
             u8(classification | flags << 5) + u8(angle) + u8(user) + u16(source);
      if (format != 0 && format != 2) out += raw(time);
    }
    if (format == 2 || format == 3 || format == 5 || format == 7 || format == 8 || format == 10)
      out += u16(rgb[0]) + u16(rgb[1]) + u16(rgb[2]);
    if (format == 8 || format == 10) out += u16(nir);
    if (format == 4 || format == 5 || format == 9 || format == 10)
      out += make_wave_packet(numbers, offset);
    for (int k = 0; k < extra; ++k) out += u8(numbers.next(4));
  }
  return out;
}

struct Item {
  int type, bytes, version;
};

// Returns the record "laszip encoded".
std::string laszip(int compressor, std::uint32_t chunk_points, const std::vector<Item>& items) {
  std::string out = u16(compressor) + u16(0) + u8(3) + u8(4) + u16(1) + raw(0U) +
                    raw(chunk_points) + raw(std::int64_t{-1}) + raw(std::int64_t{-1}) +
                    u16(static_cast<int>(items.size()));
  for (const Item& item : items) out += u16(item.type) + u16(item.bytes) + u16(item.version);
  return test::las_vlr("laszip encoded", 22204, out);
}

constexpr std::uint32_t kVariable = 0xffffffffU;
const std::vector<Item> kItems3 = {{6, 20, 2}, {7, 8, 2}, {8, 6, 2}, {0, 2, 2}};
const std::vector<Item> kItems5 = {{6, 20, 2}, {7, 8, 2}, {8, 6, 2}, {9, 29, 2}};
const std::vector<Item> kItems8 = {{10, 30, 3}, {12, 8, 3}, {14, 2, 3}};
const std::vector<Item> kItems10 = {{10, 30, 3}, {12, 8, 3}, {13, 29, 3}, {14, 2, 3}};

std::string from_hexadecimal(std::string_view text) {
  std::string bytes;
  const auto digit = [](char c) { return c <= '9' ? c - '0' : c - 'a' + 10; };
  for (std::size_t i = 0; i < text.size(); i += 2)
    bytes += static_cast<char>(digit(text[i]) << 4 | digit(text[i + 1]));
  return bytes;
}

// A LAZ file of compressed points. `chunks` begins with the place of the chunk table in it.
LasFile laz_file(unsigned format, unsigned record_bytes, std::uint64_t points,
                 const std::string& record, std::string_view chunks) {
  LasFile file;
  file.minor = format >= 6 ? 4 : 3;
  file.format = format | 0x80;
  file.record_bytes = record_bytes;
  file.points = points;
  file.vlrs = {record};
  std::string bytes = from_hexadecimal(chunks);
  std::uint64_t table = 0;
  std::memcpy(&table, bytes.data(), 8);
  table += (format >= 6 ? 375 : 235) + record.size();
  file.records = raw(table) + bytes.substr(8);
  return file;
}

LasFile file3() {
  return laz_file(3, 36, 40, laszip(2, 50'000, kItems3), test::kFormat3);
}
LasFile file5() {
  return laz_file(5, 63, 30, laszip(2, kVariable, kItems5), test::kFormat5);
}
LasFile file8() {
  return laz_file(8, 40, 45, laszip(3, kVariable, kItems8), test::kFormat8);
}
LasFile file10() {
  return laz_file(10, 69, 30, laszip(3, 50'000, kItems10), test::kFormat10);
}

// Checks that a compressed file is read as an uncompressed one of the records of make_records().
void check_same(const test::TemporaryDirectory& scratch, const LasFile& file) {
  LasFile plain = file;
  plain.format = file.format & 0x7f;
  plain.vlrs.clear();
  constexpr std::array<int, 11> kBytes = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
  const int extra = static_cast<int>(file.record_bytes) - kBytes[plain.format];
  plain.records = make_records(plain.format, extra, static_cast<int>(file.points));
  const LasCloud expected = read_las(scratch, plain.bytes());
  const LasCloud found = read_las(scratch, file.bytes());
  REQUIRE(expected.surfels.size() == file.points);
  REQUIRE(found.surfels.size() == file.points);
  for (std::size_t i = 0; i < file.points; ++i) {
    CHECK(found.surfels[i].position == expected.surfels[i].position);
    CHECK(found.surfels[i].albedo == expected.surfels[i].albedo);
  }
  CHECK((found.rows == expected.rows));  // bytes would be no help
}

}  // namespace

TEST_CASE("laz: a chunk of points with time, colour and extra bytes is decoded", "[io][laz]") {
  const test::TemporaryDirectory scratch;
  check_same(scratch, file3());
}

TEST_CASE("laz: chunks of different sizes with wave packets are decoded in order", "[io][laz]") {
  const test::TemporaryDirectory scratch;
  check_same(scratch, file5());
}

TEST_CASE("laz: layered chunks with several scanner channels are decoded", "[io][laz]") {
  const test::TemporaryDirectory scratch;
  check_same(scratch, file8());
  check_same(scratch, file10());
}

TEST_CASE("laz: one stream of all points without a chunk table is decoded", "[io][laz]") {
  const test::TemporaryDirectory scratch;
  LasFile file = file3();
  file.vlrs = {laszip(1, 0, kItems3)};
  file.records = file.records.substr(8);
  check_same(scratch, file);
}

TEST_CASE("laz: the place of the chunk table may stand at the end of the file", "[io][laz]") {
  const test::TemporaryDirectory scratch;
  for (LasFile file : {file3(), file5(), file8(), file10()}) {
    file.records += file.records.substr(0, 8);
    file.records.replace(0, 8, std::string(8, '\xff'));
    check_same(scratch, file);
  }
}

TEST_CASE("laz: a file is compressed when it has a laszip record, even if its format hides it",
          "[io][laz]") {
  const test::TemporaryDirectory scratch;
  LasFile file = file3();
  file.format &= 0x7f;
  check_same(scratch, file);
}

TEST_CASE("laz: a file of no points needs no chunks", "[io][laz]") {
  const test::TemporaryDirectory scratch;
  LasFile file = file3();
  file.points = 0;
  file.records.clear();
  CHECK(read_las(scratch, file.bytes()).surfels.empty());
}

TEST_CASE("laz: every proper prefix of a file is refused", "[io][laz]") {
  const test::TemporaryDirectory scratch;
  for (const LasFile& file : {file3(), file5(), file8(), file10()}) {
    const std::string whole = file.bytes();
    CHECK(las_fault(scratch, whole).empty());
    for (std::size_t size = 0; size < whole.size(); ++size) {
      const std::string text = las_fault(scratch, whole.substr(0, size));
      INFO(size << " of " << whole.size());
      CHECK_THAT(text, Catch::StartsWith("offset "));
    }
  }
}

TEST_CASE("laz: a file with any bit of its points flipped is refused or has as many points",
          "[io][laz]") {
  const test::TemporaryDirectory scratch;
  std::size_t refused = 0, read = 0;
  for (const LasFile& file : {file3(), file5(), file8(), file10()}) {
    const std::string whole = file.bytes();
    for (std::size_t at = whole.size() - file.records.size(); at < whole.size(); ++at) {
      std::string damaged = whole;
      damaged[at] = static_cast<char>(damaged[at] ^ 1 << at % 8);
      const auto path = scratch.file("a.laz", damaged);
      std::size_t points = 0;
      const std::string text = refusal([&] { points = read_las(path).surfels.size(); });
      ++(text.empty() ? read : refused);
      if (text.empty()) CHECK(points == file.points);
    }
  }
  CHECK(refused > 100);
  CHECK(read > 100);
}

TEST_CASE("laz: laszip records that are not supported or do not fit are refused by name",
          "[io][laz]") {
  const test::TemporaryDirectory scratch;
  const auto with = [&](const std::string& record) {
    LasFile file = file3();
    file.vlrs = {record};
    return las_fault(scratch, file.bytes());
  };
  CHECK(with(laszip(0, 50'000, kItems3)) == "offset 235: compressor 0 is not supported");
  CHECK(with(laszip(4, 50'000, kItems3)) == "offset 235: compressor 4 is not supported");
  CHECK(with(laszip(3, 50'000, kItems3)) ==
        "offset 235: compressor 3 for point format 3 is not supported");
  CHECK(with(laszip(2, 0, kItems3)) == "offset 235: the laszip record has chunks of no points");
  std::vector<Item> items = kItems3;
  items[0].version = 1;
  CHECK(with(laszip(2, 50'000, items)) == "offset 235: item POINT10 of version 1 is not supported");
  items = kItems3;
  items[3].version = 1;
  CHECK(with(laszip(2, 50'000, items)) == "offset 235: item BYTE of version 1 is not supported");
  items = kItems3;
  items[2].type = 11;
  CHECK(with(laszip(2, 50'000, items)) ==
        "offset 235: the laszip record has item RGB14 of 6 bytes where point format 3 needs RGB12 "
        "of 6");
  items[2] = {8, 7, 2};
  CHECK_THAT(with(laszip(2, 50'000, items)), Contains("item RGB12 of 7 bytes where"));
  items.pop_back();
  CHECK_THAT(with(laszip(2, 50'000, items)),
             EndsWith("does not have the items of point format 3 and its extra bytes"));
  const std::string record = laszip(2, 50'000, kItems3);
  const std::string payload = record.substr(54);
  for (std::size_t size = 1; size < payload.size(); ++size) {
    CHECK_THAT(with(test::las_vlr("laszip encoded", 22204, payload.substr(0, size))),
               Contains("too short"));
  }
  std::string coder = record;
  coder[54 + 2] = 1;
  CHECK(with(coder) == "offset 235: coder 1 is not supported");

  LasFile mixed = file10();
  items = kItems10;
  items[1].version = 4;
  mixed.vlrs = {laszip(3, 50'000, items)};
  CHECK(las_fault(scratch, mixed.bytes()) ==
        "offset 375: item RGBNIR14 of version 4 is not supported");
}

TEST_CASE("laz: chunk tables that do not fit the file are refused", "[io][laz]") {
  const test::TemporaryDirectory scratch;
  LasFile file = file3();
  const std::string whole = file.bytes();
  const std::size_t first = whole.size() - file.records.size();
  std::uint64_t table = 0;
  std::memcpy(&table, file.records.data(), 8);
  const auto changed = [&](std::size_t at, const std::string& by) {
    std::string bytes = whole;
    return las_fault(scratch, bytes.replace(at, by.size(), by));
  };
  for (const std::uint64_t bad :
       {std::uint64_t{0}, std::uint64_t{first + 7}, whole.size() + 1, ~std::uint64_t{0} - 1}) {
    CHECK_THAT(changed(first, raw(bad)), Contains("the chunk table is not in the file"));
  }
  CHECK_THAT(changed(first, raw(std::uint64_t{whole.size()})),
             EndsWith("the chunk table is cut off"));
  CHECK_THAT(changed(first, raw(std::uint64_t{table - 1})), !Catch::Equals(""));
  CHECK_THAT(changed(table, raw(1U)), EndsWith("the version of the chunk table is not 0"));
  CHECK_THAT(changed(table + 4, raw(2U)),
             EndsWith("the chunk table has 2 chunks, but 40 points make 1"));
  CHECK_THAT(changed(table + 4, raw(0xffffffffU)),
             EndsWith("the chunk table has more chunks than the file can hold"));
  LasFile gap = file;
  gap.records = raw(table + 1) + file.records.substr(8);
  gap.records.insert(gap.records.size() - (whole.size() - table), 1, 'x');
  CHECK_THAT(las_fault(scratch, gap.bytes()),
             EndsWith("the chunks do not end where the chunk table begins"));
  file.points = 41;
  CHECK_THAT(las_fault(scratch, file.bytes()),
             EndsWith("the compressed points are damaged or end too early"));
  file.points = 39;
  CHECK_THAT(las_fault(scratch, file.bytes()),
             EndsWith("the chunk has more bytes than its points take"));
  file.points = 50'001;
  CHECK_THAT(las_fault(scratch, file.bytes()), EndsWith("1 chunks, but 50001 points make 2"));

  for (const std::uint64_t points : {std::uint64_t{44}, std::uint64_t{46}}) {
    LasFile varied = file8();
    varied.points = points;
    CHECK_THAT(las_fault(scratch, varied.bytes()), Contains("points"));
  }
}

TEST_CASE("laz: the sum of bytes and points of a hostile file takes no memory or time",
          "[io][laz]") {
  const test::TemporaryDirectory scratch;
  LasFile file = file3();
  file.points = (1U << 24) + 1;
  file.vlrs = {laszip(2, 1U << 31, kItems3)};
  CHECK_THAT(las_fault(scratch, file.bytes()), EndsWith("points, which is more than 2^24"));
  file.points = 1U << 24;  // a large chunk, decoded in pieces
  CHECK_THAT(las_fault(scratch, file.bytes()),
             EndsWith("the compressed points are damaged or end too early"));
  file.vlrs = {laszip(1, 0, kItems3)};
  file.points = (1U << 24) + 1;
  CHECK_THAT(las_fault(scratch, file.bytes()),
             EndsWith("more than 2^24 points in one stream are not supported"));
}

TEST_CASE("laz: recent values keep the median that their rule gives", "[io][laz]") {
  // The rule on a sorted list: a value replaces the highest of five until one is not below the
  // median, then the lowest until one is not above it.
  laz::RecentValues values;
  std::vector<std::int32_t> list(5, 0);
  bool replaces_highest = true;
  Numbers numbers;
  for (int i = 0; i < 2000; ++i) {
    const std::int32_t value = numbers.next(100) - 50;
    const std::int32_t median = list[2];
    list.erase(replaces_highest ? list.end() - 1 : list.begin());
    list.insert(std::ranges::upper_bound(list, value), value);
    if (replaces_highest ? value >= median : value <= median) replaces_highest = !replaces_highest;
    values.add(value);
    REQUIRE(values.median() == list[2]);
  }
}
