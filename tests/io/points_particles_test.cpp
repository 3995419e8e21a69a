// Clouds from formats of particles: Pixar's PTC, Houdini's BGEO and GEO, Maya's PDB.
#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "engine/io/cloud/point_writer.h"
#include "tests/io/clouds.h"

using namespace ptc;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;

namespace {

template <typename T>
std::string big(T value) {
  std::string bytes = raw(value);
  std::ranges::reverse(bytes);
  return bytes;
}

std::string big_text(const std::string& text) {
  return big(static_cast<std::uint16_t>(text.size())) + text;
}

// A PTC with these channels and points.
std::string ptc_file(double count, std::uint32_t channels, std::uint32_t floats,
                     const std::string& names, const std::string& points) {
  return "pptc" + raw(0U) + raw(count) + std::string(24 + 64 + 64 + 12, 'u') + raw(channels) +
         raw(floats) + names + points;
}

std::string ptc_point(float x, std::uint16_t a, std::uint16_t b, float radius) {
  return raw(x) + raw(2.0F) + raw(3.0F) + raw(a) + raw(b) + raw(radius);
}

std::string good_ptc() {
  std::string points;
  for (int i = 0; i < 2; ++i) {
    points += ptc_point(static_cast<float>(i), i == 0 ? 0 : 49151, i == 0 ? 65535 : 32768, 0.5F);
    points += raw(7.0F) + raw(0.1F) + raw(0.2F) + raw(0.3F);
    for (int k = 0; k < 16; ++k) points += raw(static_cast<float>(k));
  }
  return ptc_file(2, 3, 20, "float area\ncolor _radiosity\nmatrix m\n", points);
}

// The header of a BGEO with attributes, before its points.
std::string bgeo_header(std::int32_t points, std::int32_t primitives, std::int32_t attributes) {
  return "BgeoV" + big(std::int32_t{5}) + big(points) + big(primitives) + big(std::int32_t{0}) +
         big(std::int32_t{0}) + big(attributes) + big(std::int32_t{0}) + big(std::int32_t{0}) +
         big(std::int32_t{0});
}

std::string bgeo_attribute(const std::string& name, std::uint16_t size, std::int32_t type) {
  return big_text(name) + big(size) + big(type) + std::string(std::size_t{4} * size, 'd');
}

std::string good_bgeo() {
  std::string file = bgeo_header(2, 1, 5);
  file += bgeo_attribute("N", 3, 5) + bgeo_attribute("Cd", 3, 0) + bgeo_attribute("pscale", 1, 0);
  file += bgeo_attribute("id", 1, 1);
  file += big_text("kind") + big(std::uint16_t{1}) + big(std::int32_t{4}) + big(std::int32_t{2}) +
          big_text("first") + big_text("");
  for (int i = 0; i < 2; ++i) {
    for (const float p : {static_cast<float>(i), 2.0F, 3.0F, 1.0F}) file += big(p);
    for (const float n : {0.0F, 0.0F, -2.0F}) file += big(n);
    for (const float c : {0.25F, 1.5F, 0.0F}) file += big(c);
    file += big(0.125F) + big(std::int32_t{-5 - i}) + big(std::int32_t{i});
  }
  return file;
}

const std::string kGeo =
    "PGEOMETRY V5\nNPoints 2 NPrims 1\nNPointGroups 0 NPrimGroups 0\n"
    "NPointAttrib 5 NVertexAttrib 0 NPrimAttrib 0 NAttrib 0\nPointAttrib\n"
    "N 3 vector 0 0 0\nCd 3 float 1 1 1\npscale 1 float 1\nid 1 int -1\n\n"
    "kind 1 index 2 first second\n"
    "0 2 3 1 (0 0 -2\t0.25 1.5 0\t0.125\t-5\t0)\n1 2 3 1 (0 0 -2\t0.25 1.5 0\t0.125\t-6\t1)\n"
    "Run 1 Poly\n";

// A channel of a PDB.
std::string pdb_channel(const std::string& name, std::uint32_t type, std::uint32_t bytes,
                        std::uint32_t count, const std::string& values) {
  return raw(128611U) + std::string(38, 's') + name + std::string(1, '\0') + raw(type) +
         raw(bytes) + raw(count) + raw(1U) + raw(0U) + values;
}

std::string pdb_header(std::uint32_t particles, std::uint32_t channels) {
  return raw(670U) + raw(1U) + raw(1.0F) + raw(0.0F) + raw(particles) + raw(channels) +
         std::string(36, '\0');
}

std::string good_pdb() {
  return pdb_header(2, 4) +
         pdb_channel("position", 1, 12, 2,
                     raw(1.0F) + raw(2.0F) + raw(3.0F) + raw(4.0F) + raw(5.0F) + raw(6.0F)) +
         pdb_channel("life", 2, 8, 2, std::string(16, 'x')) +
         pdb_channel("id", 3, 4, 2, raw(-7) + raw(8)) +
         pdb_channel("radiusPP", 2, 4, 2, raw(0.5F) + raw(0.25F));
}

void check_geo(const Cloud& cloud) {
  REQUIRE(cloud.surfels.size() == 2);
  CHECK(cloud.surfels[1].position == glm::dvec3(1, 2, 3));
  CHECK(cloud.surfels[0].normal == glm::vec3(0, 0, -1));
  CHECK(cloud.surfels[0].radius == 0.125F);
  CHECK(cloud.surfels[0].albedo == glm::vec3(0.25F, 1, 0));
  CHECK(cloud.names() == "rgb id kind");
  CHECK(cloud.value(0, "rgb", 1) == 1.5);
  CHECK(cloud.channel("rgb").colour_space == ColourSpace::rec709);
  CHECK(cloud.value(1, "id") == -6);
  CHECK(cloud.channel("id").type == ChannelType::i32);
  CHECK(cloud.value(1, "kind") == 1);
  CHECK(cloud.channel("kind").role == ChannelRole::label);
  CHECK(cloud.notes() ==
        "The texts of the attribute 'kind' are left out; their numbers are kept.\n"
        "1 primitives and what belongs to them are left out.");
}

}  // namespace

TEST_CASE("ptc: positions, normals, radii, radiance and channels are read", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const Cloud cloud = read_cloud(scratch.file("a.ptc", good_ptc()));
  REQUIRE(cloud.surfels.size() == 2);
  CHECK(cloud.surfels[1].position == glm::dvec3(1, 2, 3));
  CHECK(cloud.surfels[0].normal.z == Approx(1));
  // Angle 3/4 of a turn, less half a turn: +x.
  CHECK(cloud.surfels[1].normal.x == Approx(1).margin(1e-4));
  CHECK(cloud.surfels[1].normal.z == Approx(0).margin(1e-4));
  CHECK(cloud.surfels[0].radius == 0.5F);
  CHECK(cloud.surfels[0].radiance == glm::vec3(0.1F, 0.2F, 0.3F));
  CHECK(cloud.names() == "area m");
  CHECK(cloud.value(0, "area") == 7);
  CHECK(cloud.channel("m").components == 16);
  CHECK(cloud.value(1, "m", 15) == 15);
  CHECK(cloud.notes() == "The channel '_radiosity' is taken as radiance, emission or albedo.");
}

TEST_CASE("ptc: every truncation and every longer file is refused", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string whole = good_ptc();
  for (std::size_t size = 1; size < whole.size(); ++size) {
    INFO(size);
    CHECK_FALSE(cloud_fault(scratch, "a.ptc", whole.substr(0, size)).empty());
  }
  CHECK(cloud_fault(scratch, "a.ptc", whole + "x") ==
        "offset " + std::to_string(whole.size()) + ": the file has more data than its header says");
}

TEST_CASE("ptc: a header that breaks a rule is refused", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto fault = [&](const std::string& text) { return cloud_fault(scratch, "a.ptc", text); };
  CHECK(fault("qqtc" + good_ptc().substr(4)) == "offset 0: not a PTC file");
  std::string later = good_ptc();
  later[4] = 1;
  CHECK(fault(later) == "offset 4: the PTC version is not 0");
  for (const double count : {-1.0, 0.5, 1e300, static_cast<double>(NAN)})
    CHECK(fault(ptc_file(count, 0, 0, "", "")) == "offset 8: the number of points is not a count");
  CHECK(fault(ptc_file(1e15, 0, 0, "", ptc_point(0, 0, 0, 0))) ==
        "offset 8: the PTC header counts 1000000000000000 points, more than the file can hold");
  CHECK(fault(ptc_file(1, 0xffffffff, 0xffffffff, "", "")) ==
        "offset 180: the PTC channels have no or more than 4096 numbers in a point");
  CHECK(fault(ptc_file(0, 1, 1, "string a\n", "")) ==
        "offset 188: a channel is not a known type and a name");
  CHECK(fault(ptc_file(0, 1, 2, "float a\n", "")) ==
        "offset 184: the channels have another number of floats than the header says");
  CHECK_THAT(fault(ptc_file(1, 0, 0, "", ptc_point(0, 0, 0, -1))),
             Contains("offset 188: point 0: the radius is negative"));
}

TEST_CASE("bgeo: binary and text give the same points", "[io][points]") {
  const test::TemporaryDirectory scratch;
  check_geo(read_cloud(scratch.file("a.bgeo", good_bgeo())));
  check_geo(read_cloud(scratch.file("a.geo", kGeo)));
  check_geo(read_cloud(scratch.file("a.bgeo", good_bgeo() + "primitives")));
}

TEST_CASE("bgeo: attributes have the same names and bits after they were read and written",
          "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto attribute = [](const char* name, std::uint16_t size, std::int32_t type) {
    return big_text(name) + big(size) + big(type) + std::string(std::size_t{4} * size, '\0');
  };
  const auto file = [&](const char* normal, const char* radius, const char* radiance) {
    std::string bytes = bgeo_header(1, 0, 8);
    bytes += attribute(normal, 3, 5) + attribute("Cd", 3, 0) + attribute(radius, 1, 0);
    bytes += attribute(radiance, 3, 0) + attribute("emission", 3, 0) + attribute("rgb", 3, 1);
    bytes += attribute("trailLength", 1, 0) + attribute("v-2", 3, 5);
    for (const float v : {1.0F, 2.0F, 3.0F, 1.0F, 0.0F, 0.0F, 1.0F, 0.25F, 7.5F, -0.125F, 0.5F,
                          4.0F, 5.0F, 6.0F, 0.0F, 8.0F, 9.0F})
      bytes += big(v);
    for (const std::int32_t v : {1, 0, -1}) bytes += big(v);
    for (const float v : {10.0F, 11.0F, 12.0F, 13.0F}) bytes += big(v);
    return bytes + std::string("\x00\xff", 2);
  };
  const auto again = [&](const std::string& bytes) {
    const Cloud cloud = read_cloud(scratch.file("a.bgeo", bytes));
    const PointFileInfo& from = cloud.info;
    PointWriteInfo info{.count = 1, .channels = from.channels, .text = from.text};
    info.has_normals = from.has_normals;
    info.has_radius = from.has_radius;
    info.has_radiance = from.has_radiance;
    info.has_albedo = from.has_albedo;
    info.emits = from.has_emission;
    const auto writer = create_points(scratch / "b.bgeo", OutputFormat::bgeo, info);
    writer->write(cloud.surfels, cloud.rows);
    writer->finish();
    return slurp(scratch / "b.bgeo");
  };
  CHECK(again(file("N", "pscale", "radiance")) == file("N", "pscale", "radiance"));
  CHECK(again(file("normal", "radiusPP", "_radiosity")) ==
        file("normal", "radiusPP", "_radiosity"));
  CHECK(again(file("normal", "radius", "Ci")) == file("normal", "radius", "Ci"));
}

TEST_CASE("bgeo: names of attributes that cannot be kept give way to those of the channels",
          "[io][points]") {
  const test::TemporaryDirectory scratch;
  const Cloud odd = read_cloud(scratch.file(
      "a.bgeo", bgeo_header(0, 0, 2) + bgeo_attribute("\xff", 1, 0) + bgeo_attribute("X", 1, 0)));
  CHECK(odd.info.text.at("bgeo.names") == R"({"x":"X"})");
  PointWriteInfo info{.channels = {{.name = "x"}, {.name = "y"}, {.name = "z"}, {.name = "w"}}};
  const auto names = [&](const std::string& text) {
    info.text["bgeo.names"] = text;
    create_points(scratch / "b.bgeo", OutputFormat::bgeo, info)->finish();
    const Cloud back = read_cloud(scratch / "b.bgeo");
    const auto kept = back.info.text.find("bgeo.names");
    return back.names() + (kept == back.info.text.end() ? "" : " " + kept->second);
  };
  for (const char* bad : {"", "no", "[]", "{\"x\":1}", "{\"x\":\"\"}"})
    CHECK(names(bad) == "x y z w");
  // Cd is the colour's, w another channel's, and A can be taken once
  CHECK(names(R"({"w":"A","x":"Cd","y":"w","z":"A"})") == R"(x y a w {"a":"A"})");
  // What takes more than 1 KiB is not kept
  CHECK(names(R"({"x":")" + std::string(980, 'X') + "\"}").size() > 1000);
  CHECK(names(R"({"x":")" + std::string(1100, 'X') + "\"}") == std::string(31, 'x') + " y z w");
}

TEST_CASE("bgeo: every truncation within the points is refused", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string whole = good_bgeo();
  for (std::size_t size = 1; size < whole.size(); ++size) {
    INFO(size);
    CHECK_FALSE(cloud_fault(scratch, "a.bgeo", whole.substr(0, size)).empty());
  }
  for (std::size_t size = 9; size < kGeo.find("1)\nRun"); ++size) {
    INFO(size);
    CHECK_FALSE(cloud_fault(scratch, "a.geo", kGeo.substr(0, size)).empty());
  }
}

TEST_CASE("bgeo: later formats and unknown types are refused by name", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto fault = [&](const std::string& bytes) {
    return cloud_fault(scratch, "a.bgeo", bytes);
  };
  for (const std::string json : {"\x7fNSJb\x01", "[\n\t\"fileversion\",\"18.0.1\"]"}) {
    CHECK(fault(json) ==
          "offset 0: a geometry in the JSON format of Houdini 12 and later is not supported: save "
          "it as classic .bgeo (version 5)");
  }
  CHECK(fault("Bgeo") == "offset 0: not a classic BGEO or GEO file");
  CHECK(fault("BgeoV" + big(std::int32_t{6})) == "offset 5: the version of the BGEO is not 5");
  CHECK_THAT(fault(bgeo_header(-1, 0, 0)), EndsWith("a count in the BGEO header is negative"));
  CHECK(fault(bgeo_header(2147483647, 0, 0) + "....") ==
        "offset 9: the BGEO header counts 2147483647 points, more than the file can hold");
  CHECK_THAT(fault(bgeo_header(0, 0, 1) + big_text("s") + big(std::uint16_t{1}) +
                   big(std::int32_t{2}) + "...."),
             EndsWith("the attribute 's' has a type that is not float, integer, index or vector"));
  CHECK_THAT(fault(bgeo_header(0, 0, 1) + bgeo_attribute("s", 0, 0)),
             EndsWith("the attribute 's' has no numbers"));
  const char* const many = "the attributes of a point have more than 65536 numbers";
  CHECK_THAT(fault(bgeo_header(0, 0, 1) + bgeo_attribute("w", 65533, 0)), EndsWith(many));
  CHECK(fault(bgeo_header(0, 0, 1) + bgeo_attribute("w", 65532, 0)).empty());
  std::string text = kGeo;
  CHECK_THAT(fault(text.replace(text.find("id 1"), 4, "id 99999")), EndsWith(many));
  const Cloud wide = read_cloud(
      scratch.file("w.bgeo", bgeo_header(1, 0, 1) + bgeo_attribute("w", 17, 0) + big(1.0F) +
                                 big(2.0F) + big(3.0F) + big(1.0F) + std::string(68, 'w')));
  CHECK(wide.surfels.at(0).position == glm::dvec3(1, 2, 3));
  CHECK(wide.notes() == "The attribute 'w' has 17 numbers in each point and is left out.");
}

TEST_CASE("geo: an invalid line is reported by its number", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = kGeo;
    text.replace(text.find(from), from.size(), to);
    return cloud_fault(scratch, "a.geo", text);
  };
  CHECK(with("V5", "V6") == "line 1: a GEO must begin with PGEOMETRY V5");
  CHECK(with("NPoints 2", "NPoints -2") == "line 2: the header of the GEO must have NPoints here");
  CHECK(with("NPoints 2", "NPoints 99") ==
        "line 11: the GEO header counts 99 points, more than the file can hold");
  CHECK(with("1 float 1", "1 half 1") ==
        "line 8: the attribute 'pscale' has a type that is not float, int, index or vector");
  CHECK(with("id 1", "id 0") == "line 9: an attribute needs a name, a size and a type");
  CHECK(with("-5", "-5.5") == "line 12: a value of the point is not of its type");
  CHECK(with("-5", "") == "line 12: a value of the point is missing");
  CHECK(with("-5", "-5 1") == "line 12: the line has more values than the points have");
}

TEST_CASE("pdb: particles are read from the columns of their channels", "[io][points]") {
  const test::TemporaryDirectory scratch;
  for (std::size_t block = 1; block <= 3; ++block) {
    const Cloud cloud = read_cloud(scratch.file("a.pdb", good_pdb()), block);
    REQUIRE(cloud.surfels.size() == 2);
    CHECK(cloud.surfels[0].position == glm::dvec3(1, 2, 3));
    CHECK(cloud.surfels[1].position == glm::dvec3(4, 5, 6));
    CHECK(cloud.surfels[1].radius == 0.25F);
    CHECK(cloud.names() == "id");
    CHECK(cloud.value(0, "id") == -7);
    CHECK(cloud.value(1, "id") == 8);
    CHECK(cloud.notes() ==
          "The channel 'life' of type 2 with 8 bytes in each particle is left out.");
  }
}

TEST_CASE("pdb: truncated and foreign files are refused", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::string whole = good_pdb();
  for (std::size_t size = 6; size < whole.size(); ++size) {
    INFO(size);
    CHECK_FALSE(cloud_fault(scratch, "a.pdb", whole.substr(0, size)).empty());
  }
  const auto fault = [&](const std::string& bytes) { return cloud_fault(scratch, "a.pdb", bytes); };
  CHECK(fault(whole + "x") ==
        "offset " + std::to_string(whole.size()) + ": the file has more data than its header says");
  CHECK(fault(pdb_header(0, 0)) == "the PDB particles have no x, y and z");
  CHECK(fault(pdb_header(1, 1) + std::string(80, 'p')) ==
        "offset 60: no channel begins here; files with pointers of 64 bits or big-endian numbers "
        "are not supported");
  CHECK(fault(pdb_header(1, 4000000000U)) == "offset 20: the PDB has more than 1024 channels");
  CHECK(fault(pdb_header(2, 1) + pdb_channel("position", 1, 12, 1, std::string(12, '\0'))) ==
        "offset 60: the channel 'position' is not one block of all particles");
  CHECK(fault(pdb_header(0xffffffff, 1) + pdb_channel("position", 1, 12, 0xffffffff, "")) ==
        "offset 60: the values of the channel 'position' end too early");
  CHECK_THAT(fault("HEADER    PROTEIN\n"), Contains("not a point cloud"));
}
