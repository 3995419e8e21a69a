#include "engine/io/mesh/mesh_warnings.h"

#include <catch2/catch.hpp>

#include "engine/io/mesh/mesh.h"
#include "tests/io/files.h"

using namespace ptc;
using Lines = std::vector<std::string>;

TEST_CASE("mesh warnings: each kind is one line with a count and its first four parts",
          "[io][mesh]") {
  MeshWarnings warnings;
  CHECK(warnings.lines().empty());
  warnings.add(kSkinLeftOut, "skin 0");
  warnings.add(kEmissionAveraged, "'a'");
  warnings.add(kEmissionAveraged, "'b'");
  CHECK(warnings.lines() ==
        Lines{"a skin is left out and its mesh keeps the pose in which it is stored: skin 0",
              "2 emission textures are replaced by their means: 'a'; 'b'"});
  for (const char* more : {"'c'", "'d'"}) warnings.add(kEmissionAveraged, more);
  CHECK(warnings.lines()[1] ==
        "4 emission textures are replaced by their means: 'a'; 'b'; 'c'; 'd'");
  for (int i = 0; i < 1'000'000; ++i) warnings.add(kEmissionAveraged, "'e'");
  CHECK(warnings.lines()[1] ==
        "1000004 emission textures are replaced by their means: 'a'; 'b'; 'c'; 'd'; and 1000000 "
        "more");
}

TEST_CASE("mesh warnings: parts of one text are counted one by one", "[io][mesh]") {
  MeshWarnings warnings;
  for (int i = 0; i < 5; ++i) warnings.add(kEmissionAveraged, "material ''");
  CHECK(warnings.lines() ==
        Lines{"5 emission textures are replaced by their means: material ''; material ''; "
              "material ''; material ''; and 1 more"});
}

TEST_CASE("mesh warnings: a part is printed as one line of at most some 300 printable bytes",
          "[io][mesh]") {
  MeshWarnings warnings;
  warnings.add(kMaterialUndefined, "a\nb\x1b[2J\xff");
  warnings.add(kMaterialUndefined, std::string(299, 'x') + "\xc3\xa9 and so on");
  CHECK(warnings.lines() == Lines{"2 materials are not defined and become plain grey: "
                                  "a\\x0ab\\x1b[2J\\xff; " +
                                  std::string(299, 'x') + "..."});
}

TEST_CASE("mesh warnings: many undefined materials take one line", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (int i = 0; i < 1000; ++i) text += "usemtl m" + std::to_string(i) + "\nf 1 2 3\n";
  const MeshFile file = read_mesh(scratch.file("a.obj", text));
  CHECK(file.warnings == Lines{"1000 materials are not defined and become plain grey: 'm0'; 'm1'; "
                               "'m2'; 'm3'; and 996 more"});
}
