// Temporary names vanish when a signal ends the process.
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <optional>
#include <thread>

#include <catch2/catch.hpp>

#include "engine/io/file/file.h"
#include "tests/io/files.h"

using namespace ptc;

namespace {

// Runs `body` in a child process. @return its wait status
template <typename Body>
int in_child(Body body) {
  const pid_t child = ::fork();
  if (child == 0) {
    body();
    ::_exit(77);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return status;
}

}  // namespace

TEST_CASE("signals: a fatal signal removes the temporary files and ends the process as before",
          "[io][signal]") {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    const test::TemporaryDirectory scratch;
    const auto old = scratch.file("b", "old");
    const int status = in_child([&] {
      remove_temporaries_on_signal();
      const OutputFile first(scratch.path() / "a");
      const OutputFile second(scratch.path() / "b");
      OutputFile published(scratch.path() / "c");
      published.publish();
      const TemporaryName name(scratch.file("d", "published, and in use for a while"));
      ::raise(signal);
    });
    REQUIRE(WIFSIGNALED(status));
    CHECK(WTERMSIG(status) == signal);
    CHECK(scratch.listing() == "b c");
    CHECK(slurp(old) == "old");
  }
}

TEST_CASE("signals: an ignored signal stays ignored", "[io][signal]") {
  const int status = in_child([] {
    std::signal(SIGHUP, SIG_IGN);
    remove_temporaries_on_signal();
    ::raise(SIGHUP);
  });
  REQUIRE(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 77);
}

TEST_CASE("signals: a signal that arrives while threads make files leaves none behind",
          "[io][signal]") {
  for (int round = 0; round < 10; ++round) {
    const test::TemporaryDirectory scratch;
    const int status = in_child([&] {
      remove_temporaries_on_signal();
      std::atomic<int> made = 0;
      const auto churn = [&] {
        for (;;) {
          const OutputFile file(scratch.path() / "out");
          ++made;
        }
      };
      std::thread(churn).detach();
      std::thread(churn).detach();
      while (made < 5 + 5 * round) std::this_thread::yield();
      ::kill(::getpid(), SIGTERM);
      ::pause();
    });
    REQUIRE(WIFSIGNALED(status));
    CHECK(WTERMSIG(status) == SIGTERM);
    CHECK(scratch.listing().empty());
  }
}
