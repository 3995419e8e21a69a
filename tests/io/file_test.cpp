// Whole reads and writes, and publication by rename.
#include "engine/io/file/file.h"

#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/file/temporary_name.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::Contains;

namespace {

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

std::string read_text(const auto& file, std::uint64_t offset, std::size_t count) {
  std::string text(count, '?');
  file.read_at(offset, std::as_writable_bytes(std::span(text.data(), text.size())));
  return text;
}

int error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::system_error& error) {
    return error.code().value();
  }
  return 0;
}

// Makes writes beyond this many bytes of a file fail while it lives, as on a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() { ::setrlimit(RLIMIT_FSIZE, &before_); }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_{};
};

}  // namespace

TEST_CASE("input file: ranges inside the file are read, ranges past its end are refused",
          "[io][file]") {
  const test::TemporaryDirectory scratch;
  const InputFile file(scratch.file("f", "0123456789"));
  CHECK(file.size() == 10);
  for (std::size_t offset = 0; offset <= 12; ++offset) {
    for (std::size_t count = 1; count <= 12; ++count) {
      if (offset + count <= 10) {
        CHECK(read_text(file, offset, count) == std::string("0123456789").substr(offset, count));
      } else {
        CHECK_THROWS_AS(read_text(file, offset, count), DataError);
      }
    }
  }
  CHECK(read_text(file, 100, 0).empty());
  CHECK(refusal([&] { static_cast<void>(read_text(file, 8, 5)); }) ==
        file.path().string() + ": offset 10: the file ends here and 3 bytes are missing");
  CHECK(error_of([&] { static_cast<void>(read_text(file, UINT64_MAX - 1, 1)); }) == EOVERFLOW);
}

TEST_CASE("input file: anything but a regular file is refused by name", "[io][file]") {
  const test::TemporaryDirectory scratch;
  CHECK(error_of([&] { const InputFile file(scratch.path()); }) == EISDIR);
  CHECK(error_of([&] { const InputFile file(scratch.path() / "none"); }) == ENOENT);
  REQUIRE(::mkfifo((scratch.path() / "pipe").c_str(), 0600) == 0);
  CHECK(error_of([&] { const InputFile file(scratch.path() / "pipe"); }) == ESPIPE);
  CHECK_THAT(refusal([&] { const InputFile file(scratch.path() / "none"); }),
             Contains("open " + (scratch.path() / "none").string()));
}

TEST_CASE("input file: a moved-from file is closed once", "[io][file]") {
  const test::TemporaryDirectory scratch;
  InputFile first(scratch.file("f", "abc"));
  const InputFile second(std::move(first));
  CHECK(read_text(second, 0, 3) == "abc");
  CHECK(first.descriptor() == -1);
}

TEST_CASE("output file: the old file stays until the new one is published", "[io][file]") {
  const test::TemporaryDirectory scratch;
  const auto target = scratch.file("out", "old");
  {
    OutputFile file(target);
    CHECK(file.temporary().parent_path() == target.parent_path());
    CHECK_THAT(file.temporary().filename().string(),
               Catch::Matchers::StartsWith(".out.tmp-") &&
                   Catch::Matchers::Contains("-" + std::to_string(::getpid()) + "-"));
    file.append(bytes_of("new text"));
    file.write_at(4, bytes_of("TEXT"));
    file.sync();
    CHECK(file.size() == 8);
    CHECK(slurp(target) == "old");
    file.publish();
    CHECK(slurp(target) == "new TEXT");
  }
  CHECK(scratch.listing() == "out");
}

TEST_CASE("temporary name: no two are the same, and what ended processes left is known",
          "[io][file]") {
  const test::TemporaryDirectory scratch;
  const auto target = scratch.path() / "out";
  CHECK(temporary_name(target) != temporary_name(target));
  CHECK(temporary_name(scratch.path() / std::string(250, 'x')).filename().string().size() < 256);
  // Two processes of one number, as in two containers: the counter of each begins anew
  const auto of_child = [&] {
    std::array<int, 2> ends{};
    REQUIRE(::pipe(ends.data()) == 0);
    const pid_t child = ::fork();
    if (child == 0) {
      const std::string name = temporary_name(target).filename().string();
      static_cast<void>(!::write(ends[1], name.data(), name.size()));
      ::_exit(0);
    }
    ::waitpid(child, nullptr, 0);
    std::string name(256, '\0');
    name.resize(static_cast<std::size_t>(::read(ends[0], name.data(), name.size())));
    for (const int end : ends) ::close(end);
    return name;
  };
  const std::string a = of_child(), b = of_child();
  const auto random_of = [](const std::string& name) {
    return name.substr(name.rfind('-') - 8, 8);
  };
  CHECK(random_of(a) != random_of(b));

  // A file that a child has left is a leftover; files of this process and others are none
  CHECK(is_leftover(scratch.file(a, "left")));
  CHECK_FALSE(is_leftover(scratch.file(temporary_name(target).filename().string(), "in use")));
  for (const char* name : {"out", ".out.tmp-", ".out.tmp-host", ".out.tmp-host-x-0-0"})
    CHECK_FALSE(is_leftover(scratch.file(name, "")));
}

TEST_CASE("output file: without publish() nothing is left", "[io][file]") {
  const test::TemporaryDirectory scratch;
  {
    OutputFile file(scratch.path() / "out");
    file.append(bytes_of("lost"));
    CHECK(scratch.listing() == file.temporary().filename().string());
  }
  CHECK(scratch.listing().empty());
}

TEST_CASE("output file: a write that fails leaves the old file, whichever write it is",
          "[io][file]") {
  const test::TemporaryDirectory scratch;
  const auto target = scratch.file("out", "old");
  for (rlim_t limit = 0; limit < 40; limit += 4) {
    const FileSizeLimit full(limit);
    CHECK(error_of([&] {
            OutputFile file(target);
            for (int i = 0; i < 5; ++i) file.append(bytes_of("01234567"));
            file.publish();
          }) == EFBIG);
    CHECK(slurp(target) == "old");
    CHECK(scratch.listing() == "out");
  }
}

TEST_CASE("output file: what another program put in the place of its source is kept",
          "[io][file]") {
  const test::TemporaryDirectory scratch;
  const auto target = scratch.file("out", "old");
  std::filesystem::create_symlink("out", scratch.path() / "link");
  for (const char* name : {"out", "link"}) {
    const InputFile source(scratch.path() / name);
    OutputFile other(target);
    other.append(bytes_of("other"));
    other.publish(&source);
    // The file is created after the source was replaced, which must not hide that it was.
    OutputFile late(target);
    CHECK_THROWS_WITH(late.publish(&source),
                      target.string() +
                          ": another program replaced this file in the meantime; "
                          "run this again");
    CHECK(slurp(target) == "other");
    OutputFile elsewhere(scratch.path() / "new");
    elsewhere.append(bytes_of("new"));
    elsewhere.publish(&source);
    CHECK(slurp(scratch.path() / "new") == "new");
  }
}

TEST_CASE("output file: directories and devices are refused as targets", "[io][file]") {
  const test::TemporaryDirectory scratch;
  CHECK(error_of([&] { OutputFile file(scratch.path()); }) == EISDIR);
  CHECK(error_of([&] { OutputFile file(scratch.path() / "name" / ""); }) == EISDIR);
  CHECK(error_of([&] { OutputFile file(scratch.path() / "."); }) == EISDIR);
  CHECK(error_of([&] { OutputFile file("/dev/null"); }) == EINVAL);
  CHECK(error_of([&] { OutputFile file(scratch.path() / "none" / "out"); }) == ENOENT);
  CHECK(scratch.listing().empty());
}

TEST_CASE("output file: a link stays a link and permissions stay", "[io][file]") {
  const test::TemporaryDirectory scratch;
  const auto real = scratch.file("real", "old");
  REQUIRE(::chmod(real.c_str(), 0640) == 0);
  std::filesystem::create_symlink("real", scratch.path() / "link");
  OutputFile file(scratch.path() / "link");
  file.append(bytes_of("new"));
  file.publish();
  CHECK(std::filesystem::is_symlink(scratch.path() / "link"));
  CHECK(slurp(real) == "new");
  struct stat status {};
  REQUIRE(::stat(real.c_str(), &status) == 0);
  CHECK((status.st_mode & 0777) == 0640);
}

TEST_CASE("output file: a name of the maximum length is published", "[io][file]") {
  const test::TemporaryDirectory scratch;
  OutputFile file(scratch.path() / std::string(255, 'n'));
  file.publish();
  CHECK(scratch.listing() == std::string(255, 'n'));
}

TEST_CASE("output file: threads write disjoint ranges", "[io][file]") {
  const test::TemporaryDirectory scratch;
  OutputFile file(scratch.path() / "out");
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < 4; ++t) {
    threads.emplace_back([&file, t] {
      const std::string text(1000, static_cast<char>('a' + t));
      for (std::size_t i = 0; i < 10; ++i) file.write_at((4 * i + t) * 1000, bytes_of(text));
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(file.size() == 40000);
  file.publish();
  const std::string all = slurp(file.target());
  REQUIRE(all.size() == 40000);
  for (std::size_t i = 0; i < 40; ++i) {
    CHECK(all.substr(i * 1000, 1000) == std::string(1000, static_cast<char>('a' + i % 4)));
  }
}

TEST_CASE("temp file: it has no name and keeps what is written", "[io][file]") {
  const test::TemporaryDirectory scratch;
  TempFile first(scratch.path());
  CHECK(scratch.listing().empty());
  first.write_at(5, bytes_of("hello"));
  TempFile file(std::move(first));
  CHECK(read_text(file, 5, 5) == "hello");
  CHECK(read_text(file, 0, 5) == std::string(5, '\0'));
  CHECK_THROWS_AS(read_text(file, 6, 5), DataError);
  CHECK(error_of([&] { const TempFile none(scratch.path() / "none"); }) == ENOENT);
}
