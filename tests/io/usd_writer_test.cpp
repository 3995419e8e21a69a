// USD as text, line by line, and as a crate file, section by section.
#include <map>
#include <sstream>

#include <catch2/catch.hpp>
#include <lz4.h>

#include "tests/io/files.h"
#include "tests/io/writer_inputs.h"

using namespace ptc;
using namespace ptc::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Equals;

namespace {

// A crate file, taken apart by rules that share nothing with the writer.
struct Crate {
  std::string bytes;
  std::map<std::string, std::pair<std::uint64_t, std::uint64_t>> sections;  // begin and size
  std::vector<std::string> tokens;

  explicit Crate(const std::filesystem::path& path) : bytes(slurp(path)) {
    const auto contents = number_at<std::uint64_t>(bytes, 16);
    const auto count = number_at<std::uint64_t>(bytes, contents);
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::size_t at = contents + 8 + 32 * i;
      sections[std::string(bytes.substr(at, 16).c_str())] = {
          number_at<std::uint64_t>(bytes, at + 16), number_at<std::uint64_t>(bytes, at + 24)};
    }
    CHECK(contents + 8 + 32 * count == bytes.size());
    const std::size_t at = sections.at("TOKENS").first;
    const std::string text = unpacked(at + 24, number_at<std::uint64_t>(bytes, at + 16),
                                      number_at<std::uint64_t>(bytes, at + 8));
    for (std::size_t i = 0; i < text.size(); i = text.find('\0', i) + 1)
      tokens.emplace_back(text.c_str() + i);
    CHECK(tokens.size() == number_at<std::uint64_t>(bytes, at));
  }

  // Returns `size` bytes that are compressed at `at`.
  [[nodiscard]] std::string unpacked(std::size_t at, std::size_t packed, std::size_t size) const {
    CHECK(bytes.at(at) == 0);  // one chunk
    std::string out(size, '\0');
    const int got = LZ4_decompress_safe(bytes.data() + at + 1, out.data(),
                                        static_cast<int>(packed - 1), static_cast<int>(size));
    out.resize(static_cast<std::size_t>(std::max(got, 0)));
    return out;
  }

  // Returns `count` integers that are compressed behind their size at `at`, which moves behind
  // them.
  [[nodiscard]] std::vector<std::int32_t> integers(std::size_t& at, std::size_t count) const {
    const auto packed = number_at<std::uint64_t>(bytes, at);
    const std::string plain = unpacked(at + 8, packed, 4 + (count + 3) / 4 + 4 * count);
    at += 8 + packed;
    const auto common = number_at<std::int32_t>(plain, 0);
    std::size_t next = 4 + (count + 3) / 4;
    std::vector<std::int32_t> values;
    std::int32_t value = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const int code = plain[4 + i / 4] >> 2 * (i % 4) & 3;
      if (code == 0) value += common;
      if (code == 1) value += number_at<std::int8_t>(plain, next);
      if (code == 2) value += number_at<std::int16_t>(plain, next);
      if (code == 3) value += number_at<std::int32_t>(plain, next);
      next += code == 0 ? 0U : 1U << (code - 1);
      values.push_back(value);
    }
    return values;
  }
};

}  // namespace

TEST_CASE("usda writer: a prim of type Points has all attributes", "[io][writers][usd]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(2);
  PointWriteInfo info = full_info(surfels);
  info.text = {{"up", "z"}, {"metres_per_unit", "0.3048"}};
  info.channels = {{.name = "occlusion"},
                   {.name = "bent", .components = 3, .role = ChannelRole::direction},
                   {.name = "sky",
                    .type = ChannelType::f32,
                    .components = 3,
                    .role = ChannelRole::colour,
                    .colour_space = ColourSpace::rec709},
                   {.name = "a.b", .type = ChannelType::u8, .components = 2},
                   {.name = "1st", .type = ChannelType::u32, .components = 2},
                   {.name = "_1st_0", .type = ChannelType::i64}};
  std::vector<std::byte> rows;
  for (int i = 0; i < 2; ++i) {
    for (const std::uint16_t half : std::initializer_list<std::uint16_t>{0x3800, 0x3c00, 0, 0x7c00})
      append_value(rows, half);
    for (const float v : {0.1F, 0.2F, 1e-9F}) append_value(rows, v);
    append_value(rows, std::uint8_t{255});
    append_value(rows, static_cast<std::uint8_t>(i));
    append_value(rows, std::uint32_t{4'000'000'000});
    append_value(rows, static_cast<std::uint32_t>(i));
    append_value(rows, std::int64_t{-9'000'000'000});
  }
  write_points(scratch / "a.usda", OutputFormat::usda, info, surfels, rows);
  const std::string each = "] (\n        interpolation = \"vertex\"\n    )\n";
  CHECK_THAT(slurp(scratch / "a.usda"),
             Equals("#usda 1.0\n(\n    defaultPrim = \"points\"\n    metersPerUnit = 0.3048\n"
                    "    upAxis = \"Z\"\n)\n\ndef Points \"points\"\n{\n"
                    "    float3[] extent = [(8.5, 18, -1.5), (12.5, 22, 1.75)]\n"
                    "    point3f[] points = [(10, 20.5, 0), (11, 19.5, 0.25)]\n"
                    "    normal3f[] normals = [(0, 0, 1), (0.6, -0.8, 0)" +
                    each + "    float[] widths = [1, 3" + each +
                    "    color3f[] primvars:displayColor = [(0.25, 1, 0), (0.25, 1, 0)" + each +
                    "    color3f[] primvars:radiance = [(0, 0, 0.125), (1, 2, 0.125)" + each +
                    "    color3f[] primvars:emission = [(0, 0, 3), (0, 1, 3)" + each +
                    "    float[] primvars:occlusion = [0.5, 0.5" + each +
                    "    normal3f[] primvars:bent = [(1, 0, inf), (1, 0, inf)" + each +
                    "    color3f[] primvars:sky = [(0.1, 0.2, 1e-09), (0.1, 0.2, 1e-09)" + each +
                    "    int2[] primvars:a_b = [(255, 0), (255, 1)" + each +
                    "    uint[] primvars:_1st_0 = [4000000000, 4000000000" + each +
                    "    uint[] primvars:_1st_1 = [0, 1" + each +
                    "    int64[] primvars:_1st_0_ = [-9000000000, -9000000000" + each + "}\n"));
}

TEST_CASE("usda writer: points far from the origin are moved, and a translation moves them back",
          "[io][writers][usd]") {
  const test::TemporaryDirectory scratch;
  std::vector<Surfel> surfels = surfels_of(2);
  for (Surfel& surfel : surfels) surfel.position += glm::dvec3(637'000, 848'000, 0);
  const PointWriteInfo info = plain_info(surfels);
  write_points(scratch / "a.usda", OutputFormat::usda, info, surfels);
  const std::string text = slurp(scratch / "a.usda");
  CHECK_THAT(text, Contains("    upAxis = \"Y\"\n"));
  CHECK_THAT(text, !Contains("metersPerUnit"));
  CHECK_THAT(text, Contains("point3f[] points = [(-0.5, 0.5, -0.125), (0.5, -0.5, 0.125)]\n"
                            "    double3 xformOp:translate = (637010.5, 848020, 0.125)\n"
                            "    uniform token[] xformOpOrder = [\"xformOp:translate\"]\n}\n"));
  CHECK(losses(OutputFormat::usda, info) ==
        std::vector<std::string>{"Positions are rounded to float, by up to 3e-08 units."});
}

TEST_CASE("usd writers: an upward axis that USD does not know is said", "[io][writers][usd]") {
  PointWriteInfo info;
  info.text["up"] = "x";
  CHECK(losses(OutputFormat::usdc, info).size() == 1);
  info.text["up"] = "z";
  CHECK(losses(OutputFormat::usdc, info).empty());
}

TEST_CASE("usdc writer: specs, fields and arrays are found by the rules of a crate file",
          "[io][writers][usd]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(20'000);  // more than one buffer for each column
  PointWriteInfo info = plain_info(surfels);
  info.has_radius = true;
  info.channels = {{.name = "id", .type = ChannelType::u64}};
  info.text["metres_per_unit"] = "0.01";
  std::vector<std::byte> rows;
  for (std::uint64_t i = 0; i < surfels.size(); ++i) append_value(rows, i << 33);
  write_points(scratch / "a.usdc", OutputFormat::usdc, info, surfels, rows);
  const Crate crate(scratch / "a.usdc");
  CHECK(crate.bytes.substr(0, 16) == std::string("PXR-USDC\0\x08\0\0\0\0\0\0", 16));

  // Read fields, sets, paths and specs
  std::size_t at = crate.sections.at("FIELDS").first;
  const auto field_count = number_at<std::uint64_t>(crate.bytes, at);
  at += 8;
  const std::vector<std::int32_t> names = crate.integers(at, field_count);
  const auto packed = number_at<std::uint64_t>(crate.bytes, at);
  const std::string values = crate.unpacked(at + 8, packed, 8 * field_count);
  at = crate.sections.at("FIELDSETS").first;
  const auto set_count = number_at<std::uint64_t>(crate.bytes, at);
  at += 8;
  const std::vector<std::int32_t> sets = crate.integers(at, set_count);
  CHECK(sets.back() == -1);
  at = crate.sections.at("PATHS").first;
  const auto path_count = number_at<std::uint64_t>(crate.bytes, at);
  CHECK(number_at<std::uint64_t>(crate.bytes, at + 8) == path_count);
  at += 16;
  const auto path_numbers = crate.integers(at, path_count);
  const auto path_names = crate.integers(at, path_count);
  const auto jumps = crate.integers(at, path_count);
  CHECK(jumps == std::vector<std::int32_t>{-1, -1, 0, 0, 0, -2});
  CHECK(path_numbers == std::vector<std::int32_t>{0, 1, 2, 3, 4, 5});
  at = crate.sections.at("SPECS").first;
  CHECK(number_at<std::uint64_t>(crate.bytes, at) == path_count);
  at += 8;
  CHECK(crate.integers(at, path_count) == path_numbers);
  const auto spec_sets = crate.integers(at, path_count);
  CHECK(crate.integers(at, path_count) == std::vector<std::int32_t>{7, 6, 1, 1, 1, 1});

  // Find the fields of each spec
  std::map<std::string, std::map<std::string, std::uint64_t>> specs;
  for (std::size_t i = 0; i < path_count; ++i) {
    const std::string name =
        i == 0 ? "/" : crate.tokens.at(static_cast<std::size_t>(std::abs(path_names[i])));
    CHECK((path_names[i] < 0) == (i > 1));
    for (auto k = static_cast<std::size_t>(spec_sets[i]); sets.at(k) >= 0; ++k) {
      const auto field = static_cast<std::size_t>(sets[k]);
      specs[i == 1 ? "prim" : name][crate.tokens.at(static_cast<std::size_t>(names.at(field)))] =
          number_at<std::uint64_t>(values, 8 * field);
    }
  }
  const auto token = [&](std::uint64_t value) {
    CHECK(value >> 48 == 0x400b);
    return crate.tokens.at(value & 0xffffffff);
  };
  CHECK(token(specs["/"]["defaultPrim"]) == "points");
  CHECK(token(specs["/"]["upAxis"]) == "Y");
  CHECK(specs["/"]["metersPerUnit"] >> 48 == 9);
  CHECK(number_at<double>(crate.bytes, specs["/"]["metersPerUnit"] & 0xffffffffffff) == 0.01);
  CHECK(token(specs["prim"]["typeName"]) == "Points");
  CHECK(specs["prim"]["specifier"] == std::uint64_t{0x402a} << 48);
  CHECK(token(specs["widths"]["interpolation"]) == "vertex");
  CHECK(token(specs["primvars:id"]["typeName"]) == "uint64[]");
  CHECK(token(specs["points"]["typeName"]) == "point3f[]");

  // Compare the arrays
  const auto array = [&](const char* name, std::uint64_t type) {
    const std::uint64_t value = specs[name]["default"];
    CHECK(value >> 48 == (0x8000 | type));
    const std::size_t place = value & 0xffffffffffff;
    CHECK(place % 8 == 0);
    CHECK(number_at<std::uint64_t>(crate.bytes, place) ==
          (name == std::string("extent") ? 2 : surfels.size()));
    return place + 8;
  };
  const std::size_t points = array("points", 24), widths = array("widths", 8),
                    ids = array("primvars:id", 6), extent = array("extent", 24);
  bool same = true;
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      same = same && number_at<float>(crate.bytes, points + 12 * i + 4 * k) ==
                         static_cast<float>(surfels[i].position[static_cast<int>(k)]);
    }
    same = same && number_at<float>(crate.bytes, widths + 4 * i) == 2 * surfels[i].radius;
    same = same && number_at<std::uint64_t>(crate.bytes, ids + 8 * i) == i << 33;
  }
  CHECK(same);
  CHECK(number_at<float>(crate.bytes, extent) == 10 - 19'999.5F);
}
