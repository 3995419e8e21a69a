// Detection of formats, and names of channels.
#include "engine/io/cloud/point_format.h"

#include <functional>

#include <catch2/catch.hpp>
#include <zlib.h>

#include "engine/base/error.h"
#include "engine/io/cloud/channel_names.h"
#include "engine/io/cloud/formats.h"
#include "tests/io/files.h"

using namespace ptc;
using namespace std::string_literals;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;

TEST_CASE("formats: the beginning of a file decides, whatever its name", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::vector<std::pair<std::string, PointFormat>> begins = {
      {"ply\nformat ascii 1.0\n", PointFormat::ply},
      {"ply\r\n", PointFormat::ply},
      {"LASF\0\0"s, PointFormat::las},
      {"ASTM-E57\1"s, PointFormat::e57},
      {"# .PCD v0.7 - Point\nVERSION 0.7\n", PointFormat::pcd},
      {"VERSION .7\nFIELDS x\n", PointFormat::pcd},
      {"pptc\0\0\0\0"s, PointFormat::ptc},
      {"BgeoV\0\0\0\5"s, PointFormat::bgeo},
      {"PGEOMETRY V5\n", PointFormat::bgeo},
      {"\x7fNSJb", PointFormat::bgeo},
      {"\x9e\x02\0\0\1\0\0\0"s, PointFormat::pdb}};
  for (const auto& [begin, format] : begins) {
    INFO(begin);
    for (const char* name : {"unnamed", "a.bin", "a.txt", "a.las"})
      CHECK(point_format(scratch.file(name, begin)) == format);
    const auto packed = scratch.path() / "a.gz";
    gzFile file = gzopen(packed.c_str(), "wb");
    gzwrite(file, begin.data(), static_cast<unsigned>(begin.size()));
    gzclose(file);
    CHECK(point_format(packed) == format);
  }
}

TEST_CASE("formats: the name decides where the beginning does not", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const std::vector<std::pair<std::string, PointFormat>> names = {
      {"a.ply", PointFormat::ply},   {"a.las", PointFormat::las},  {"a.LAZ", PointFormat::las},
      {"a.e57", PointFormat::e57},   {"a.pcd", PointFormat::pcd},  {"a.ptc", PointFormat::ptc},
      {"a.bgeo", PointFormat::bgeo}, {"a.ptx", PointFormat::ptx},  {"a.pts", PointFormat::pts},
      {"a.xyz", PointFormat::xyz},   {"a.xyzn", PointFormat::xyz}, {"a.asc", PointFormat::xyz},
      {"a.txt", PointFormat::xyz},   {"a.csv", PointFormat::xyz}};
  for (const auto& [name, format] : names) {
    CHECK(point_format(scratch.file(name, "no")) == format);
    CHECK(point_format(scratch.file(name, "")) == format);
  }
}

TEST_CASE("formats: the content wins over the name, and a note says so", "[io][points]") {
  const test::TemporaryDirectory scratch;
  for (const char* name : {"a.las", "a.ply", "a.e57", "a.pcd", "a.ptc", "a.bgeo"}) {
    INFO(name);
    const auto path = scratch.file(name, "\xEF\xBB\xBFX;Y;Z\r\n1;2;3\r\n");
    CHECK(point_format(path) == PointFormat::xyz);
    const PointFileInfo info = open_points(path).info;
    CHECK(info.format == "XYZ text");
    REQUIRE(info.notes.size() == 1);
    CHECK_THAT(info.notes[0], EndsWith("but the content is that of XYZ text."));
  }
  for (const char* name : {"a.xyz", "a.pts", "a.foo"})
    CHECK(open_points(scratch.file(name, "1 2 3\n4 5 6\n")).info.notes.empty());
}

TEST_CASE("formats: gzip is told by content, and refused where a file is not read in order",
          "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto packed = [&](const char* name, const std::string& bytes) {
    const auto path = scratch.path() / name;
    gzFile file = gzopen(path.c_str(), "wb");
    gzwrite(file, bytes.data(), static_cast<unsigned>(bytes.size()));
    gzclose(file);
    return path;
  };
  for (const char* name : {"a.xyz", "a.xyz.gz", "a", "a.las"}) {
    PointFile file = open_points(packed(name, "1 2 3\n4 5 6\n"));
    std::vector<Surfel> surfels(9);
    CHECK(file.source->next(surfels) == 2);
  }
  for (const auto& [begin, format] : std::vector<std::pair<std::string, std::string>>{
           {"LASF", "LAS"}, {"ASTM-E57", "E57"}, {"\x9e\x02\0\0\1\0"s, "Maya's PDB"}}) {
    for (const char* name : {"a.gz", "a.las", "a"}) {
      CHECK_THROWS_WITH(static_cast<void>(open_points(packed(name, begin))),
                        Contains(": " + format + " packed by gzip") && Contains("gunzip"));
    }
  }
}

TEST_CASE("formats: a file that nothing can read gets a hint that fits", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto hint = [&](const std::string& text) {
    return hint_at_content(scratch.file("a.foo", text));
  };
  CHECK_THAT(hint("Easting Northing Height\n1 2 3\n"), Contains("end its name in .xyz"));
  CHECK_THAT(hint("1 2 3 tree\n"), Contains("end its name in .xyz"));
  CHECK_THAT(hint("\x1f\x8b\x08"), Contains("unpack it"));
  for (const char* text : {"", "words", "1 2\n3 4\n", "\x01 1 2 3\n"}) CHECK(hint(text).empty());
}

TEST_CASE("formats: text under any name is told apart by its lines", "[io][points]") {
  const test::TemporaryDirectory scratch;
  const auto format = [&](const std::string& text) {
    return point_format(scratch.file("unnamed", text));
  };
  CHECK(format("1 2 3\n4 5 6\n") == PointFormat::xyz);
  CHECK(format("1 2 3") == PointFormat::xyz);
  CHECK(format("# c\n\n1,2,3,4\n4,5,6,7\n") == PointFormat::xyz);
  CHECK(format("\"X\";\"Y\";\"Z\"\n1;2;3\n") == PointFormat::xyz);
  CHECK(format("2\n1 2 3\n4 5 6\n") == PointFormat::pts);
  const std::string ptx = "2\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
  CHECK(format(ptx + "1 2 3 4\n") == PointFormat::ptx);
  CHECK_FALSE(format(ptx.substr(0, ptx.size() - 8)).has_value());
  // Longer than what is looked at; the line at its end is cut.
  std::string many;
  for (int i = 0; i < 1000; ++i) many += "1.5 2.5 3.5\n";
  CHECK(format(many) == PointFormat::xyz);
  for (const char* other : {"", "1 2\n", "1 2 3\n4 5\n", "a b c\n", "HEADER    PROTEIN\n", "{}",
                            "v 0 0 0\nv 1 0 0\n", "OFF\n8 6 12\n0 0 0\n", "solid cube\n"}) {
    INFO(other);
    CHECK_FALSE(format(other).has_value());
  }
  CHECK_FALSE(format("1 2 3\n\0"s).has_value());
  // The name .pts is also given to XYZ.
  CHECK(point_format(scratch.file("a.pts", "1 2 3\n4 5 6\n")) == PointFormat::xyz);
  CHECK(point_format(scratch.file("a.pts", "1\n4 5 6\n")) == PointFormat::pts);
}

TEST_CASE("formats: a mesh is not taken for a cloud", "[io][points]") {
  const test::TemporaryDirectory scratch;
  for (const char* name : {"a.obj", "a.off", "a.stl", "a.gltf", "a.glb", "a.OFF"}) {
    CHECK_FALSE(point_format(scratch.file(name, "8 6 0\n0 0 0\n1 0 0\n")).has_value());
    CHECK_FALSE(is_point_file(scratch.file(name, "1 2 3\n")));
  }
  const std::string rule =
      "not a point cloud: its content and its name are those of none of PLY, LAS, LAZ, E57, PCD, "
      "PTX, PTS, XYZ text, Pixar's PTC, Houdini's classic BGEO and Maya's PDB";
  CHECK_THROWS_WITH(static_cast<void>(open_points(scratch.file("a.obj", "v 0 0 0\n"))),
                    Contains(rule));
  CHECK_THROWS_WITH(static_cast<void>(open_points(scratch.file("unknown", "v 0 0 0\n"))),
                    Contains(rule));
}

TEST_CASE("formats: a cloud is known by its name in text, else by its content", "[io][points]") {
  const test::TemporaryDirectory scratch;
  for (const char* name : {"none.xyz", "none.XYZN", "none.asc", "none.txt", "none.csv", "none.pts",
                           "none.ptx", "none.csv.gz"}) {
    CHECK(is_point_file(name));
    CHECK(names_text_cloud(name));
  }
  CHECK(is_point_file(scratch.file("a.pcd", "no")));
  CHECK(is_point_file(scratch.file("a.laz", "LASF")));
  CHECK(is_point_file(scratch.file("b", "pptc")));
  CHECK_FALSE(is_point_file(scratch.file("c", "PTCX")));
  CHECK_THROWS_AS(static_cast<void>(is_point_file("none.pcd")), std::system_error);
}

TEST_CASE("channels: a name keeps to the rules of the schema", "[io][points]") {
  const auto name = [](const char* text) { return channel_name(text, {}); };
  CHECK(name("intensity") == "intensity");
  CHECK(name("GPS Time [s]") == "gps_time_s_");
  CHECK(name("a.b_c-d--e") == "a.b_c_d_e");
  CHECK(name("__a") == "__a");
  CHECK(name("Intensit\xc3\xa4t") == "intensit_t");
  CHECK(name("") == "channel");
  CHECK(name("?") == "_");
  const std::string text(40, 'q');
  CHECK(name(text.c_str()) == std::string(31, 'q'));
  std::vector<Channel> others(3);
  others[0].name = "a";
  others[1].name = "a_2";
  others[2].name = std::string(31, 'q');
  CHECK(channel_name("A", others) == "a_3");
  CHECK(channel_name("b", others) == "b");
  CHECK(channel_name(text, others) == std::string(29, 'q') + "_2");
}

TEST_CASE("channels: usual attributes get their usual name and role", "[io][points]") {
  const auto named = [](const char* name) {
    Channel channel;
    channel.name = name;
    name_channel(channel, {});
    return channel;
  };
  CHECK(named("scalar_Intensity").name == "intensity");
  CHECK(named("scalar_").name == "scalar_");
  CHECK(named("ReturnNumber").name == "return_number");
  CHECK(named("return_number").name == "return_number");
  CHECK(named("scalar_GPS_Time").name == "gps_time");
  CHECK(named("GpsTime").role == ChannelRole::time);
  CHECK(named("GpsTime").unit == "s");
  CHECK(named("Classification").role == ChannelRole::label);
  CHECK(named("confidence").role == ChannelRole::value);
}
