// What every program does with an error: exit code and message (tools/common.h).
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <functional>
#include <stdexcept>
#include <string>
#include <system_error>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "format/error.h"
#include "tools/common.h"
#include "tools/field_names.h"

namespace ptc {
namespace {

struct Ended {
  int code = 0;
  std::string errors;  ///< text on standard error
};

/// Runs a program with this body.
Ended run_program(const std::function<Outcome(Progress&)>& body) {
  std::FILE* const caught = std::tmpfile();
  REQUIRE(caught != nullptr);
  const int before = ::dup(STDERR_FILENO);
  ::dup2(::fileno(caught), STDERR_FILENO);
  Command command("ptctest", "A program under test.", "  ptctest\n");
  std::array<char, 8> name{"ptctest"};
  char* argument = name.data();
  const int code = command.run(1, &argument, body);
  std::fflush(stderr);
  ::dup2(before, STDERR_FILENO);
  ::close(before);
  std::string text(4096, '\0');
  std::rewind(caught);
  text.resize(std::fread(text.data(), 1, text.size(), caught));
  std::fclose(caught);
  return {code, text};
}

template <class Error>
Ended run_throwing(const Error& error) {
  return run_program([&](Progress&) -> Outcome { throw error; });
}

}  // namespace

TEST_CASE("command: each kind of error has an exit code of its own", "[cli]") {
  CHECK(run_program([](Progress&) -> Outcome { return {}; }).code == kDone);
  CHECK(run_throwing(DataError("a.ply: line 3: no number")).code == kInvalidData);
  CHECK(run_throwing(FormatError(0, "spec/container.md#header-magic", "no container")).code ==
        kInvalidData);
  CHECK(run_throwing(FormatError(0, "spec/container.md#header-version", "newer")).code ==
        kUnsupported);
  CHECK(run_throwing(RequestError("estimate", "`estimate` cannot be")).code == kUsage);
  CHECK(run_throwing(LimitError("the least that works is 60M")).code == kLimit);
  CHECK(run_throwing(std::system_error(ENOSPC, std::generic_category(), "pwrite a")).code ==
        kSystem);
  CHECK(run_throwing(std::bad_alloc()).code == kSystem);
  CHECK(run_throwing(std::runtime_error("Embree: no device")).code == kSystem);
}

TEST_CASE("command: a broken precondition ends as an internal error, not as a usage error",
          "[cli]") {
  const Ended ended = run_throwing(std::invalid_argument("container writer: a page written twice"));
  CHECK(ended.code == kInternal);
  CHECK(ended.errors ==
        "ptctest: internal error: container writer: a page written twice; this is a defect of the "
        "program, please report it\n");
  CHECK(run_throwing(std::out_of_range("at")).code == kInternal);
  CHECK(run_throwing(std::length_error("length")).code == kInternal);
}

TEST_CASE("command: messages name options in place of the fields of a request", "[cli]") {
  CHECK(run_throwing(RequestError("count", "`count` goes with a .ply")).errors ==
        "ptctest: --count goes with a .ply\n");
  CHECK(with_options("`estimate` needs `error` or `check`, too") ==
        "--estimate needs --error or --check, too");
  CHECK(with_options("`sampling.count` was '5', not '6'") == "--points was '5', not '6'");
  for (const char* kept : {"", "`", "``", "a `b", "`no field`", "no field", "a`b`c"})
    CHECK(with_options(kept) == kept);
  CHECK(with_options("`no field`count`") == "`no field--count");
  CHECK(option_of("run.temp_dirs") == "--temp");
  CHECK(option_of("temp_dirs").empty());
}

TEST_CASE("command: an error of a request says which field is wrong", "[cli]") {
  const RequestError error("sampling.spacing", "`sampling.spacing` is negative");
  CHECK(error.field() == "sampling.spacing");
  CHECK(std::string(error.what()) == "`sampling.spacing` is negative");
  CHECK(LimitError("too small").field() == "run.memory_bytes");
}

}  // namespace ptc
