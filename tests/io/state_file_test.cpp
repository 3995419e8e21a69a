// States are written whole, and refused when they are not whole.
#include "engine/io/file/state_file.h"

#include <fstream>
#include <system_error>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "tests/io/files.h"

using namespace ptc;

namespace {

std::vector<std::byte> some_state() {
  StateWriter state;
  state.put(std::uint64_t{7});
  state.put(1.5);
  state.put_text("spill");
  state.put(std::uint8_t{3});
  return state.take();
}

void rewrite(const std::filesystem::path& path, const std::vector<char>& bytes) {
  std::ofstream(path, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace

TEST_CASE("state: values are read in the order in which they were written", "[io][state]") {
  const std::vector<std::byte> bytes = some_state();
  StateReader state(bytes, "here");
  CHECK(state.get_count(7) == 7);
  CHECK(state.get<double>() == 1.5);
  CHECK(state.get_text() == "spill");
  CHECK_THROWS_WITH(state.end(), Catch::Contains("here: ") && Catch::Contains("more bytes"));
  CHECK(state.get<std::uint8_t>() == 3);
  state.end();
  CHECK_THROWS_AS(state.get<std::uint8_t>(), DataError);
  StateReader again(bytes, "here");
  CHECK_THROWS_WITH(again.get_count(6), Catch::Contains("out of range"));
}

TEST_CASE("state: every proper prefix is refused as cut short", "[io][state]") {
  const std::vector<std::byte> bytes = some_state();
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    const std::vector<std::byte> prefix(bytes.begin(),
                                        bytes.begin() + static_cast<std::ptrdiff_t>(n));
    StateReader state(prefix, "here");
    const auto read = [&] {
      static_cast<void>(state.get<std::uint64_t>());
      static_cast<void>(state.get<double>());
      static_cast<void>(state.get_text());
      static_cast<void>(state.get<std::uint8_t>());
    };
    CHECK_THROWS_AS(read(), DataError);
  }
}

TEST_CASE("state: a file that is cut, longer or has a flipped bit is refused", "[io][state]") {
  const test::TemporaryDirectory scratch;
  const std::filesystem::path path = scratch.path() / "state";
  write_state(path, some_state());
  CHECK(read_state(path) == some_state());
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> whole{std::istreambuf_iterator<char>(file), {}};
  for (std::size_t n = 0; n < whole.size(); ++n) {
    rewrite(path, {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n)});
    CHECK_THROWS_AS(read_state(path), DataError);
    for (int bit = 0; bit < 8; ++bit) {
      std::vector<char> flipped = whole;
      flipped[n] = static_cast<char>(flipped[n] ^ (1 << bit));
      rewrite(path, flipped);
      CHECK_THROWS_WITH(read_state(path), Catch::Contains(path.string()));
    }
  }
  std::vector<char> longer = whole;
  longer.push_back(0);
  rewrite(path, longer);
  CHECK_THROWS_AS(read_state(path), DataError);
}

TEST_CASE("lock: only one lock at a time holds a file", "[io][state]") {
  const test::TemporaryDirectory scratch;
  const std::filesystem::path path = scratch.path() / "locked";
  {
    const FileLock lock(path);
    CHECK_THROWS_WITH(FileLock(path),
                      Catch::Contains(path.string()) && Catch::Contains("another program"));
    std::filesystem::remove(path);
    const FileLock other(path);  // locks another file with the same name
    CHECK(std::filesystem::exists(path));
  }
  const FileLock again(path);
}
