// Memory figures that the system reports for this process, and arenas.
#include "engine/base/memory.h"

#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <functional>
#include <limits>
#include <new>
#include <utility>

#include <catch2/catch.hpp>

#include "tests/support/sanitizers.h"

using namespace ptc;
using namespace ptc::test;

namespace {

constexpr std::uint64_t kMiB = 1 << 20;

bool near(std::uint64_t actual, std::uint64_t expected) {
  return kSanitized || (actual + 4 * kMiB > expected && actual < expected + 4 * kMiB);
}

// Returns true when `holds` is true in a child process, which has a peak of its own.
bool in_child(const std::function<bool()>& holds) {
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    bool ok = false;
    try {
      ok = holds();
    } catch (...) {
    }
    _exit(ok ? 0 : 1);
  }
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace

TEST_CASE("memory: an arena is resident from the first touch until it is destroyed",
          "[base][memory]") {
  CHECK(in_child([] {
    const std::uint64_t before = resident_bytes();
    {
      const Arena arena(64 * kMiB);
      const bool lazy = near(resident_bytes(), before);
      std::memset(arena.data(), 1, arena.size());
      if (!lazy || !near(resident_bytes(), before + 64 * kMiB)) return false;
    }
    return near(resident_bytes(), before);
  }));
}

TEST_CASE("memory: discarded pages of an arena are freed, and zero when touched again",
          "[base][memory]") {
  CHECK(in_child([] {
    const std::uint64_t before = resident_bytes();
    Arena arena(64 * kMiB);
    std::memset(arena.data(), 1, arena.size());
    arena.discard(16 * kMiB, 32 * kMiB);
    return near(resident_bytes(), before + 32 * kMiB);
  }));
  const std::size_t page = 4096;
  for (const auto& [offset, bytes] : {std::pair<std::size_t, std::size_t>{0, 0},
                                      {0, 8 * page},
                                      {1, 8 * page - 2},
                                      {page, 3 * page},
                                      {page - 1, page + 1},
                                      {page, page - 1},
                                      {5, 7}}) {
    Arena arena(8 * page);
    std::memset(arena.data(), 1, arena.size());
    arena.discard(offset, bytes);
    for (std::size_t i = 0; i < arena.size(); ++i) {  // whole pages only
      const std::size_t first = i / page * page;
      const bool gone = first >= offset && first + page <= offset + bytes;
      REQUIRE(arena.data()[i] == (gone ? std::byte{0} : std::byte{1}));
    }
  }
}

TEST_CASE("memory: the peak stays when memory is freed", "[base][memory]") {
  CHECK(in_child([] {
    const std::uint64_t before = resident_bytes();
    {
      const Arena arena(64 * kMiB);
      std::memset(arena.data(), 1, arena.size());
    }
    return peak_resident_bytes() + 4 * kMiB > before + 64 * kMiB &&
           near(resident_bytes(), before) && peak_resident_bytes() >= resident_bytes();
  }));
}

TEST_CASE("memory: an arena is zero-filled, aligned to pages and writable to its last byte",
          "[base][memory]") {
  for (const std::size_t bytes : {std::size_t{1}, std::size_t{4096}, std::size_t{4097},
                                  std::size_t{2} << 20, (std::size_t{6} << 20) + 5}) {
    const Arena arena(bytes);
    CHECK(arena.size() == bytes);
    CHECK(reinterpret_cast<std::uintptr_t>(arena.data()) % 4096 == 0);
    std::size_t other = 0;
    for (std::size_t i = 0; i < bytes; ++i) other += arena.data()[i] != std::byte{0};
    CHECK(other == 0);
    std::memset(arena.data(), 0xff, bytes);
  }
}

TEST_CASE("memory: an arena can be moved and leaves nothing behind", "[base][memory]") {
  Arena empty(0);
  CHECK(empty.data() == nullptr);
  CHECK(empty.size() == 0);

  Arena a(8192);
  std::byte* const data = a.data();
  Arena b(std::move(a));
  CHECK(b.data() == data);
  CHECK(b.size() == 8192);
  CHECK(a.data() == nullptr);  // NOLINT: a moved-from arena is empty
  CHECK(a.size() == 0);

  Arena c(4096);
  c = std::move(b);
  CHECK(c.data() == data);
  CHECK(b.data() == nullptr);  // NOLINT: a moved-from arena is empty
  Arena& same = c;
  c = std::move(same);
  CHECK(c.data() == data);
  CHECK(c.size() == 8192);
}

TEST_CASE("memory: an arena larger than the address space throws bad_alloc", "[base][memory]") {
  CHECK_THROWS_AS(Arena(std::numeric_limits<std::size_t>::max() / 2), std::bad_alloc);
}

TEST_CASE("memory: CPU time grows while a thread works, not while it waits", "[base][memory]") {
  const double start = cpu_seconds();
  usleep(50000);
  const double waited = cpu_seconds();
  CHECK(waited - start < 0.04);
  volatile std::uint64_t sum = 0;
  while (cpu_seconds() - waited < 0.02)
    for (int i = 0; i < 1000; ++i) sum = sum + 1;
  CHECK(cpu_seconds() > start);
}
