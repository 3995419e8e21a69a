// The figures that the system reports of this process, and blocks of memory straight from it.
#include "engine/base/memory.h"

#include <malloc.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <ctime>
#include <fstream>
#include <new>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

namespace ptc {
namespace {

constexpr const char* kStatus = "/proc/self/status";
constexpr std::size_t kHugePageBytes = std::size_t{2} << 20;

// Returns the value of the line "NAME:   1234 kB" of /proc/self/status in bytes.
std::uint64_t status_bytes(std::string_view name) {
  std::ifstream status(kStatus);
  for (std::string line; std::getline(status, line);) {
    if (!line.starts_with(name)) continue;
    const std::size_t digits = line.find_first_of("0123456789");
    std::uint64_t kib = 0;
    if (digits != std::string::npos &&
        std::from_chars(line.data() + digits, line.data() + line.size(), kib).ec == std::errc{})
      return kib * 1024;
  }
  throw std::system_error(ENODATA, std::generic_category(),
                          "read " + std::string(kStatus) + ": no " + std::string(name));
}

}  // namespace

// VmHWM is read in place of getrusage(), whose ru_maxrss belongs to the process, not to the
// program, and survives exec: a small program started from a large one would report the peak of its
// parent's image.
std::uint64_t peak_resident_bytes() {
  return status_bytes("VmHWM:");
}

std::uint64_t resident_bytes() {
  return status_bytes("VmRSS:");
}

void return_freed_memory() noexcept {
  malloc_trim(0);
}

double cpu_seconds() {
  timespec t{};
  if (clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t) != 0)
    throw std::system_error(errno, std::generic_category(), "clock_gettime");
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

Arena::Arena(std::size_t bytes) : size_(bytes) {
  if (bytes == 0) return;
  // Reserve nothing: a cap above the machine's memory is no error as long as it is not used.
  void* block = mmap(nullptr, bytes, PROT_READ | PROT_WRITE,
                     MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (block == MAP_FAILED) throw std::bad_alloc();
  // The first touch of each page costs a fault; huge pages make them 512 times fewer. A refusal
  // costs nothing but time, so it is ignored.
  if (bytes >= kHugePageBytes) madvise(block, bytes, MADV_HUGEPAGE);
  data_ = static_cast<std::byte*>(block);
}

Arena::~Arena() {
  if (data_ != nullptr) munmap(data_, size_);
}

void Arena::discard(std::size_t offset, std::size_t bytes) noexcept {
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  const std::size_t first = (offset + page - 1) / page * page;
  const std::size_t last = (offset + bytes) / page * page;
  if (first < last) madvise(data_ + first, last - first, MADV_DONTNEED);
}

Arena::Arena(Arena&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}

Arena& Arena::operator=(Arena&& other) noexcept {
  Arena taken(std::move(other));
  std::swap(data_, taken.data_);
  std::swap(size_, taken.size_);
  return *this;
}

}  // namespace ptc
