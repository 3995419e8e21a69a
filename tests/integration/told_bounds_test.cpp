// The bounds that a file says of its points save a pass over them, and may be wrong.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/convert/container_source.h"
#include "engine/store/reader.h"
#include "tests/io/las_files.h"
#include "tests/support/notes.h"
#include "tests/support/read_points.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;
using Catch::Matchers::Contains;

namespace {

/// A sheet of 200,000 points, of which the one at three quarters is at x = `odd`, hundredths.
std::string sheet(std::int32_t odd) {
  LasFile file{.points = 200'000};
  file.high = {4.99, 3.99, 0};
  for (std::int32_t i = 0; i < 200'000; ++i)
    file.records += las_point(i == 150'001 ? odd : i % 500, i / 500, 0);
  return file.bytes();
}

struct Built {
  ReadPoints points;
  Notes notes;
};

Built build(const std::filesystem::path& input, const std::filesystem::path& target, bool resume) {
  Built built;
  const BuildRequest request{.inputs = {input}, .profile = Profile::exact, .resume = resume};
  build_container(request, target, built.notes);
  const ContainerReader container(target);
  ContainerSource source(container);
  built.points = read_points(source);
  return built;
}

}  // namespace

TEST_CASE("bounds: a point beyond those of the header costs a second pass, and nothing else",
          "[integration]") {
  const TemporaryDirectory dir;
  const bool resume = GENERATE(false, true);
  const Built inside = build(dir.file("inside.las", sheet(0)), dir / "inside.ptcx", resume);
  CHECK(inside.points.surfels.size() == 200'000);
  for (const std::string& note : inside.notes.texts) CHECK_THAT(note, !Contains("bounds"));

  const Built beyond = build(dir.file("beyond.las", sheet(600)), dir / "beyond.ptcx", resume);
  CHECK(std::ranges::count_if(beyond.notes.texts, [](const std::string& note) {
          return note.find(
                     "beyond.las: a point lies outside the bounds of its header, so all "
                     "points are read once more") != std::string::npos;
        }) == 1);
  CHECK(beyond.points.surfels.size() == 200'000);
  CHECK(std::ranges::count_if(beyond.points.surfels, [](const Surfel& surfel) {
          return std::abs(surfel.position.x - 6) < 1e-9 && std::abs(surfel.position.y - 3) < 1e-9;
        }) == 1);
}
