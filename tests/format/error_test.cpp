// The text of a FormatError.
#include "format/error.h"

#include <catch2/catch.hpp>

using namespace ptc;

TEST_CASE("error: what() names the place, the fault and the clause", "[format][error]") {
  const FormatError error(16, "spec/container.md#directory", "pages overlap");
  CHECK(std::string(error.what()) == "offset 16: pages overlap (spec/container.md#directory)");
  const FormatError moved = error.rebased(4096, "scene.ptcx");
  CHECK(std::string(moved.what()) ==
        "scene.ptcx: offset 4112: pages overlap (spec/container.md#directory)");
  CHECK(moved.offset() == 4112);
  CHECK(moved.clause() == error.clause());
  CHECK(moved.text() == "pages overlap");
}

TEST_CASE("error: what() names the page when it is known, in whatever order it was set",
          "[format][error]") {
  const FormatError error(64, "spec/container.md#page-payload", "payload's checksum is wrong");
  CHECK_FALSE(error.page());
  for (const FormatError& told :
       {error.rebased(4096, "a.ptcx").in_page(66), error.in_page(66).rebased(4096, "a.ptcx"),
        error.in_page(1).in_page(66).rebased(4096, "a.ptcx")}) {
    CHECK(std::string(told.what()) ==
          "a.ptcx: offset 4160: page 66: payload's checksum is wrong "
          "(spec/container.md#page-payload)");
    CHECK(told.page() == 66U);
    CHECK(told.text() == error.text());
  }
}
