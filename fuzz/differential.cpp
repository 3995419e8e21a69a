// Any bytes as a container: the verifier and spec/reader.py accept the same files, with the same
// content digest, and refuse by the same rule where the spec orders the rules: those of the file
// header (container.md#file-header).
//
// Where several other rules are broken at once each may name its own. reader.py does not compare
// summaries: files that the verifier refuses for these alone it accepts
// (spec/README.md#the-second-reader).
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

#include "engine/build/verify.h"
#include "engine/store/reader.h"
#include "format/error.h"
#include "fuzz/memory_file.h"
#include "fuzz/require.h"

namespace {

using ptc::fuzz::require;

/// fuzz/reader_server.py, as long as this process runs.
class SecondReader {
 public:
  SecondReader() {
    std::array<int, 2> to{}, from{};
    if (pipe(to.data()) != 0 || pipe(from.data()) != 0) std::abort();
    if (fork() == 0) {
      dup2(to[0], 0);
      dup2(from[1], 1);
      for (const int fd : {to[0], to[1], from[0], from[1]}) close(fd);
      execlp("python3", "python3", "-B", PTC_READER_SERVER, nullptr);
      _exit(127);
    }
    close(to[0]);
    close(from[1]);
    paths_ = to[1];
    verdicts_ = from[0];
  }
  ~SecondReader() {
    close(paths_);
    close(verdicts_);
    wait(nullptr);
  }
  SecondReader(const SecondReader&) = delete;
  SecondReader& operator=(const SecondReader&) = delete;

  std::string ask(const std::filesystem::path& path) const {
    const std::string line = path.string() + "\n";
    require(write(paths_, line.data(), line.size()) == static_cast<ssize_t>(line.size()));
    std::string verdict;
    for (char c = 0; c != '\n'; verdict += c) {
      ssize_t count = 0;
      while ((count = read(verdicts_, &c, 1)) < 0 && errno == EINTR) {  // libFuzzer's clock
      }
      require(count == 1);
    }
    verdict.pop_back();
    return verdict;
  }

 private:
  int paths_ = -1;
  int verdicts_ = -1;
};

std::string judge(const std::filesystem::path& path) {
  try {
    ptc::Progress silent;
    static_cast<void>(
        verify_container(path, {.memory_bytes = std::uint64_t{1} << 30, .threads = 1}, silent));
    const auto digest = ptc::ContainerReader(path).superblock().content_xxh3;
    std::array<char, 64> line{};
    std::snprintf(line.data(), line.size(), "valid %016llx%016llx",
                  static_cast<unsigned long long>(digest[1]),
                  static_cast<unsigned long long>(digest[0]));
    return line.data();
  } catch (const ptc::FormatError& error) {
    return "broken " + error.clause();
  }
}

bool is_of_summaries(std::string_view verdict) {
  for (const char* rule : {"mean", "sphere", "slab", "sums", "cone"}) {
    if (verdict == std::string("broken spec/nodes.md#node-") + rule) return true;
  }
  return false;
}

bool agree(std::string_view first, std::string_view second) {
  constexpr std::string_view kBroken = "broken ", kHeader = "broken spec/container.md#header-";
  if (first == second) return true;
  if (second.starts_with(kHeader) || first.starts_with(kHeader)) return false;
  return first.starts_with(kBroken) && (second.starts_with(kBroken) || is_of_summaries(first)) &&
         !second.starts_with("failed");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const SecondReader second_reader;
  const ptc::fuzz::MemoryFile file({reinterpret_cast<const std::byte*>(data), size}, "a.ptcx");
  const std::string first = judge(file.path());
  const std::string second = second_reader.ask(file.path());
  if (agree(first, second)) return 0;
  std::fprintf(stderr, "the verifier: %s\nreader.py:    %s\n", first.c_str(), second.c_str());
  std::abort();
}
