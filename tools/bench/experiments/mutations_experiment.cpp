// The experiment `ptcbench mutations`: changes small containers of every profile in all ways of
// mutations.h, and counts how many changes a verification and a reader detect.
//
//   parent                                    child, one at a time
//   fork ---------------------------------->  for each way: write the changed file, verify, read
//   watch Tally::next in shared memory   <--  next, tried, accepted, refused, misread
//   killed or exited: count a crash or a hang, fork again at the way after it
//
// A scene of parts has several files. One of them is changed at a time, and the scene is verified
// and read. Last, files are removed, exchanged, and put in the place of each other.
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <fstream>
#include <functional>
#include <new>
#include <random>
#include <string>
#include <thread>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/store/reader.h"
#include "engine/verify/verify.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/mutations.h"
#include "tools/bench/experiments/two_parts.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

constexpr char kMutationsReading[] =
    "Small containers of every profile, with and without channels and light of their own, are "
    "changed in every way of each kind. Found: the verification reports a finding. Accepted: it "
    "reports none. Refused: a reader that loads every page stops with an error; it does not look "
    "at padding, for example. Misread: it returned other bytes without an error. Each change is "
    "tried in a child process, so that crashes and hangs are counted, too. The last rows are of a "
    "scene of two parts: one of its files was changed in all of these ways, or files of it were "
    "missing or others were in their place.";

constexpr auto kPatience = std::chrono::seconds(20);  // for one way; longer is a hang
constexpr std::size_t kFew = 500;                     // kinds with fewer ways are tried whole
constexpr std::size_t kPoints = 150;                  // of a container
constexpr std::uint8_t kPageShift = 12;
constexpr std::size_t kEnoughTried = 1000;  // fewer ways in all say nothing

/// The counts that a child shares with its parent while it works.
struct Tally {
  std::size_t next = 0;  ///< number of the way that is tried now
  std::size_t tried = 0;
  std::size_t accepted = 0;
  std::size_t refused = 0;
  std::size_t misread = 0;
  std::size_t first_accepted = 0;
};

/// The counts of one kind of change.
struct MutationRow {
  std::string change;
  std::size_t tried = 0, accepted = 0, refused = 0, misread = 0, crashes = 0, hangs = 0;

  [[nodiscard]] std::size_t found() const { return tried - accepted - crashes - hangs; }
  [[nodiscard]] bool all_found() const { return accepted + misread + crashes + hangs == 0; }

  MutationRow& operator+=(const MutationRow& other) {
    tried += other.tried;
    accepted += other.accepted;
    refused += other.refused;
    misread += other.misread;
    crashes += other.crashes;
    hangs += other.hangs;
    return *this;
  }
};

const Columns<MutationRow>& mutations_columns() {
  using R = MutationRow;
  static const Columns<R> columns{
      {"change", {"change"}, &R::change},    {"tried", {"tried"}, &R::tried},
      {"found", {"found"}, &R::found},       {"accepted", {"accepted"}, &R::accepted},
      {"refused", {"refused"}, &R::refused}, {"misread", {"misread"}, &R::misread},
      {"crashes", {"crashes"}, &R::crashes}, {"hangs", {"hangs"}, &R::hangs}};
  return columns;
}

/// A file that is changed.
struct Subject {
  std::string name;              ///< its profile
  std::filesystem::path path;    ///< where changed files are written
  std::filesystem::path opened;  ///< what is verified and read: itself, or the scene that it is of
  Bytes whole;                   ///< the file as it was written
  std::vector<PagePlace> pages;
  Bytes content;  ///< content_of() what is opened, as it was written
};

/// Reads a whole file.
Bytes read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string text(std::istreambuf_iterator<char>(file), {});
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

/// Writes a changed file. @throws DataError
void write_file(const std::filesystem::path& path, const Bytes& bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) throw DataError(path.string() + ": a changed file could not be written");
}

/// Appends the payloads of all pages, one after another.
void append_content(const ContainerReader& reader, Bytes& all) {
  PageDecoder decoder;
  Bytes buffer(reader.page_payload_limit());
  for (std::uint32_t page = 0; page < reader.page_count(); ++page) {
    const PageHeader header = reader.read_page(page, buffer, decoder);
    all.insert(all.end(), buffer.begin(), buffer.begin() + header.raw_bytes);
  }
}

/// The payloads of all pages, and of those of the parts of a scene of parts.
Bytes content_of(const std::filesystem::path& path) {
  const ContainerReader reader(path);
  Bytes all;
  append_content(reader, all);
  for (const auto& part : reader.parts()) append_content(*part, all);
  return all;
}

bool verification_finds_it(const std::filesystem::path& path) {
  Progress silent;
  try {
    return !verify_container(path, {.threads = 1, .flip_budget = 0}, silent).sound();
  } catch (const std::runtime_error&) {  // an error is a finding, too
    return true;
  }
}

/// Describes a file that is changed.
/// @param opened  as Subject::opened
/// @throws DataError when the verification finds something before any change
Subject subject_of(const std::string& name, const std::filesystem::path& path,
                   const std::filesystem::path& opened) {
  if (verification_finds_it(opened)) throw DataError(name + ": the unchanged file is not sound");
  Subject subject{.name = name,
                  .path = path,
                  .opened = opened,
                  .whole = read_file(path),
                  .pages = {},
                  .content = content_of(opened)};
  const ContainerReader container(path);
  for (const DirectoryEntry& entry : container.entries()) {
    subject.pages.push_back(
        {entry.offset, round_up(kPageHeaderBytes + entry.stored_bytes, kSectorBytes)});
  }
  return subject;
}

/// Writes a cloud of random surfels in the unit cube, the same ones each time.
/// @param emits  whether each second one has light of its own
void write_cloud(const std::filesystem::path& path, bool emits) {
  std::mt19937_64 bits(3);
  const auto number = [&] {
    return static_cast<float>(bits() >> 40) / static_cast<float>(1 << 24);
  };
  std::ofstream file(path);
  file << "# x y z nx ny nz radius radiance_r radiance_g radiance_b"
       << (emits ? " emission_r emission_g emission_b\n" : "\n");
  for (std::size_t i = 0; i < kPoints; ++i) {
    const glm::vec3 position(number(), number(), number());
    const glm::vec3 turned = glm::vec3(number(), number(), number()) - 0.5F;
    const glm::vec3 normal = glm::normalize(turned + glm::vec3(0, 0, 1e-3F));
    file << fmt::format("{} {} {} {} {} {} {} {} {} {}", position.x, position.y, position.z,
                        normal.x, normal.y, normal.z, 0.01F + 0.1F * number(), number(), number(),
                        number());
    if (emits) file << fmt::format(" {} 0 {}", i % 2 == 0 ? 0.0F : number(), number());
    file << '\n';
  }
}

/// The files of a scene of parts and of what its parts are cut from.
struct SceneFiles {
  explicit SceneFiles(const std::filesystem::path& work)
      : whole(work, "-whole.ptcx"),
        scene(work, "-parts.ptcx"),
        first(work, "-part0.ptcx"),
        second(work, "-part1.ptcx") {}
  WorkFile whole, scene, first, second;
};

/// Builds the containers that are changed.
/// @param parts  gets a scene of parts with the points of the container "compact"
std::vector<Subject> make_subjects(const Bench& bench, const WorkFile& changed,
                                   const SceneFiles& parts) {
  // Build and shade a scene
  const WorkFile cloud(bench.work, ".xyz"), scene(bench.work, "-scene.ptcx"),
      lamps(bench.work, "-lamps.ptcx"), lit(bench.work, "-lit.ptcx");
  Progress silent;
  for (const bool emits : {false, true}) {
    write_cloud(cloud.path(), emits);
    build_container({.inputs = {cloud.path()},
                     .page_shift = kPageShift,
                     .profile = Profile::raw,
                     .run = {.threads = 1}},
                    (emits ? lamps : scene).path(), silent);
  }
  shade_container({{.scene = scene.path(), .run = {.threads = 1}}}, lit.path(), silent);
  // Recode it in every profile
  struct Kind {
    const char* name;
    Profile profile;
    const std::filesystem::path& source;
  };
  std::vector<Subject> subjects;
  for (const Kind& kind : {Kind{"raw", Profile::raw, scene.path()},
                           {"exact", Profile::exact, scene.path()},
                           {"fast", Profile::fast, scene.path()},
                           {"compact", Profile::compact, scene.path()},
                           {"compact, emitting", Profile::compact, lamps.path()},
                           {"compact, shaded", Profile::compact, lit.path()}}) {
    recode_container(ContainerReader(kind.source), changed.path(), {.profile = kind.profile},
                     silent);
    subjects.push_back(subject_of(kind.name, changed.path(), changed.path()));
  }
  // Cut it into parts
  recode_container(ContainerReader(scene.path()), parts.whole.path(), {.profile = Profile::compact},
                   silent);
  write_two_parts(ContainerReader(parts.whole.path()), parts.scene.path(),
                  {parts.first.path(), parts.second.path()});
  return subjects;
}

/// Lets a reader load every page, and counts when it stops with an error or returns other bytes.
void read_changed(const Subject& subject, Tally& tally) {
  try {
    if (content_of(subject.opened) != subject.content) ++tally.misread;
  } catch (const std::runtime_error&) {
    ++tally.refused;
  }
}

/// Numbered ways to change files.
struct Ways {
  std::string change;
  std::size_t count = 0;
  /// Writes the files changed in way k. @return whether they differ from the whole ones
  std::function<bool(std::size_t k)> write;
};

/// The ways of a kind of change to one file.
Ways ways_of(const Subject& subject, const Mutation& mutation) {
  return {.change = mutation.name,
          .count = mutation.count,
          .write = [&subject, mutation, changed = Bytes()](std::size_t k) mutable {
            if (!mutation.apply(subject.whole, subject.pages, k, changed)) return false;
            write_file(subject.path, changed);
            return true;
          }};
}

/// Tries the ways from tally.next on; runs in a child process.
void work(const Subject& subject, const Ways& ways, std::size_t every, Tally& tally) {
  for (; tally.next < ways.count; tally.next += every) {
    if (!ways.write(tally.next)) continue;
    ++tally.tried;
    if (!verification_finds_it(subject.opened) && tally.accepted++ == 0)
      tally.first_accepted = tally.next;
    read_changed(subject, tally);
  }
}

/// Waits for a child, and kills it when it stays at one way for more than kPatience.
/// @return the status of waitpid()
int wait_patiently(pid_t child, const Tally& tally) {
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
  return status;
}

/// Tries every `every`-th way of one kind on one file, which is whole again afterwards.
MutationRow try_all(const Subject& subject, const Ways& ways, std::size_t every,
                    Progress& progress) {
  // Share a tally with the children
  void* const shared =
      ::mmap(nullptr, sizeof(Tally), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared == MAP_FAILED) throw std::bad_alloc();
  auto& tally = *new (shared) Tally;
  MutationRow row{.change = ways.change};
  // Fork a child, and another one after each crash or hang
  while (tally.next < ways.count) {
    const pid_t child = ::fork();
    if (child == 0) {
      ::signal(SIGALRM, SIG_DFL);
      try {
        work(subject, ways, every, tally);
      } catch (...) {  // counts as a crash
        ::abort();
      }
      ::_exit(0);
    }
    const int status = wait_patiently(child, tally);
    if (!WIFSIGNALED(status) && WEXITSTATUS(status) == 0) continue;
    ++(WIFSIGNALED(status) && WTERMSIG(status) == SIGALRM ? row.hangs : row.crashes);
    progress.note(
        fmt::format("{}, {}: way {} ended the process", subject.name, ways.change, tally.next));
    tally.next += every;
  }
  write_file(subject.path, subject.whole);
  // Take over the counts
  row.tried = tally.tried;
  row.accepted = tally.accepted;
  row.refused = tally.refused;
  row.misread = tally.misread;
  if (tally.accepted > 0) {
    progress.note(fmt::format("{}, {}: way {} was accepted", subject.name, ways.change,
                              tally.first_accepted));
  }
  ::munmap(shared, sizeof(Tally));
  return row;
}

Report report_of(const std::vector<MutationRow>& rows, std::size_t every) {
  Report report{.name = "mutations",
                .title = "Changes to a file that a verification and a reader detect",
                .reading = kMutationsReading,
                .runs = 0,
                .tables = {tabulate<MutationRow>({.name = "rows"}, mutations_columns(), rows)}};
  if (every > 1) {
    report.notes = {
        fmt::format("Of kinds with {} ways or more, one way in {} was tried.", kFew, every)};
  }
  return report;
}

/// Tries one kind on one file.
MutationRow try_kind(const Subject& subject, const Mutation& mutation, std::size_t every,
                     Progress& progress) {
  return try_all(subject, ways_of(subject, mutation), mutation.count < kFew ? 1 : every, progress);
}

/// Tries all kinds on one file of a scene of parts. @param change  name of the row
MutationRow try_file(const std::string& change, const std::filesystem::path& path,
                     const SceneFiles& parts, std::size_t every, Progress& progress) {
  const Subject subject = subject_of(change, path, parts.scene.path());
  MutationRow sum;
  for (const Mutation& mutation : mutations_of(subject.whole, subject.pages))
    sum += try_kind(subject, mutation, every, progress);
  sum.change = change;
  return sum;
}

/// Tries the files of a scene of parts in the place of each other. Way 5 p + j puts file j in the
/// place of part p: none, an empty one, the other part, the scene, or the container with all
/// points; the last way exchanges the parts.
MutationRow try_exchanges(const SceneFiles& parts, Progress& progress) {
  const Subject subject = subject_of("a scene of parts", parts.scene.path(), parts.scene.path());
  const std::array<std::filesystem::path, 2> paths{parts.first.path(), parts.second.path()};
  const std::array<Bytes, 2> wholes{read_file(paths[0]), read_file(paths[1])};
  const Bytes points = read_file(parts.whole.path());
  constexpr std::size_t kFiles = 5;
  const auto restore = [&] {
    for (std::size_t p = 0; p < 2; ++p) write_file(paths[p], wholes[p]);
  };
  MutationRow row = try_all(subject,
                            {.change = "a scene of parts: files missing or exchanged",
                             .count = 2 * kFiles + 1,
                             .write =
                                 [&](std::size_t k) {
                                   restore();
                                   const std::size_t part = k / kFiles;
                                   if (k == 2 * kFiles) {
                                     for (std::size_t p = 0; p < 2; ++p)
                                       write_file(paths[p], wholes[1 - p]);
                                   } else if (k % kFiles == 0) {
                                     std::filesystem::remove(paths[part]);
                                   } else {
                                     const std::array<Bytes, kFiles> files{
                                         Bytes(), Bytes(), wholes[1 - part], subject.whole, points};
                                     write_file(paths[part], files[k % kFiles]);
                                   }
                                   return true;
                                 }},
                            1, progress);
  restore();
  return row;
}

/// Tries all kinds on all containers.
/// @throws DataError when a change was not found, or too few were tried
Report measure(std::size_t every, const Bench& bench) {
  const WorkFile changed(bench.work, "-changed.ptcx");
  const SceneFiles parts(bench.work);
  const std::vector<Subject> subjects = make_subjects(bench, changed, parts);
  const std::size_t kinds = mutations_of(subjects[0].whole, subjects[0].pages).size();
  std::vector<MutationRow> rows;
  MutationRow all{.change = "all"};
  const auto publish = [&](const MutationRow& row) {
    all += row;
    rows.push_back(row);
    bench.publish(report_of(rows, every));
    bench.progress.advance(1);
  };
  constexpr std::size_t kSceneRows = 3;
  bench.progress.begin("mutations", kinds + kSceneRows, "kinds");
  for (std::size_t kind = 0; kind < kinds; ++kind) {
    MutationRow sum;
    for (const Subject& subject : subjects) {
      const Mutation mutation = mutations_of(subject.whole, subject.pages)[kind];
      sum.change = mutation.name;
      sum += try_kind(subject, mutation, every, bench.progress);
    }
    publish(sum);
  }
  publish(try_file("a scene of parts: any of these to its own file", parts.scene.path(), parts,
                   every, bench.progress));
  publish(try_file("a scene of parts: any of these to a part", parts.first.path(), parts, every,
                   bench.progress));
  publish(try_exchanges(parts, bench.progress));
  bench.progress.end();
  rows.push_back(all);
  bench.publish(report_of(rows, every));
  if (all.tried < kEnoughTried || !all.all_found()) {
    throw DataError(fmt::format("mutations: {} of {} changes were found, {} were misread",
                                all.found(), all.tried, all.misread));
  }
  return report_of(rows, every);
}

}  // namespace

Experiment make_mutations_experiment() {
  const auto every = std::make_shared<std::uint64_t>(1);
  const auto declare = [every](Declaration& d) {
    d.integer("--every", *every, 1, 1'000'000,
              "Try one way in N of the kinds of change that have at least 500");
    d.quick("--every", *every, 1009);
  };
  return {.name = "mutations",
          .purpose =
              "How many changes to a file a verification and a reader detect: flipped bits, holes, "
              "pages in the wrong place, wrong lengths, transfers as text, parts exchanged",
          .quick = "A few seconds: one way in 1009 of the kinds of change that have at least 500",
          .declare = declare,
          .run = [every](const Bench& bench) { return measure(*every, bench); }};
}

}  // namespace ptc::bench
