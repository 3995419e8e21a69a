// Bytes that changed after the file was written: damage is found, or what is read is what was
// written.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "format/checksum.h"
#include "format/error.h"
#include "tests/store/forge.h"
#include "tests/store/sample.h"

using namespace ptc;
using namespace ptc::test;

namespace {

/// The smallest scene has one page of points, one of nodes in the tail, and the meta page.
SampleOptions tiny() {
  SampleOptions options;
  options.points = 3;
  options.attribute_groups = 0;
  return options;
}

/// A file that is damaged in place.
class Patient {
 public:
  explicit Patient(const std::filesystem::path& path)
      : fd_(::open(path.c_str(), O_RDWR)), bytes_(read_file(path)) {
    REQUIRE(fd_ >= 0);
  }
  ~Patient() { ::close(fd_); }
  Patient(const Patient&) = delete;
  Patient& operator=(const Patient&) = delete;

  [[nodiscard]] const std::vector<std::byte>& bytes() const { return bytes_; }
  void put(std::size_t at, std::byte value) {
    REQUIRE(::pwrite(fd_, &value, 1, static_cast<off_t>(at)) == 1);
  }
  void flip(std::size_t at) { put(at, bytes_[at] ^ std::byte(1u << at % 8)); }
  void restore(std::size_t at) { put(at, bytes_[at]); }
  void resize(std::size_t bytes) { REQUIRE(::ftruncate(fd_, static_cast<off_t>(bytes)) == 0); }

 private:
  int fd_;
  std::vector<std::byte> bytes_;
};

/// Returns the text of the error that reading everything throws; nothing when it throws none.
std::optional<std::string> refusal(const std::filesystem::path& path) {
  try {
    static_cast<void>(walk(path));
    return std::nullopt;
  } catch (const FormatError& error) {
    return error.what();
  }
}

/// Returns the bytes that a reader may ignore: padding after pages, and the superblocks, of which
/// there are two.
std::vector<bool> ignorable(const std::filesystem::path& path) {
  const Forgery parts(path);
  std::vector<bool> may(parts.superblock.file_bytes, false);
  const auto allow = [&](std::uint64_t from, std::uint64_t to) {
    std::fill(may.begin() + static_cast<std::ptrdiff_t>(from),
              may.begin() + static_cast<std::ptrdiff_t>(to), true);
  };
  std::uint64_t body = 0, tail = 0;
  for (const DirectoryEntry& entry : parts.entries) {
    const std::uint64_t end = entry.offset + 64 + entry.stored_bytes;
    allow(end, round_up(end, kSectorBytes));
    (entry.offset < parts.superblock.directory_offset ? body : tail) = end;
  }
  const std::uint64_t directory = parts.superblock.directory_offset;
  allow(body, directory);
  allow(directory + 64 + parts.directory[0].stored_bytes, parts.superblock.tail_offset);
  allow(tail, may.size());  // and the two superblocks
  return may;
}

}  // namespace

TEST_CASE("reader: a flipped bit in any byte is refused or changes nothing", "[store][damage]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  write_sample(path, tiny());
  const std::vector<std::byte> content = walk(path);
  const std::vector<bool> may_ignore = ignorable(path);
  Patient file(path);
  std::size_t wrongly_taken = 0;
  std::size_t wrongly_refused = 0;
  std::size_t changed = 0;
  for (std::size_t at = 0; at < file.bytes().size(); ++at) {
    file.flip(at);
    try {
      if (walk(path) != content) ++changed;
      if (!may_ignore[at]) ++wrongly_taken;
    } catch (const FormatError&) {
      if (may_ignore[at]) ++wrongly_refused;
    }
    file.restore(at);
  }
  CHECK(changed == 0);
  CHECK(wrongly_taken == 0);
  CHECK(wrongly_refused == 0);
  CHECK(refusal(path) == std::nullopt);
}

TEST_CASE("reader: every proper prefix is refused with the reason", "[store][damage]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  write_sample(path, tiny());
  Patient file(path);
  const std::size_t length = file.bytes().size();
  std::size_t taken = 0;
  std::size_t misnamed = 0;
  for (std::size_t bytes = length; bytes-- > 0;) {
    file.resize(bytes);
    const std::optional<std::string> text = refusal(path);
    if (!text) {
      ++taken;
      continue;
    }
    const std::string expected =
        bytes >= length - kBlockBytes  // the first superblock is whole
            ? std::to_string(length - bytes) + " bytes shorter than its superblock says"
            : bytes >= kBlockBytes ? "unfinished or truncated"
              : bytes >= 8         ? "file ends in its header"
                                   : "not a PTCX file";
    if (text->find(expected) == std::string::npos) ++misnamed;
  }
  CHECK(taken == 0);
  CHECK(misnamed == 0);
}

TEST_CASE("reader: a file of many pages that is cut at any block is refused", "[store][damage]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  SampleOptions options;
  options.points = 20000;
  options.writer.codec = Codec::raw;
  write_sample(path, options);
  Patient file(path);
  std::size_t taken = 0;
  for (std::size_t bytes = file.bytes().size(); bytes > 0; bytes -= kBlockBytes) {
    if (bytes < file.bytes().size()) {
      file.resize(bytes);
      if (!refusal(path)) ++taken;
    }
  }
  CHECK(taken == 0);
}

TEST_CASE("reader: bytes after the end are refused with their number", "[store][damage]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  write_sample(path, tiny());
  Patient file(path);
  for (const std::size_t more : {1u, 512u, 4095u, 4096u, 4097u, 8192u, 100000u}) {
    file.resize(file.bytes().size() + more);
    const std::string expected = std::to_string(more) + " bytes longer than its superblock says";
    CHECK_THAT(refusal(path).value_or(""), Catch::Contains(expected));
  }
  file.resize(file.bytes().size());
  CHECK(refusal(path) == std::nullopt);
}

TEST_CASE("reader: one whole superblock is enough, and none is refused", "[store][damage]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  write_sample(path, tiny());
  const std::vector<std::byte> content = walk(path);
  Patient file(path);
  const std::size_t b = file.bytes().size() - kBlockBytes;
  const std::size_t a = b - kBlockBytes;
  file.flip(a + 200);
  CHECK((walk(path) == content));
  file.flip(b + 300);
  CHECK_THAT(refusal(path).value_or(""), Catch::Contains("no superblock is whole"));
  file.restore(a + 200);
  CHECK((walk(path) == content));
  for (std::size_t at = a; at < file.bytes().size(); ++at) file.put(at, std::byte{0});
  CHECK_THAT(refusal(path).value_or(""), Catch::Contains("unfinished or truncated"));
}

TEST_CASE("reader: a whole superblock that breaks a rule is refused whatever the other holds",
          "[store][damage]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  write_sample(path, tiny());
  Patient file(path);
  const std::size_t b = file.bytes().size() - kBlockBytes;
  const std::size_t a = b - kBlockBytes;
  const auto break_rule = [&](std::size_t block) {
    std::vector<std::byte> sealed(
        file.bytes().begin() + static_cast<std::ptrdiff_t>(block),
        file.bytes().begin() + static_cast<std::ptrdiff_t>(block + kBlockBytes - 8));
    sealed[400] = std::byte{1};  // a reserved byte
    file.put(block + 400, sealed[400]);
    const std::uint64_t hash = xxh3_64(sealed, 0x5250555358435450);
    for (std::size_t i = 0; i < 8; ++i)
      file.put(block + kBlockBytes - 8 + i, static_cast<std::byte>(hash >> (8 * i)));
  };
  break_rule(b);
  CHECK_THAT(refusal(path).value_or(""), Catch::Contains("the two superblocks differ"));
  file.flip(a + 200);  // now B alone is whole
  const std::string offset = "offset " + std::to_string(b + 400);
  CHECK_THAT(refusal(path).value_or(""), Catch::Contains(offset + ": reserved byte is not zero"));
}

TEST_CASE("reader: files that are not containers are refused", "[store][damage]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  write_file(path, {});
  CHECK_THAT(refusal(path).value_or(""), Catch::Contains("not a PTCX file"));
  write_file(path, std::vector<std::byte>(20000, std::byte{0xff}));
  CHECK_THAT(refusal(path).value_or(""), Catch::Contains("not a PTCX file"));
  CHECK_THROWS_AS(ContainerReader(scratch / "absent.ptcx"), std::system_error);
  CHECK_THROWS_AS(ContainerReader(scratch.path()), std::system_error);
}

TEST_CASE("reader: a file that shrinks while it is open is an error, not a crash",
          "[store][damage]") {
  const TemporaryDirectory scratch;
  const std::filesystem::path path = scratch / "a.ptcx";
  write_sample(path, tiny());
  const ContainerReader reader(path);
  Patient(path).resize(kBlockBytes);
  PageDecoder decoder;
  std::vector<std::byte> buffer(reader.page_payload_limit());
  CHECK_THROWS_AS(reader.read_page(0, buffer, decoder), DataError);
}
