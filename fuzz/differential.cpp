// Property, for any bytes as a container: the verifier and spec/reader.py accept the same files,
// with the same content digest. They refuse a file by the same rule where the spec orders the
// rules, which it does for the file header (container.md#file-header).
//
// When several other rules are broken at once, each reader may name its own. reader.py does not
// compare summaries, so it accepts files that the verifier refuses for these alone
// (spec/README.md#the-second-reader).
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "fuzz/memory_file.h"
#include "fuzz/require.h"

namespace {

using ptc::fuzz::require;

// The process of fuzz/reader_server.py, which runs as long as this object.
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

  // Returns what reader.py says about a file: "valid DIGEST", "broken CLAUSE" or "failed TEXT".
  std::string ask(const std::filesystem::path& path) const {
    const std::string line = path.string() + "\n";
    require(write(paths_, line.data(), line.size()) == static_cast<ssize_t>(line.size()));
    std::string verdict;
    for (char c = 0; c != '\n'; verdict += c) {
      ssize_t count = 0;
      while ((count = read(verdicts_, &c, 1)) < 0 && errno == EINTR) {  // libFuzzer sets timers
      }
      require(count == 1);
    }
    verdict.pop_back();
    return verdict;
  }

 private:
  int paths_ = -1;     // pipe to the server, a path on each line
  int verdicts_ = -1;  // pipe from the server, a verdict on each line
};

// Returns what the verifier says in the words of reader_server.py: "valid DIGEST", or "broken RULE"
// for each finding.
std::vector<std::string> judge(const std::filesystem::path& path) {
  ptc::Progress silent;
  const ptc::VerifyReport report = verify_container(
      path, {.memory_bytes = std::uint64_t{1} << 30, .threads = 1, .flip_budget = 0}, silent);
  std::vector<std::string> verdicts;
  for (const ptc::Finding& finding : report.findings) verdicts.push_back("broken " + finding.rule);
  if (!verdicts.empty()) return verdicts;
  const auto digest = ptc::ContainerReader(path).superblock().content_xxh3;
  return {"valid " + ptc::hex(digest[1]) + ptc::hex(digest[0])};
}

// Says whether a verdict is about a summary, which reader.py does not check.
bool is_of_summaries(std::string_view verdict) {
  for (const char* rule : {"mean", "sphere", "slab", "greatest", "sums", "emission", "cone"}) {
    if (verdict == std::string("broken spec/nodes.md#node-") + rule) return true;
  }
  return false;
}

// Says whether the verdicts of the verifier and of reader.py may stand for the same file.
bool agree(const std::vector<std::string>& first, std::string_view second) {
  const auto is_header = [](std::string_view verdict) {
    return verdict.starts_with("broken spec/container.md#header-");
  };
  if (std::ranges::find(first, second) != first.end()) return true;
  if (second.starts_with("valid ")) return std::ranges::all_of(first, is_of_summaries);
  return second.starts_with("broken ") && !first.front().starts_with("valid ") &&
         !is_header(second) && std::ranges::none_of(first, is_header);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const SecondReader second_reader;
  const ptc::fuzz::MemoryFile file({reinterpret_cast<const std::byte*>(data), size}, "a.ptcx");
  const std::vector<std::string> first = judge(file.path());
  const std::string second = second_reader.ask(file.path());
  if (agree(first, second)) return 0;
  for (const std::string& verdict : first)
    std::fprintf(stderr, "the verifier: %s\n", verdict.c_str());
  std::fprintf(stderr, "reader.py:    %s\n", second.c_str());
  std::abort();
}
