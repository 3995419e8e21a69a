// Changes small containers of every profile in all ways of mutations.h and counts what a
// verification and a reader make of each: detected, accepted silently, crashed, or without end.
//
//   mutation_score [--every N]   tries one way in N of the kinds that have many; 1: all
//
// Exits with 1 unless all were detected.
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string>
#include <thread>

#include <fmt/format.h>

#include "engine/octree/rounding.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/ptc.h"
#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "tests/mutation/mutations.h"
#include "tests/store/sample.h"
#include "tests/support/scenes.h"

namespace ptc::test {
namespace {

constexpr auto kPatience = std::chrono::seconds(20);
constexpr std::size_t kFew = 500;  // ways: of so few all are tried

/// What a child tells its parent while it works.
struct Tally {
  std::size_t next = 0;  ///< way that it is at
  std::size_t tried = 0;
  std::size_t silent = 0;   ///< the verification found nothing
  std::size_t misread = 0;  ///< a reader gave other bytes without a word
  std::size_t first_silent = 0;
};

struct Score {
  Tally tally;
  std::size_t crashes = 0, hangs = 0;
};

struct Subject {
  std::string name;
  std::filesystem::path path;  ///< where changed files are written
  Bytes whole;
  std::vector<PagePlace> pages;
  Bytes content;
};

Subject make_subject(const TemporaryDirectory& directory, const std::string& name, Profile profile,
                     bool shaded) {
  Progress silent;
  const std::filesystem::path scene = directory / "scene.ptcx", lit = directory / "lit.ptcx";
  write_scene(scene, random_surfels(150, 3), {}, 12, Codec::raw);
  if (shaded) {
    ShadeRequest request{{.scene = scene}};
    request.run.threads = 1;
    shade_container(request, lit, silent);
  }
  Subject subject{.name = name, .path = directory / "changed.ptcx"};
  recode_container(ContainerReader(shaded ? lit : scene), subject.path, {.profile = profile},
                   silent);
  subject.whole = read_file(subject.path);
  subject.content = walk(subject.path);
  const ContainerReader container(subject.path);
  for (const DirectoryEntry& entry : container.entries()) {
    subject.pages.push_back(
        {entry.offset, round_up(kPageHeaderBytes + entry.stored_bytes, kSectorBytes)});
  }
  return subject;
}

bool verification_finds_it(const std::filesystem::path& path) {
  Progress silent;
  try {
    return !verify_container(path, {.threads = 1, .flip_budget = 0}, silent).sound();
  } catch (const std::runtime_error&) {  // the file changed while it was looked at, or such
    return true;
  }
}

bool reader_is_misled(const Subject& subject) {
  try {
    return walk(subject.path) != subject.content;
  } catch (const std::runtime_error&) {  // refused
    return false;
  }
}

/// In a child: ways from tally.next on.
void work(const Subject& subject, const Mutation& mutation, std::size_t every, Tally& tally) {
  Bytes changed;
  for (; tally.next < mutation.count; tally.next += every) {
    if (!mutation.apply(subject.whole, subject.pages, tally.next, changed)) continue;
    write_file(subject.path, changed);
    ++tally.tried;
    if (!verification_finds_it(subject.path) && tally.silent++ == 0)
      tally.first_silent = tally.next;
    tally.misread += reader_is_misled(subject);
  }
}

Score try_all(const Subject& subject, const Mutation& mutation, std::size_t every) {
  void* const shared =
      ::mmap(nullptr, sizeof(Tally), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared == MAP_FAILED) throw std::bad_alloc();
  auto& tally = *new (shared) Tally;
  Score score;
  while (tally.next < mutation.count) {
    const pid_t child = ::fork();
    if (child == 0) {
      work(subject, mutation, every, tally);
      ::_exit(0);
    }
    int status = 0;
    std::size_t seen = ~std::size_t{0};
    auto since = std::chrono::steady_clock::now();
    while (::waitpid(child, &status, WNOHANG) == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      const auto now = std::chrono::steady_clock::now();
      const std::size_t at = reinterpret_cast<const volatile std::size_t&>(tally.next);
      if (at != seen) since = now;
      seen = at;
      if (now - since > kPatience) ::kill(child, SIGALRM);
    }
    if (WIFSIGNALED(status) || WEXITSTATUS(status) != 0) {
      ++(WIFSIGNALED(status) && WTERMSIG(status) == SIGALRM ? score.hangs : score.crashes);
      if (score.hangs + score.crashes == 1)
        fmt::print("{}, {}: way {} ended the process\n", subject.name, mutation.name, tally.next);
      tally.next += every;
    }
  }
  score.tally = tally;
  ::munmap(shared, sizeof(Tally));
  return score;
}

int run(std::size_t every) {
  const TemporaryDirectory directory;
  const std::array subjects{make_subject(directory, "raw", Profile::raw, false),
                            make_subject(directory, "exact", Profile::exact, false),
                            make_subject(directory, "fast", Profile::fast, false),
                            make_subject(directory, "compact", Profile::compact, false),
                            make_subject(directory, "compact, shaded", Profile::compact, true)};
  Score all;
  fmt::print(
      "| change | tried | found | accepted silently | misread | crashes | hangs "
      "|\n|---|---|---|---|---|---|---|\n");
  const std::size_t kinds = mutations_of(subjects[0].whole, subjects[0].pages).size();
  for (std::size_t kind = 0; kind < kinds; ++kind) {
    Score sum;
    std::string name;
    for (const Subject& subject : subjects) {
      const Mutation mutation = mutations_of(subject.whole, subject.pages)[kind];
      name = mutation.name;
      const Score score = try_all(subject, mutation, mutation.count < kFew ? 1 : every);
      if (score.tally.silent > 0)
        fmt::print("{}, {}: way {} was accepted\n", subject.name, name, score.tally.first_silent);
      for (Score* const into : {&sum, &all}) {
        into->tally.tried += score.tally.tried;
        into->tally.silent += score.tally.silent;
        into->tally.misread += score.tally.misread;
        into->crashes += score.crashes;
        into->hangs += score.hangs;
      }
    }
    fmt::print("| {} | {} | {} | {} | {} | {} | {} |\n", name, sum.tally.tried,
               sum.tally.tried - sum.tally.silent - sum.crashes - sum.hangs, sum.tally.silent,
               sum.tally.misread, sum.crashes, sum.hangs);
    std::fflush(stdout);
  }
  const Tally& t = all.tally;
  fmt::print("| all | {} | {} | {} | {} | {} | {} |\n", t.tried,
             t.tried - t.silent - all.crashes - all.hangs, t.silent, t.misread, all.crashes,
             all.hangs);
  return t.tried > 1000 && t.silent + t.misread + all.crashes + all.hangs == 0 ? 0 : 1;
}

}  // namespace
}  // namespace ptc::test

int main(int argc, char** argv) {
  const bool wrong =
      argc != 1 && (argc != 3 || std::strcmp(argv[1], "--every") != 0 || std::atoi(argv[2]) < 1);
  if (wrong) {
    fmt::print(stderr, "usage: mutation_score [--every N]\n");
    return 2;
  }
  return ptc::test::run(argc == 3 ? static_cast<std::size_t>(std::atoi(argv[2])) : 1);
}
