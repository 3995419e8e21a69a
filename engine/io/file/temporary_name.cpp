#include "engine/io/file/temporary_name.h"

#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <string>
#include <string_view>

namespace ptc {
namespace {

constexpr std::string_view kMark = ".tmp-";
constexpr std::size_t kMaxName = 128, kMaxHost = 48;  // characters of a temporary name
constexpr std::time_t kLeftSeconds = 24 * 3600;

/// Returns the name of this host without characters that divide or end names.
std::string host_name() {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0) return "host";
  std::string host = std::string(name.data()).substr(0, kMaxHost);
  for (char& c : host) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    if (!plain && c != '.') c = '_';
  }
  return host;
}

/// Draws a number that differs between processes of one number on hosts of one name.
std::uint32_t random_number() {
  std::uint32_t number = 0;
  if (::getrandom(&number, sizeof number, GRND_NONBLOCK) == sizeof number) return number;
  std::timespec now{};
  std::timespec_get(&now, TIME_UTC);
  return static_cast<std::uint32_t>(now.tv_nsec ^ now.tv_sec);
}

}  // namespace

std::filesystem::path temporary_name(const std::filesystem::path& target) {
  static std::atomic<std::uint64_t> counter = 0;
  static const std::string host = host_name();
  std::array<char, 64> end{};
  std::snprintf(end.data(), end.size(), "-%ld-%08x-%llu", static_cast<long>(::getpid()),
                random_number(), static_cast<unsigned long long>(counter.fetch_add(1)));
  return target.parent_path() / ("." + target.filename().string().substr(0, kMaxName) +
                                 std::string(kMark) + host + end.data());
}

bool is_leftover(const std::filesystem::path& file) noexcept {
  // Take its name apart
  const std::string name = file.filename().string();
  const std::size_t mark = name.rfind(kMark);
  if (!name.starts_with('.') || mark == std::string::npos) return false;
  const std::string_view made = std::string_view(name).substr(mark + kMark.size());
  const std::size_t host_end = made.find('-');
  if (host_end == std::string_view::npos) return false;
  pid_t process = 0;
  const char* const begin = made.data() + host_end + 1;
  const auto [end, error] = std::from_chars(begin, made.data() + made.size(), process);
  if (error != std::errc{} || end == made.data() + made.size() || *end != '-' || process <= 0)
    return false;

  // Ask for its process, and for its last change
  if (made.substr(0, host_end) == host_name() && ::kill(process, 0) != 0 && errno == ESRCH)
    return true;
  struct stat status {};
  return ::stat(file.c_str(), &status) == 0 &&
         status.st_mtim.tv_sec + kLeftSeconds < std::time(nullptr);
}

}  // namespace ptc
