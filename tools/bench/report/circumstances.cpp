#include "tools/bench/report/circumstances.h"

#include <stdlib.h>
#include <sys/utsname.h>

#include <chrono>
#include <ctime>
#include <fstream>
#include <string_view>
#include <thread>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <hwy/targets.h>
#include <sched.h>

#include "tools/bench/report/commit.h"

namespace ptc::bench {
namespace {

constexpr std::string_view kChanged = "-dirty";

/// The text behind "KEY :" in a file such as /proc/cpuinfo; empty where there is no such line.
std::string fact_of(const char* file, std::string_view key) {
  std::ifstream facts(file);
  for (std::string line; std::getline(facts, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t colon = line.find(':');
    const std::size_t begin = line.find_first_not_of(" \t", colon + 1);
    if (colon != std::string::npos && begin != std::string::npos) return line.substr(begin);
  }
  return {};
}

std::string processor_model() {
  const std::string model = fact_of("/proc/cpuinfo", "model name");
  return model.empty() ? "unknown" : model;
}

unsigned usable_cores() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  if (::sched_getaffinity(0, sizeof cores, &cores) != 0) return std::thread::hardware_concurrency();
  return static_cast<unsigned>(CPU_COUNT(&cores));
}

std::uint64_t machine_memory_bytes() {
  const std::string kibibytes = fact_of("/proc/meminfo", "MemTotal");
  return kibibytes.empty() ? 0 : std::stoull(kibibytes) * 1024;
}

std::string system_name() {
  utsname name{};
  if (::uname(&name) != 0) return "unknown";
  return fmt::format("{} {} {}", name.sysname, name.release, name.machine);
}

double load_of_a_minute() {
  double load = 0;
  return ::getloadavg(&load, 1) == 1 ? load : 0;
}

/// An argument with its path cut to the last name. The path begins behind "--option=", behind "-o",
/// or at the first character.
std::string public_word(std::string_view word) {
  if (word.find('/') == std::string_view::npos) return std::string(word);
  std::size_t path = 0;
  if (word.starts_with("--")) {
    path = word.find('=') == std::string_view::npos ? 0 : word.find('=') + 1;
  } else if (word.starts_with("-")) {
    path = 2;
  }
  std::string_view rest = word.substr(path);
  while (rest.size() > 1 && rest.ends_with('/')) rest.remove_suffix(1);
  return std::string(word.substr(0, path)) + std::string(rest.substr(rest.rfind('/') + 1));
}

}  // namespace

std::string public_command(std::span<char* const> command) {
  std::string text;
  for (const char* const argument : command) {
    const std::string word = public_word(argument);
    const bool quoted = word.empty() || word.find_first_of(" \t") != std::string::npos;
    text += (text.empty() ? "" : " ") + (quoted ? "'" + word + "'" : word);
  }
  return text;
}

Circumstances circumstances_of(std::span<char* const> command, const std::string& commit) {
  std::string built = kBuiltCommit[0] == '\0' ? commit : kBuiltCommit;
  const bool changed = built.ends_with(kChanged);
  if (changed) built.resize(built.size() - kChanged.size());
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  return {.processor = processor_model(),
          .cores = usable_cores(),
          .memory_bytes = machine_memory_bytes(),
          .system = system_name(),
          .instructions = hwy::TargetName(hwy::SupportedAndGeneratedTargets().front()),
          .load = load_of_a_minute(),
          .commit = built.empty() ? "unknown" : built,
          .changed = changed,
          .date = fmt::format("{:%Y-%m-%d %H:%M}", fmt::gmtime(now)),
          .command = public_command(command)};
}

}  // namespace ptc::bench
