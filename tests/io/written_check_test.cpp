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
  Progress silent;
  WrittenCheck check(format, points.info);
  check.add(points.surfels, points.rows);
  write_points(path, format, written.info, written.surfels, written.rows);
  try {
    static_cast<void>(check.compare(path, silent));
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

TEST_CASE("written check: what a format rounds, cuts or holds otherwise is not refused",
          "[io][writers]") {
  const test::TemporaryDirectory scratch;
  Points points = make_points();
  const std::vector<Channel> odd{
      {.name = "scan_angle", .type = ChannelType::i16},
      {.name = "return_number", .type = ChannelType::u8},
      {.name = "classification", .type = ChannelType::u8, .no_value = 255},
      {.name = "gps_time", .type = ChannelType::f64, .no_value = 0x7ff8000000000000},
      {.name = "intensity", .type = ChannelType::u16, .no_value = 65535},
      {.name = "nir", .type = ChannelType::u8},
      {.name = "limit", .type = ChannelType::f64},
      {.name = "constant", .type = ChannelType::f32},
      {.name = "id", .type = ChannelType::u64},
      {.name = "signed", .type = ChannelType::i64},
      {.name = "time.of.day", .type = ChannelType::f64, .scale = 0.1, .offset = 3e8},
      {.name = "Label", .type = ChannelType::u8}};
  const auto colours =
      GENERATE_COPY(values({stored_colour(ChannelType::u8), stored_colour(ChannelType::u16),
                            stored_colour(ChannelType::u16, kByteScale)}));
  const bool dark = GENERATE(false, true);
  const double far = GENERATE(0.0, 4e6);
  points.info.channels = odd;
  points.info.channels.push_back(colours);
  points.rows.clear();
  points.info.bounds = {};
  for (std::size_t i = 0; i < points.surfels.size(); ++i) {
    points.surfels[i].position += far;
    points.info.bounds.add(points.surfels[i].position);
    const auto n = static_cast<std::uint16_t>(i);
    append_value(points.rows, static_cast<std::int16_t>(1000 - 100 * n));
    append_value(points.rows, static_cast<std::uint8_t>(n));  // beyond 15, too
    append_value(points.rows, static_cast<std::uint8_t>(n == 3 ? 255 : n));
    append_value(points.rows, n == 4 ? std::numeric_limits<double>::quiet_NaN() : 3e8 + n);
    append_value(points.rows, static_cast<std::uint16_t>(n == 5 ? 65535 : 100 * n));
    append_value(points.rows, static_cast<std::uint8_t>(10 * n));
    append_value(points.rows, n % 5 == 0 ? std::numeric_limits<double>::max() : n);
    append_value(points.rows, 0.141600609F);  // text has it with fewer digits
    append_value(points.rows, std::numeric_limits<std::uint64_t>::max() - n);
    append_value(points.rows, std::numeric_limits<std::int64_t>::min() + n);
    append_value(points.rows, 17.0 * n);
    append_value(points.rows, static_cast<std::uint8_t>(n));
    for (int k = 0; k < 3; ++k) {
      const auto value = static_cast<std::uint16_t>(dark ? 0 : 12 * n);
      if (colours.type == ChannelType::u8)
        append_value(points.rows, static_cast<std::uint8_t>(value));
      if (colours.type != ChannelType::u8) append_value(points.rows, value);
    }
  }
  for (const auto& [name, format] : kRead) {
    CAPTURE(name, colours.scale, dark, far);
    CHECK(said_of(scratch / name, format, points, points) == "");
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
      {"20 points were written, but the file, which is kept, has 19",
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
      {": warmth was written with 20 values from 280 to 299, 289.5 in the mean, but the file, "
       "which is kept, has "
       "20 values from 280 to 299, 288.5",
       [](Points& p) {
         const float less = 280;  // of one point alone
         for (const std::size_t i : {5U, 6U, 7U, 1U}) std::memcpy(&p.rows[i * 16], &less, 4);
       }},
      {"the file, which is kept, has them at other points",
       [](Points& p) { std::swap_ranges(&p.rows[0], &p.rows[4], &p.rows[19 * 16]); }},
      {": flow_g was written with", [](Points& p) {
         for (std::size_t i = 0; i < 20; ++i)
           std::swap_ranges(&p.rows[i * 16 + 8], &p.rows[i * 16 + 12], &p.rows[i * 16 + 12]);
       }}};
  for (const auto& [name, format] : kRead) {
    for (const Case& c : cases) {
      CAPTURE(name, c.said);
      // What is reflected is told from `_radiosity`, which has what is emitted, too
      const std::string said = c.said;
      if (format == OutputFormat::ptc && said == "has no values") continue;
      // The albedo is the colour that viewers of LAS see, which may be another
      if (format == OutputFormat::las && said.starts_with(": albedo")) continue;
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
  Progress silent;
  WrittenCheck check(OutputFormat::ply, points.info);
  check.add(points.surfels, points.rows);
  points.info.channels[0].name = "heat";
  write_points(scratch / "a.ply", OutputFormat::ply, points.info, points.surfels, points.rows);
  CHECK(check.compare(scratch / "a.ply", silent) == std::vector<std::string>{"warmth"});
}
