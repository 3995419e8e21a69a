// The words of a FormatError.
#include "format/error.h"

#include <catch2/catch.hpp>

using namespace ptc;

TEST_CASE("error: what() says where, what and which clause", "[format][error]") {
  const FormatError error(16, "spec/container.md#directory", "pages overlap");
  CHECK(std::string(error.what()) == "offset 16: pages overlap (spec/container.md#directory)");
  const FormatError moved = error.rebased(4096, "scene.ptcx");
  CHECK(std::string(moved.what()) ==
        "scene.ptcx: offset 4112: pages overlap (spec/container.md#directory)");
  CHECK(moved.offset() == 4112);
  CHECK(moved.clause() == error.clause());
  CHECK(moved.text() == "pages overlap");
}
