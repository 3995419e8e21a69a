// The conformance vectors of the specification: every good one is read whole, every bad one is
// refused by the rule that it is named after.
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <fmt/format.h>

#include "format/checksum.h"
#include "format/error.h"
#include "tests/store/sample.h"

using namespace ptc;
using namespace ptc::test;

namespace {

std::filesystem::path root() {
  return std::filesystem::path(PTC_SOURCE_DIR) / "spec/vectors";
}

std::vector<std::filesystem::path> vectors(const std::filesystem::path& directory) {
  std::vector<std::filesystem::path> found;
  for (const auto& entry : std::filesystem::directory_iterator(directory)) {
    if (entry.path().extension() == ".ptcx") found.push_back(entry.path());
  }
  REQUIRE_FALSE(found.empty());
  return found;
}

}  // namespace

TEST_CASE("vectors: every good vector is read whole", "[store][vectors]") {
  for (const auto& path : vectors(root() / "good")) {
    INFO(path);
    CHECK_FALSE(walk(path).empty());
  }
}

TEST_CASE("vectors: every good vector has the content that the second reader found",
          "[store][vectors]") {
  std::set<std::string> expected, found;
  std::ifstream table(root() / "good.txt");
  for (std::string line; std::getline(table, line);) expected.insert(line);
  for (const auto& path : vectors(root() / "good")) {
    constexpr auto kOwn = ContainerReader::OpenParts::no;  // the table speaks of one file
    const Superblock s = ContainerReader(path, kOwn).superblock();
    found.insert(fmt::format("{} {} {} {} {} {} {:016x}{:016x} {:016x}", path.stem().string(),
                             s.points, s.nodes, s.node_groups, s.levels, s.page_count,
                             s.content_xxh3[1], s.content_xxh3[0], xxh3_64(walk(path, kOwn))));
  }
  CHECK(found == expected);
}

TEST_CASE("vectors: every bad vector is refused by its rule", "[store][vectors]") {
  for (const auto& path : vectors(root() / "bad")) {
    INFO(path.filename());
    try {
      static_cast<void>(walk(path));
      FAIL_CHECK("not refused");
    } catch (const FormatError& error) {
      INFO(error.what());
      CHECK(error.clause() == rule_of(path));
    }
  }
}

TEST_CASE("vectors: a vector for verifiers is read whole or refused by its rule",
          "[store][vectors]") {
  for (const auto& path : vectors(root() / "verify")) {
    INFO(path.filename());
    try {
      CHECK_FALSE(walk(path).empty());
    } catch (const FormatError& error) {
      CHECK(error.clause() == rule_of(path));
    }
  }
}
