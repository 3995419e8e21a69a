// E57 files that break a rule are refused.
#include <limits>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/formats.h"
#include "fuzz/seal_e57.h"
#include "tests/io/e57_file.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::Contains;
using test::Cloud;
using test::e57_bits;
using test::e57_field;
using test::e57_packet;
using test::E57File;

namespace {

const std::string kXyz = test::e57_xyz();
const std::string kRow = e57_field("rowIndex", "Integer minimum=\"1\" maximum=\"6\"");

// A packet of three points with rows 2, 3 and 6.
std::string good_packet() {
  const std::string x = raw(1.0) + raw(2.0) + raw(3.0);
  return e57_packet({x, x, x, e57_bits({1, 2, 5}, 3)});
}

// Returns a file of two pages of 1024 bytes, or of smaller pages.
std::string small_file(std::size_t page) {
  E57File file(page);
  file.root("<!--" + std::string(700, 'x') + "-->").scan(kXyz + kRow, 3, good_packet());
  return file.bytes();
}

// Returns the message with which the reader refuses a file, without its path.
std::string fault(const test::TemporaryDirectory& scratch, const std::string& bytes) {
  const auto path = scratch.file("bad.e57", bytes);
  std::string text = refusal([&] { static_cast<void>(test::read_e57(path)); });
  const std::string prefix = path.string() + ": ";
  if (text.rfind(prefix, 0) == 0) text.erase(0, prefix.size());
  return text;
}

// Returns the message for a scan of three points.
std::string scan_fault(const test::TemporaryDirectory& scratch, const std::string& fields,
                       std::uint64_t records, const std::string& packets,
                       const std::string& more = {}) {
  E57File file;
  file.scan(fields, records, packets, more);
  return fault(scratch, file.bytes());
}

// Returns a file whose pages hold a changed sequence of logical bytes.
std::string replaced(const std::string& file, std::size_t at, const std::string& bytes) {
  std::string logical = test::e57_logical(file, 1024);
  logical.replace(at, bytes.size(), bytes);
  return test::e57_pages(logical, 1024);
}

// Returns the name of a field.
std::string numbered(int i) {
  std::string name(1, 'a');
  return name += std::to_string(i);
}

bool same(const Cloud& a, const Cloud& b) {
  if (a.surfels.size() != b.surfels.size() || a.rows != b.rows) return false;
  for (std::size_t i = 0; i < a.surfels.size(); ++i) {
    if (a.surfels[i].position != b.surfels[i].position) return false;
  }
  return true;
}

}  // namespace

TEST_CASE("e57: every truncation of a file is refused", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  for (const std::size_t page : {64UL, 1024UL}) {
    const std::string whole = small_file(page);
    CHECK(fault(scratch, whole).empty());
    for (std::size_t size = 0; size < whole.size(); ++size) {
      if (fault(scratch, whole.substr(0, size)).empty()) FAIL(size << " of " << whole.size());
    }
    CHECK_FALSE(fault(scratch, whole + 'x').empty());
    CHECK_FALSE(fault(scratch, whole + std::string(page, '\0')).empty());
  }
}

TEST_CASE("e57: every flipped bit of a file is refused or changes no point", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const std::string whole = small_file(1024);
  const Cloud right = test::read_e57(scratch.file("a.e57", whole));
  std::size_t refused = 0;
  for (std::size_t bit = 0; bit < 8 * whole.size(); ++bit) {
    std::string damaged = whole;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ 1 << bit % 8);
    const auto path = scratch.file("bad.e57", damaged);
    try {
      if (!same(test::read_e57(path), right)) FAIL("bit " << bit);
    } catch (const DataError&) {
      ++refused;
    }
  }
  CHECK(refused == 8 * whole.size());  // each page of this file is read
}

TEST_CASE("e57: with its checksums repaired, a file with any other byte is read or refused",
          "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const std::string whole = small_file(1024);
  std::size_t refused = 0;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const int change : {1, 2, 0x10, 0x80, 0xff}) {
      std::string damaged = whole;
      damaged[at] = static_cast<char>(damaged[at] ^ change);
      fuzz::seal_e57(std::as_writable_bytes(std::span(damaged)));
      const std::string text = fault(scratch, damaged);
      if (!text.empty()) {
        ++refused;
        if (text.rfind("offset ", 0) != 0) FAIL(text);
      }
    }
  }
  CHECK(refused > 1000);
}

TEST_CASE("e57: repaired checksums are those of the file that was written", "[io][e57]") {
  for (const std::size_t page : {64UL, 1024UL}) {
    const std::string whole = small_file(page);
    std::string damaged = whole;
    for (std::size_t at = page - 4; at < whole.size(); at += page) {
      damaged.replace(at, 4, "oops");
    }
    damaged[16] = 'x';
    CHECK(damaged != whole);
    fuzz::seal_e57(std::as_writable_bytes(std::span(damaged)));
    CHECK(damaged == whole);
  }
}

TEST_CASE("e57: headers that break a rule are refused", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const std::string good = small_file(1024);
  CHECK(fault(scratch, "") == "offset 0: not an E57 file");
  CHECK(fault(scratch, "ASTM-E58" + good.substr(8)) == "offset 0: not an E57 file");
  CHECK(fault(scratch, "ASTM-E57") == "offset 0: the E57 header has fewer than 48 bytes");
  CHECK(fault(scratch, replaced(good, 8, raw(2U))) == "offset 8: the E57 version is not 1");
  CHECK(fault(scratch, replaced(good, 16, raw(std::uint64_t{1024}))) ==
        "offset 16: the file has 2048 bytes, but its header says 1024");
  for (const std::uint64_t page : {0ULL, 32ULL, 1000ULL, 1ULL << 21, 1ULL << 63}) {
    CHECK(fault(scratch, replaced(good, 40, raw(page))) ==
          "offset 40: the page size is not a power of two from 64 to 1048576");
  }
  CHECK(fault(scratch, replaced(good, 40, raw(std::uint64_t{512}))) ==
        "offset 0: the checksum of the page is wrong");
  CHECK(fault(scratch, replaced(good, 40, raw(std::uint64_t{4096}))) ==
        "offset 16: the file does not end with a whole page");
  CHECK(fault(scratch, replaced(good, 24, raw(std::uint64_t{2048}))) ==
        "offset 24: the XML section begins behind the end of the file");
  CHECK(fault(scratch, replaced(good, 24, raw(~std::uint64_t{0}))) ==
        "offset 24: the XML section begins behind the end of the file");
  CHECK(fault(scratch, replaced(good, 24, raw(std::uint64_t{1021}))) ==
        "offset 24: the XML section begins inside a checksum");
  for (const std::uint64_t bytes : {std::uint64_t{2040}, ~std::uint64_t{0}}) {
    CHECK(fault(scratch, replaced(good, 32, raw(bytes))) ==
          "offset 32: the XML section goes on behind the end of the file");
  }
  std::string last = good;
  last[1500] ^= 1;
  CHECK(fault(scratch, last) == "offset 1024: the checksum of the page is wrong");
}

TEST_CASE("e57: sections and packets that break a rule are refused", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const std::string good = small_file(1024);
  constexpr std::size_t kSection = 48;
  constexpr std::size_t kPacket = 80;
  const auto changed = [&](std::size_t at, const std::string& bytes) {
    return fault(scratch, replaced(good, at, bytes));
  };
  CHECK(changed(kSection, "\x02") == "offset 48: no CompressedVector section begins here");
  for (const std::uint64_t bytes : {std::uint64_t{31}, std::uint64_t{1993}, ~std::uint64_t{0}}) {
    CHECK(changed(kSection + 8, raw(bytes)) ==
          "offset 56: the section's length does not fit in the file");
  }
  CHECK(changed(kSection + 16, raw(std::uint64_t{79})) ==
        "offset 64: the first packet is not inside its section");
  CHECK(changed(kSection + 16, raw(std::uint64_t{1500})) ==
        "offset 64: the first packet is not inside its section");
  CHECK(changed(kSection + 16, raw(std::uint64_t{2048})) ==
        "offset 64: the first packet of a section begins behind the end of the file");
  CHECK(changed(kPacket, "\x03") == "offset 80: a packet has the unknown type 3");
  CHECK(changed(kPacket + 2, raw(std::uint16_t{90})) ==
        "offset 80: the length of a packet is no multiple of 4");
  CHECK(changed(kPacket + 2, raw(std::uint16_t{0xffff})) ==
        "offset 80: a packet goes on behind the end of its section");
  CHECK(changed(kPacket + 2, raw(std::uint16_t{3})) ==
        "offset 80: a data packet is shorter than its header");
  CHECK(changed(kPacket + 2, raw(std::uint16_t{11})) ==
        "offset 80: a data packet is shorter than its header");
  CHECK(changed(kPacket + 4, raw(std::uint16_t{3})) ==
        "offset 80: a packet has 3 bytestreams, but the scan 4 fields");
  CHECK(changed(kPacket + 6, raw(std::uint16_t{100})) ==
        "offset 80: a bytestream goes on behind its packet");
  CHECK(changed(kPacket, std::string(1, '\2')) ==
        "offset 168: the section ends before record 0 of 3");
  CHECK(changed(kPacket + 14 + 72, "\x3f") ==
        "offset 80: record 0: field 'rowIndex' is above its maximum");
  const std::string infinite = raw(std::numeric_limits<double>::infinity());
  CHECK(changed(kPacket + 14 + 8, infinite) ==
        "offset 80: scan 0, point 1: the position is not finite");
}

TEST_CASE("e57: every truncation of the packets is refused", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const std::string packets = good_packet();
  for (std::size_t size = 0; size < packets.size(); ++size) {
    E57File file;
    file.scan(kXyz + kRow, 3, packets.substr(0, size));
    if (fault(scratch, file.bytes()).empty()) FAIL(size << " of " << packets.size());
  }
}

TEST_CASE("e57: counts that a section cannot hold are refused when the file is opened",
          "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const auto opened = [&](const std::string& fields, std::uint64_t records,
                          const std::string& packets) {
    const auto path = scratch.file("a.e57", E57File().scan(fields, records, packets).bytes());
    return refusal([&] { static_cast<void>(open_e57(path)); });
  };
  CHECK(opened(kXyz + kRow, 3, good_packet()).empty());  // 88 bytes hold 3 records of 195 bits
  CHECK_THAT(opened(kXyz + kRow, 4, good_packet()),
             Contains("offset 48: the scan has 4 records, more than its section can hold"));
  CHECK_THAT(opened(kXyz + kRow, std::uint64_t{1} << 62, good_packet()),
             Contains("the scan has 4611686018427387904 records, more than its section can hold"));
  CHECK_THAT(opened(kXyz + kRow, std::uint64_t{1} << 63, good_packet()),
             Contains("'recordCount' of 'points' is not an integer"));
  std::string constant;
  for (const std::string name : {"cartesianX", "cartesianY", "cartesianZ"}) {
    constant += e57_field(name, "Integer minimum=\"3\" maximum=\"3\"");
  }
  CHECK(scan_fault(scratch, constant, 65536, "").empty());
  CHECK_THAT(opened(constant, 65537, ""), Contains("the scan has 65537 records"));
}

TEST_CASE("e57: scans that share a section cannot have more records than the file", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const std::string x = std::string(5120, 'x');  // 640 doubles
  const auto shared = [&](int scans) {
    E57File file;
    const std::uint64_t offset = file.section(e57_packet({x, x, x}));
    for (int i = 0; i < scans; ++i) {
      file.data3d("<vectorChild><points type=\"CompressedVector\" fileOffset=\"" +
                  std::to_string(offset) + "\" recordCount=\"640\"><prototype>" + kXyz +
                  "</prototype></points></vectorChild>");
    }
    return fault(scratch, file.bytes());
  };
  CHECK(shared(1).empty());
  CHECK_THAT(shared(2), Contains("the scans have more records than the file can hold"));
}

TEST_CASE("e57: bytestreams that run far ahead of others are refused", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  std::string packets;
  for (int i = 0; i < 260; ++i) packets += e57_packet({std::string(65000, 'x'), "", ""});
  CHECK_THAT(scan_fault(scratch, kXyz, 1000, packets),
             Contains("more than 16 MiB ahead of others"));
}

TEST_CASE("e57: XML that breaks a rule is refused", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const auto field = [&](const std::string& xml) {
    return scan_fault(scratch, kXyz + xml, 3, good_packet());
  };
  const auto with = [&](const std::string& more) {
    return scan_fault(scratch, kXyz + kRow, 3, good_packet(), more);
  };
  const auto scan = [&](const std::string& xml) {
    return fault(scratch, E57File().data3d("<vectorChild>" + xml + "</vectorChild>").bytes());
  };
  // Fields.
  CHECK_THAT(field(e57_field("a", "Integer minimum=\"1\" maximum=\"0\"")),
             Contains("the minimum of field 'a' is above its maximum"));
  CHECK_THAT(field(e57_field("a", "Integer minimum=\"x\"")),
             Contains("'minimum' of 'a' is not an integer"));
  CHECK_THAT(field(e57_field("a", "Integer maximum=\"9223372036854775808\"")),
             Contains("'maximum' of 'a' is not an integer"));
  CHECK_THAT(field(e57_field("a", "ScaledInteger scale=\"0\"")),
             Contains("the scale of field 'a' is 0"));
  CHECK_THAT(field(e57_field("a", "ScaledInteger scale=\"nan\"")),
             Contains("'scale' is not a finite number"));
  CHECK_THAT(field(e57_field("a", "ScaledInteger offset=\"1e999\"")),
             Contains("'offset' is not a finite number"));
  CHECK_THAT(field(e57_field("a", "Float precision=\"half\"")),
             Contains("the precision of field 'a' is not known"));
  CHECK_THAT(field(e57_field("a", "Blob")),
             Contains("field 'a' has the type 'Blob', which is not supported"));
  CHECK_THAT(field(e57_field("cartesianX", "Float")),
             Contains("two fields have the name 'cartesianX'"));
  std::string many;
  for (int i = 0; i < 254; ++i) many += e57_field(numbered(i), "Float");
  CHECK_THAT(field(many), Contains("a scan has more than 256 fields"));
  CHECK_THAT(
      scan_fault(scratch, e57_field("cartesianX", "Float") + e57_field("cartesianY", "Float"), 1,
                 good_packet()),
      Contains("scan 0 has neither Cartesian nor spherical coordinates"));

  // Scans.
  CHECK_THAT(with("<pose><rotation><w/></rotation></pose>"),
             Contains("the quaternion of a rotation is 0"));
  CHECK_THAT(with("<pose><translation><x>a</x></translation></pose>"),
             Contains("'x' is not a finite number"));
  CHECK(with("<pose><rotation/><translation/></pose>").empty());
  CHECK_THAT(scan("<points type=\"Vector\"/>"),
             Contains("the points of a scan are no CompressedVector"));
  CHECK_THAT(scan("<points type=\"CompressedVector\"/>"),
             Contains("'recordCount' of 'points' is not an integer"));
  CHECK_THAT(scan("<points type=\"CompressedVector\" recordCount=\"-1\"/>"),
             Contains("'recordCount' is negative"));
  CHECK_THAT(scan("<points type=\"CompressedVector\" recordCount=\"1\"/>"),
             Contains("'fileOffset' of 'points' is not an integer"));
  CHECK_THAT(scan("<points type=\"CompressedVector\" recordCount=\"0\"/>"),
             Contains("have no prototype"));
  const auto codec = [&](const std::string& name) {
    return scan(
        "<points type=\"CompressedVector\" "
        "recordCount=\"0\"><prototype/><codecs><vectorChild><inputs/><" +
        name + "/></vectorChild></codecs></points>");
  };
  CHECK(codec("bitPackCodec").empty());
  CHECK_THAT(codec("zlibCodec"), Contains("the codec 'zlibCodec' is not supported"));
  CHECK_THAT(
      scan("<points type=\"CompressedVector\" fileOffset=\"99999\" recordCount=\"1\"><prototype>" +
           kXyz + "</prototype></points>"),
      Contains("the section of a scan begins behind the end of the file"));
  CHECK(scan("").empty());

  // The document.
  CHECK_THAT(fault(scratch, E57File().root("<a>").bytes()),
             Contains("the XML is not well-formed: "));
  std::string other = test::e57_logical(small_file(1024), 1024);
  for (std::size_t at = other.find("e57Root"); at != std::string::npos;
       at = other.find("e57Root", at)) {
    other.replace(at, 7, "e58Root");
  }
  CHECK_THAT(fault(scratch, test::e57_pages(other, 1024)), Contains("the XML has no e57Root"));
}

TEST_CASE("e57: XML that is long or nested deep is refused", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const auto nested = [](std::size_t depth) {
    std::string xml;
    for (std::size_t i = 0; i < depth; ++i) xml += "<a>";
    for (std::size_t i = 0; i < depth; ++i) xml += "</a>";
    return E57File().root(xml).bytes();
  };
  CHECK(fault(scratch, nested(63)).empty());  // below e57Root
  for (const std::size_t depth : {64UL, 65UL, 1'000'000UL}) {
    CHECK_THAT(fault(scratch, nested(depth)), Contains("the XML is nested more than 64 deep"));
  }
  CHECK_THAT(fault(scratch, E57File().root(std::string(1 << 24, ' ')).bytes()),
             Contains("the XML section has more than 16 MiB"));
}

TEST_CASE("e57: scans may have 254 different fields beside the surfel, not more", "[io][e57]") {
  const test::TemporaryDirectory scratch;
  const auto names = [](int first, int count) {
    std::string xml = kXyz;
    for (int i = first; i < first + count; ++i) {
      xml += e57_field(numbered(i), "Integer minimum=\"0\" maximum=\"0\"");
    }
    return xml;
  };
  const auto packet = [](std::size_t fields) {
    std::vector<std::string> streams(fields + 3);
    for (std::size_t axis = 0; axis < 3; ++axis) streams[axis] = raw(1.0);
    return e57_packet(streams);
  };
  for (const int second : {127, 128}) {
    E57File file;
    file.scan(names(0, 127), 1, packet(127));
    file.scan(names(127, second), 1, packet(static_cast<std::size_t>(second)));
    const std::string text = fault(scratch, file.bytes());
    if (second == 127) CHECK(text.empty());
    if (second == 128) CHECK_THAT(text, Contains("the scans have more than 254 different fields"));
  }
}
