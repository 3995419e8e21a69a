// A file that was written must hold what went into it.
#include "engine/io/cloud/written_check.h"

#include <functional>

#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "format/bytes.h"
#include "tests/io/files.h"
#include "tests/io/writer_inputs.h"

using namespace ptc;
using namespace ptc::test;
using Catch::Matchers::Contains;

namespace {

constexpr std::array kRead = {
    std::pair{"a.bgeo", OutputFormat::bgeo}, std::pair{"a.las", OutputFormat::las},
    std::pair{"a.pcd", OutputFormat::pcd},   std::pair{"a.ply", OutputFormat::ply},
    std::pair{"a.ptc", OutputFormat::ptc},   std::pair{"a.xyz", OutputFormat::xyz}};

// Points with two channels.
struct Points {
  PointWriteInfo info;
  std::vector<Surfel> surfels;
  std::vector<std::byte> rows;
};

Points make_points() {
  Points points;
  points.surfels = surfels_of(20);
  points.info = full_info(points.surfels);
  points.info.channels = {{.name = "warmth", .type = ChannelType::f32},
                          {.name = "flow", .type = ChannelType::f32, .components = 3}};
  for (int i = 0; i < 20; ++i) {
    append_value(points.rows, 280.0F + static_cast<float>(i));
    for (int k = 0; k < 3; ++k) append_value(points.rows, static_cast<float>(k * i));
  }
  return points;
}

// Returns what the comparison with `points` says of a file that holds `written`.
std::string said_of(const std::filesystem::path& path, OutputFormat format, const Points& points,
                    const Points& written) {
  WrittenCheck check(format, points.info);
  check.add(points.surfels, points.rows);
  write_points(path, format, written.info, written.surfels, written.rows);
  try {
    static_cast<void>(check.compare(path));
  } catch (const DataError& error) {
    return error.what();
  }
  return {};
}

}  // namespace

TEST_CASE("written check: every format gives back what was written", "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const Points points = make_points();
  for (const auto& [name, format] : kRead) {
    CAPTURE(name);
    CHECK(said_of(scratch / name, format, points, points).empty());
  }
}

TEST_CASE("written check: a number that differs is named with its values", "[io][writers]") {
  const test::TemporaryDirectory scratch;
  const Points points = make_points();
  struct Case {
    const char* said;
    std::function<void(Points&)> change;
  };
  const auto each = [](auto change) {
    return [change](Points& p) {
      for (Surfel& surfel : p.surfels) change(surfel);
    };
  };
  const std::vector<Case> cases{
      {"20 points were written, but the file has 19",
       [](Points& p) {
         p.surfels.pop_back();
         p.rows.resize(p.rows.size() * 19 / 20);
         p.info.count = 19;
       }},
      {": x was written with", each([](Surfel& s) { std::swap(s.position.x, s.position.y); })},
      {": nx was written with", each([](Surfel& s) { s.normal = -s.normal; })},
      {"has no values", [](Points& p) { p.info.has_radiance = false; }},
      {": radius was written with", each([](Surfel& s) { s.radius *= 1.01F; })},
      {": albedo_r was written with", each([](Surfel& s) { s.albedo.r += 0.1F; })},
      {": emission_g was written with", each([](Surfel& s) { s.emission.g *= 2; })},
      {": warmth was written with 20 values from 280 to 299, 289.5 in the mean, but the file has "
       "20 values from 280 to 299, 288.5",
       [](Points& p) {
         const float less = 280;  // of one point alone
         for (const std::size_t i : {5U, 6U, 7U, 1U}) std::memcpy(&p.rows[i * 16], &less, 4);
       }},
      {": flow_g was written with", [](Points& p) {
         for (std::size_t i = 0; i < 20; ++i)
           std::swap_ranges(&p.rows[i * 16 + 8], &p.rows[i * 16 + 12], &p.rows[i * 16 + 12]);
       }}};
  for (const auto& [name, format] : kRead) {
    for (const Case& c : cases) {
      CAPTURE(name, c.said);
      // What is reflected is told from `_radiosity`, which has what is emitted, too
      if (format == OutputFormat::ptc && c.said == std::string("has no values")) continue;
      Points changed = points;
      c.change(changed);
      changed.info.bounds = {};
      for (const Surfel& surfel : changed.surfels) changed.info.bounds.add(surfel.position);
      CHECK_THAT(said_of(scratch / name, format, points, changed),
                 Contains(name) && Contains(c.said));
    }
  }
}

TEST_CASE("written check: channels that a file has under other names are told", "[io][writers]") {
  const test::TemporaryDirectory scratch;
  Points points = make_points();
  WrittenCheck check(OutputFormat::ply, points.info);
  check.add(points.surfels, points.rows);
  points.info.channels[0].name = "heat";
  write_points(scratch / "a.ply", OutputFormat::ply, points.info, points.surfels, points.rows);
  CHECK(check.compare(scratch / "a.ply") == std::vector<std::string>{"warmth"});
}
