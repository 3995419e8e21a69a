// Files of records that benches copy: their number of records and their content.
#include "tools/bench/scenes/record_file.h"

#include <cstring>
#include <fstream>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::bench;

namespace {

std::vector<PointRecord> records_of(const RecordFile& file) {
  std::vector<PointRecord> all;
  RecordReader reader(file);
  for (std::span<const PointRecord> block = reader.next(); !block.empty(); block = reader.next()) {
    all.insert(all.end(), block.begin(), block.end());
  }
  return all;
}

/// Returns the bytes that this process has written so far.
std::uint64_t written_bytes() {
  std::ifstream facts("/proc/self/io");
  std::string key;
  for (std::uint64_t value = 0; facts >> key >> value;) {
    if (key == "wchar:") return value;
  }
  throw std::runtime_error("/proc/self/io has no wchar");
}

bool begins_with(const std::vector<PointRecord>& whole, const std::vector<PointRecord>& front) {
  return front.size() <= whole.size() &&
         std::memcmp(static_cast<const void*>(whole.data()), front.data(),
                     front.size() * sizeof(PointRecord)) == 0;
}

}  // namespace

TEST_CASE("record file: noise fills it to its last record", "[bench][records]") {
  const test::TemporaryDirectory dir;
  for (const std::uint64_t count :
       std::vector<std::uint64_t>{1, RecordFile::kBlock, 5 * RecordFile::kBlock + 1}) {
    RecordFile file(dir.path());
    file.fill(count);
    CHECK(file.records() == count);
    const std::vector<PointRecord> records = records_of(file);
    REQUIRE(records.size() == count);
    const PointRecord nothing{};
    CHECK(std::memcmp(&records.back(), &nothing, sizeof nothing) != 0);
    CHECK((count == 1 || std::memcmp(&records[0], &records[1], sizeof nothing) != 0));
  }
}

TEST_CASE("record file: a copy holds the whole records within the requested bytes",
          "[bench][records]") {
  const test::TemporaryDirectory dir;
  RecordFile file(dir.path());
  file.fill(3 * RecordFile::kBlock + 7);
  const std::vector<PointRecord> all = records_of(file);
  constexpr std::uint64_t kBlock = RecordFile::kBlock * sizeof(PointRecord);
  for (const std::uint64_t bytes :
       std::vector<std::uint64_t>{0, 39, 40, 5000, kBlock - 1, kBlock, kBlock + 1,
                                  2 * kBlock + 4096, file.bytes(), ~std::uint64_t{0}}) {
    INFO(bytes);
    RecordFile copy(dir.path());
    const std::uint64_t before = written_bytes();
    file.copy_to(copy, bytes);
    CHECK(written_bytes() - before == direct_blocks(std::min(bytes, file.bytes())));
    CHECK(copy.records() == std::min(bytes, file.bytes()) / sizeof(PointRecord));
    const std::vector<PointRecord> copied = records_of(copy);
    CHECK(copied.size() == copy.records());
    CHECK(begins_with(all, copied));
  }
  CHECK(records_of(file).size() == all.size());
}

TEST_CASE("record file: a file copied to its own place keeps its content", "[bench][records]") {
  const test::TemporaryDirectory dir;
  RecordFile file(dir.path());
  file.fill(6 * RecordFile::kBlock);
  const std::vector<PointRecord> all = records_of(file);
  file.copy_to(file, 4 * RecordFile::kBlock * sizeof(PointRecord) + 80);
  CHECK(file.records() == 4 * RecordFile::kBlock + 2);
  const std::vector<PointRecord> kept = records_of(file);
  CHECK(kept.size() == file.records());
  CHECK(begins_with(all, kept));
}
