// Facts about LAS files beyond the fields of their points: extra bytes, coordinate systems, texts.
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/las_crs.h"
#include "engine/io/cloud/las_vlrs.h"
#include "tests/io/files.h"
#include "tests/io/las_files.h"

using namespace ptc;
using Catch::Matchers::Contains;
using test::las_fault;
using test::las_point;
using test::las_vlr;
using test::LasCloud;
using test::LasFile;
using test::read_las;

namespace {

// A file of one point.
LasFile one_point(unsigned format) {
  LasFile file;
  file.minor = format >= 6 ? 4 : 2;
  file.format = format;
  file.record_bytes = format >= 6 ? 30 : 20;
  file.points = 1;
  file.records.resize(file.record_bytes);
  return file;
}

std::vector<std::string> channel_names(const PointFileInfo& info) {
  std::vector<std::string> names;
  for (const Channel& channel : info.channels) names.push_back(channel.name);
  return names;
}

// Returns a description of 192 bytes of an extra field.
std::string description(unsigned type, unsigned options, std::string name,
                        std::array<double, 3> scale = {}, std::array<double, 3> offset = {},
                        const std::string& no_data = {}) {
  std::string out(192, '\0');
  out[2] = static_cast<char>(type);
  out[3] = static_cast<char>(options);
  name.resize(32);
  out.replace(4, 32, name);
  if (!no_data.empty()) out.replace(40, no_data.size(), no_data);
  for (std::size_t i = 0; i < 3; ++i) {
    out.replace(112 + 8 * i, 8, raw(scale[i]));
    out.replace(136 + 8 * i, 8, raw(offset[i]));
  }
  return out;
}

}  // namespace

TEST_CASE("las: the box of the header is told where the points do not speak against it",
          "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  LasFile file{.points = 3};
  file.low = {-1, 0, 2};
  file.high = {1, 10, 2};
  file.records = las_point(-100, 0, 200) + las_point(100, 1000, 200) + las_point(0, 100, 200);
  const auto extent_of = [&](const LasFile& of) {
    return open_las(scratch.file("extent.las", of.bytes())).source->extent();
  };
  const std::optional<Extent> told = extent_of(file);
  REQUIRE(told);
  for (int axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<std::size_t>(axis);
    CHECK(told->bounds.low[axis] == Approx(file.low[k]).margin(1e-4));
    CHECK(told->bounds.high[axis] == Approx(file.high[k]).margin(1e-4));
    CHECK(told->bounds.low[axis] < file.low[k]);
    CHECK(told->bounds.high[axis] > file.high[k]);
  }
  REQUIRE(told->sample.size() == 1);
  CHECK(told->sample[0] == glm::dvec3(-1, 0, 2));

  // One that does not hold a point, one that is far too large, and one that is no box are not told
  const auto not_told = [&](std::size_t axis, double low, double high) {
    LasFile other = file;
    other.low[axis] = low;
    other.high[axis] = high;
    CHECK_FALSE(extent_of(other));
  };
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  not_told(0, 0, 1);
  not_told(0, 1, -1);
  not_told(0, kNaN, 1);
  not_told(0, -1, kInfinity);
  not_told(1, 0, 21);
}

TEST_CASE("las: described extra bytes become channels of their type", "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  LasFile file;
  file.minor = 4;
  file.format = 6;
  file.points = 1;
  std::string extra;
  std::string descriptions;
  constexpr std::array<unsigned, 10> kBytes = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  for (unsigned type = 1; type <= 30; ++type) {
    descriptions += description(type, 0, "Field Nr. " + std::to_string(type));
    extra +=
        std::string(kBytes[(type - 1) % 10] * ((type - 1) / 10 + 1), static_cast<char>('a' + type));
  }
  file.record_bytes = 30 + static_cast<unsigned>(extra.size());
  file.records = std::string(30, '\0') + extra;
  file.vlrs = {las_vlr("LASF_Spec", 4, descriptions)};
  const LasCloud cloud = read_las(scratch, file.bytes());
  CHECK(cloud.rows.ends_with(extra));
  CHECK(cloud.info.notes.empty());
  REQUIRE(cloud.info.channels.size() == 12 + 30);
  constexpr std::array<ChannelType, 10> kTypes = {
      ChannelType::u8,  ChannelType::i8,  ChannelType::u16, ChannelType::i16, ChannelType::u32,
      ChannelType::i32, ChannelType::u64, ChannelType::i64, ChannelType::f32, ChannelType::f64};
  for (std::size_t i = 0; i < 30; ++i) {
    const Channel& channel = cloud.info.channels[12 + i];
    CHECK(channel.name == "field_nr._" + std::to_string(i + 1));
    CHECK(channel.type == kTypes[i % 10]);
    CHECK(channel.components == i / 10 + 1);
    CHECK(channel.scale == 1);
    CHECK_FALSE(channel.no_value);
  }
}

TEST_CASE("las: scale, offset and no-data value of extra bytes are those of the channel",
          "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  LasFile file;
  file.points = 1;
  file.record_bytes = 20 + 2 + 4 + 4 + 1;
  file.records = las_point(0, 0, 0) + std::string(11, 'x');
  const auto channels = [&](const std::string& descriptions) {
    file.vlrs = {las_vlr("LASF_Spec", 4, descriptions)};
    return read_las(scratch, file.bytes()).info;
  };
  const PointFileInfo info =
      channels(description(4, 25, "height", {0.5, 0, 0}, {-100, 0, 0}, raw(std::int64_t{-9999})) +
               description(9, 1, "ratio", {}, {}, raw(-1.0)) +
               description(13, 24, "pair", {2, 4, 0}, {1, 1, 0}) +
               description(1, 9, "bad", {0, 0, 0}, {}, raw(std::int64_t{256})));
  REQUIRE(info.channels.size() == 10 + 5);
  const auto extra = std::span(info.channels).subspan(10);
  CHECK(extra[0].scale == 0.5);
  CHECK(extra[0].offset == -100);
  CHECK(extra[0].no_value == 0xd8f1U);
  CHECK(extra[1].no_value == 0xbf800000U);
  CHECK(extra[2].name == "pair_0");
  CHECK(extra[2].scale == 2);
  CHECK(extra[3].name == "pair_1");
  CHECK(extra[3].scale == 4);
  CHECK(extra[3].components == 1);
  CHECK(extra[4].scale == 1);
  CHECK_FALSE(extra[4].no_value);
}

TEST_CASE("las: extra bytes with the names of normal, radius and light are parts of the surfel",
          "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  LasFile file;
  file.points = 1;
  const auto cloud = [&](const std::string& descriptions, const std::string& extra) {
    file.record_bytes = 20 + static_cast<unsigned>(extra.size());
    file.records = las_point(0, 0, 0) + extra;
    file.vlrs = {las_vlr("LASF_Spec", 4, descriptions)};
    return read_las(scratch, file.bytes());
  };
  const auto extra_names = [](const LasCloud& of) {
    const auto names = channel_names(of.info);
    return std::vector(names.begin() + 10, names.end());
  };
  const auto triple = [](const char* a, const char* b, const char* c, unsigned type) {
    return description(type, 0, a) + description(type, 0, b) + description(type, 0, c);
  };

  // As this project writes them, between channels
  std::string extra = raw(std::uint8_t{1});
  for (const float v : {0.0F, 0.6F, -0.8F, 0.25F, 1.0F, 2.0F, 3.0F, 4.0F, 5.0F, 6.0F, 0.5F, 0.0F})
    extra += raw(v);
  extra += raw(0.75F) + raw(std::uint16_t{7});
  const LasCloud own =
      cloud(description(1, 0, "first") + triple("normal_x", "normal_y", "normal_z", 9) +
                description(9, 0, "radius") + triple("radiance_r", "radiance_g", "radiance_b", 9) +
                triple("emission_r", "emission_g", "emission_b", 9) +
                triple("albedo_r", "albedo_g", "albedo_b", 9) + description(3, 0, "last"),
            extra);
  const PointFileInfo& info = own.info;
  CHECK((info.has_normals && info.has_radius && info.has_radiance));
  CHECK((info.has_emission && info.has_albedo));
  CHECK(extra_names(own) == std::vector<std::string>{"first", "last"});
  CHECK(own.rows.ends_with(raw(std::uint8_t{1}) + raw(std::uint16_t{7})));
  CHECK(own.surfels[0].normal == glm::vec3(0, 0.6F, -0.8F));
  CHECK(own.surfels[0].radius == 0.25F);
  CHECK(own.surfels[0].radiance == glm::vec3(1, 2, 3));
  CHECK(own.surfels[0].emission == glm::vec3(4, 5, 6));
  CHECK(own.surfels[0].albedo == glm::vec3(0.5F, 0, 0.75F));

  // As other programs write them
  const std::string up = raw(0.0) + raw(0.0) + raw(2.0);
  CHECK(cloud(triple("NormalX", "NormalY", "NormalZ", 10), up).surfels[0].normal ==
        glm::vec3(0, 0, 1));
  CHECK(cloud(triple("nx", "ny", "nz", 10), up).surfels[0].normal == glm::vec3(0, 0, 1));
  const std::string scaled = description(4, 24, "NX", {1e-4, 0, 0}, {0.5, 0, 0}) +
                             description(4, 8, "NY", {1e-4, 0, 0}) +
                             description(4, 9, "NZ", {1e-4, 0, 0}, {}, raw(std::int64_t{-1}));
  const auto shorts = [](int x, int y, int z) {
    return raw(static_cast<std::int16_t>(x)) + raw(static_cast<std::int16_t>(y)) +
           raw(static_cast<std::int16_t>(z));
  };
  CHECK(cloud(scaled, shorts(1000, -8000, 0)).surfels[0].normal == glm::vec3(0.6F, -0.8F, 0));
  CHECK(cloud(scaled, shorts(1000, -8000, -1)).surfels[0].normal == glm::vec3(0));
  const std::string none = raw(0.0) + raw(std::nan("")) + raw(2.0);
  CHECK(cloud(triple("nx", "ny", "nz", 10), none).surfels[0].normal == glm::vec3(0));

  // What is no whole part, or holds plain integers, is a channel
  const LasCloud rest = cloud(description(9, 0, "nx") + description(9, 0, "ny") +
                                  description(3, 0, "radius") + description(29, 0, "normal"),
                              std::string(22, '\0'));
  CHECK_FALSE(rest.info.has_normals);
  CHECK_FALSE(rest.info.has_radius);
  CHECK(extra_names(rest) == std::vector<std::string>{"nx", "ny", "radius", "normal"});
  CHECK_THROWS_WITH(cloud(description(9, 0, "radius"), raw(-1.0F)),
                    Contains("point 0: the radius is negative"));
}

TEST_CASE("las: extra bytes that are not described are kept as bytes, with a note",
          "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  LasFile file;
  file.points = 1;
  file.record_bytes = 20 + 40;
  file.records = las_point(0, 0, 0);
  for (char c = 0; c < 40; ++c) file.records += c;
  const LasCloud plain = read_las(scratch, file.bytes());
  REQUIRE(plain.info.channels.size() == 10 + 3);
  CHECK(plain.info.channels[10].name == "extra_bytes");
  CHECK(plain.info.channels[11].name == "extra_bytes_2");
  CHECK(plain.info.channels[10].components == 16);
  CHECK(plain.info.channels[12].components == 8);
  CHECK(plain.rows.ends_with(file.records.substr(20)));
  REQUIRE(plain.info.notes.size() == 1);
  CHECK_THAT(plain.info.notes[0], Contains("40 extra bytes"));

  // Type 0 names bytes; a field that does not fit ends the descriptions.
  file.vlrs = {las_vlr("LASF_Spec", 4,
                       description(0, 20, "Opaque") + description(30, 0, "too long") +
                           description(1, 0, "never reached"))};
  const PointFileInfo described = read_las(scratch, file.bytes()).info;
  const auto names = channel_names(described);
  CHECK(std::vector(names.begin() + 10, names.end()) ==
        std::vector<std::string>{"opaque", "opaque_2", "extra_bytes", "extra_bytes_2"});
  CHECK(described.notes.size() == 2);
}

TEST_CASE("las: WKT is the text crs, and its unit metres_per_unit", "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  const std::string wkt =
      R"(COMPD_CS["a ""[b]"" c",PROJCS["p",GEOGCS["g",UNIT["degree",0.0174532925199433]],)"
      R"(UNIT["foot",0.3048,AUTHORITY["EPSG","9002"]]],VERT_CS["v",UNIT["metre",1]]])";
  LasFile file = one_point(6);
  file.vlrs = {las_vlr("LASF_Projection", 2112, wkt + std::string(3, '\0'))};
  PointFileInfo info = read_las(scratch, file.bytes()).info;
  CHECK(info.text.at("crs") == wkt);
  CHECK(info.text.at("metres_per_unit") == "0.3048");
  file.vlrs.clear();
  file.evlrs = {las_vlr("LASF_Projection", 2112, wkt, true)};
  info = read_las(scratch, file.bytes()).info;
  CHECK(info.text.at("crs") == wkt);
  for (const std::string bad : {"", "no", "P[\xff]", "\0\0\0"}) {
    file.evlrs = {las_vlr("LASF_Projection", 2112, bad, true)};
    CHECK(read_las(scratch, file.bytes()).info.text.count("crs") == 0);
  }
}

TEST_CASE("las: the unit of WKT is that of the plane, not of angles, ellipsoids or heights",
          "[io][las]") {
  const auto metres = [](const char* wkt) { return find_wkt_facts(wkt).metres_per_unit; };
  CHECK(metres(R"(PROJCS["a",UNIT["metre",1]])") == 1.0);
  CHECK(metres(R"(projcs("a",unit("US foot", 0.304800609601219)))") == 0.304800609601219);
  CHECK(metres(R"(PROJCRS["a",BASEGEOGCRS["b",DATUM["c",ELLIPSOID["d",1,2,LENGTHUNIT["metre",1]]]],
                  CS[Cartesian,2],AXIS["e",east,LENGTHUNIT["foot",0.3048]]])") == 0.3048);
  CHECK(metres(R"(PROJCRS["a",CS[Cartesian,2],LENGTHUNIT["km",1e3]])") == 1000.0);
  CHECK_FALSE(metres(R"(GEOGCS["a",UNIT["degree",0.017]])"));
  CHECK_FALSE(metres(R"(VERT_CS["a",UNIT["metre",1]])"));
  for (const char* broken : {"PROJCS[\"a\",UNIT[\"metre\",", "PROJCS[\"a\",UNIT[", "UNIT[\"m\",1]",
                             "PROJCS[\"a\",UNIT[\"m\",0]]", "PROJCS[\"a\",UNIT[\"m\",nan]]",
                             "PROJCS[\"a\",UNIT[\"m\"]]", "]]]]", "\"", ""}) {
    INFO(broken);
    CHECK_FALSE(metres(broken));
  }
  CHECK_FALSE(metres(std::string(100'000, '[').c_str()));
  CHECK(find_wkt_facts(R"(GEOGCS["a"])").geographic);
  CHECK_FALSE(find_wkt_facts(R"(PROJCS["b",GEOGCS["a"]])").geographic);
}

TEST_CASE("las: GeoTIFF keys name the system and the unit where there is no WKT",
          "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  using Keys = std::vector<std::array<std::uint16_t, 4>>;
  LasFile file = one_point(0);
  const auto text = [&](const Keys& keys, const char* name) {
    std::string directory = raw(std::uint16_t{1}) + raw(std::uint16_t{1}) + raw(std::uint16_t{0}) +
                            raw(static_cast<std::uint16_t>(keys.size()));
    for (const auto& key : keys) {
      for (const std::uint16_t value : key) directory += raw(value);
    }
    file.vlrs = {las_vlr("LASF_Projection", 34735, directory),
                 las_vlr("LASF_Projection", 34736, raw(1.0) + raw(0.25))};
    const PointFileInfo info = read_las(scratch, file.bytes()).info;
    const auto found = info.text.find(name);
    return found == info.text.end() ? std::string() : found->second;
  };
  const std::array<std::uint16_t, 4> projected = {1024, 0, 1, 1};
  const Keys utm = {projected, {3072, 0, 1, 32617}, {3076, 0, 1, 9001}};
  CHECK(text(utm, "crs") == "EPSG:32617");
  CHECK(text(utm, "metres_per_unit") == "1");
  CHECK(text({projected, {3076, 0, 1, 9002}}, "metres_per_unit") == "0.3048");
  CHECK(text({projected, {3076, 0, 1, 9003}}, "metres_per_unit") == "0.3048006096012192");
  CHECK(text({projected, {3076, 0, 1, 9999}}, "metres_per_unit").empty());
  const Keys own_unit = {projected, {3076, 0, 1, 32767}, {3077, 34736, 1, 1}};
  CHECK(text(own_unit, "metres_per_unit") == "0.25");
  CHECK(text({projected, {3076, 0, 1, 32767}, {3077, 34736, 1, 2}}, "metres_per_unit").empty());
  CHECK(text({projected, {3072, 0, 1, 32767}}, "crs").empty());
  const Keys angles = {{1024, 0, 1, 2}, {2048, 0, 1, 4326}, {3076, 0, 1, 9001}};
  CHECK(text(angles, "crs") == "EPSG:4326");
  CHECK(text(angles, "metres_per_unit").empty());
}

TEST_CASE("las: a directory of GeoTIFF keys may be cut anywhere", "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  std::string directory;
  for (const int value : {1, 1, 0, 300, 1024, 0, 1, 1, 3072, 0, 1, 32617})
    directory += raw(static_cast<std::uint16_t>(value));
  LasFile file = one_point(0);
  for (std::size_t size = 0; size <= directory.size(); ++size) {
    file.vlrs = {las_vlr("LASF_Projection", 34735, directory.substr(0, size))};
    const LasCloud cloud = read_las(scratch, file.bytes());
    CHECK(cloud.info.text.count("crs") == (size == directory.size() ? 1 : 0));
  }
}

TEST_CASE("las: the texts las.header and las.vlrs keep what a writer needs", "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  LasFile file = one_point(6);
  file.scale = {0.001, 0.01, 1e-7};
  file.offset = {-0.0, 1e7 + 0.1, 3};
  const std::string first = las_vlr("someone", 1, "ab");
  const std::string last = las_vlr("someone", 2, "xyz", true);
  file.vlrs = {first, las_vlr("laszip encoded", 1, "?"), las_vlr("copc", 1, "?")};
  file.evlrs = {las_vlr("copc", 1000, "?", true), last};
  const auto text = read_las(scratch, file.bytes()).info.text;
  const auto json = nlohmann::json::parse(text.at("las.header"));
  CHECK(json["version"] == "1.4");
  CHECK(json["format"] == 6);
  CHECK(json["record_length"] == 30);
  CHECK(json["scale"].get<std::array<double, 3>>() == file.scale);
  CHECK(json["offset"].get<std::array<double, 3>>() == file.offset);
  CHECK(std::signbit(json["offset"][0].get<double>()));
  CHECK(json["system_id"] == "system \xc3\xa9");
  CHECK(json["software"] == "by hand");
  CHECK(json["day"] == 32);
  CHECK(json["year"] == 2024);
  CHECK(json["global_encoding"] == 17);
  CHECK(json["guid"] == "30313233343536373839616263646566");
  CHECK(json["file_source_id"] == 7);

  // Decode base64 by bits.
  const auto decoded = [](const std::string& base64) {
    constexpr std::string_view kDigits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    CHECK(base64.size() % 4 == 0);
    std::string bytes;
    std::uint32_t bits = 0;
    int held = 0;
    for (const char c : base64.substr(0, base64.find('='))) {
      bits = bits << 6 | static_cast<std::uint32_t>(kDigits.find(c));
      held += 6;
      if (held >= 8) bytes += static_cast<char>(bits >> (held -= 8) & 255);
    }
    return bytes;
  };
  const std::string& both = text.at("las.vlrs");
  REQUIRE(both.find(',') != std::string::npos);
  CHECK(decoded(both.substr(0, both.find(','))) == first);
  CHECK(decoded(both.substr(both.find(',') + 1)) == last);
}

TEST_CASE("las: records of every length are kept, up to 1 MiB in all", "[io][points][las]") {
  const test::TemporaryDirectory scratch;
  constexpr std::size_t kMiB = 1'048'576;
  LasFile file = one_point(6);
  std::size_t bytes = 0;
  const auto add = [&](const char* user, unsigned number, std::size_t size, bool extended = false) {
    (extended ? file.evlrs : file.vlrs)
        .push_back(las_vlr(user, number, std::string(size, 'x'), extended));
    bytes += (extended ? 60 : 54) + size;
  };
  // Kept whole, and one byte more is too much, whether one record is extended or all are plain
  for (const bool extended : {true, false}) {
    file.vlrs.clear();
    file.evlrs.clear();
    bytes = 0;
    for (unsigned i = 0; i < 4; ++i) add("a", i, 65'535);
    if (extended) {
      add("a", 15, kMiB - bytes - 60, true);
    } else {
      for (unsigned i = 4; i < 15; ++i) add("a", i, 65'535);
      add("a", 15, kMiB - bytes - 54);
    }
    const PointFileInfo info = read_las(scratch, file.bytes()).info;
    CHECK(info.notes.empty());
    const auto kept = decode_vlrs(info.text.at("las.vlrs"));
    REQUIRE(kept);
    CHECK(kept->size() == file.vlrs.size() + file.evlrs.size());
    CHECK(kept->back().number == 15);
    CHECK(kept->back().extended == extended);
    CHECK(kept->back().bytes == (extended ? file.evlrs : file.vlrs).back());
    std::string& last = (extended ? file.evlrs : file.vlrs).back();
    const std::string whole = last;
    const std::size_t payload = last.size() - (extended ? 60 : 54) + 1;
    last = las_vlr("a", 15, std::string(payload, 'x'), extended);
    CHECK(read_las(scratch, file.bytes()).info.notes ==
          std::vector<std::string>{"The record 15 of the user 'a', " + std::to_string(payload) +
                                   " bytes, is left out: only 1 MiB of records is kept."});
    last = whole;
  }
  const PointFileInfo full = read_las(scratch, file.bytes()).info;

  // What is behind them is left out and named, with its bytes
  add("b", 2, 0);
  add("LASF_Projection", 2112, 65'536, true);
  for (int i = 0; i < 3; ++i) add("c\x1b", 7, 5);
  const PointFileInfo more = read_las(scratch, file.bytes()).info;
  const std::string end = " left out: only 1 MiB of records is kept.";
  CHECK(more.notes == std::vector<std::string>{
                          "The record 2112 of the user 'LASF_Projection', 65536 bytes, is" + end,
                          "The record 2 of the user 'b', 0 bytes, is" + end,
                          "3 records 7 of the user 'c\\x1b', 15 bytes in all, are" + end});
  CHECK(more.text.at("las.vlrs") == full.text.at("las.vlrs"));
  for (unsigned i = 0; i < 9; ++i) add("d", i, 0);
  const auto notes = read_las(scratch, file.bytes()).info.notes;
  REQUIRE(notes.size() == 9);
  CHECK(notes.back() == "Records of 4 more kinds are left out.");
}

TEST_CASE("las: records are shortened to those that fit, and the others are named",
          "[io][points][las]") {
  const auto text = [](const std::vector<std::string>& records) {
    std::string all;
    for (const std::string& record : records) all += record;
    return encode_vlrs(std::as_bytes(std::span(all)));
  };
  const std::string first = las_vlr("a", 1, std::string(46, 'x'));
  const std::string large = las_vlr("a", 2, std::string(1000, 'y'));
  const std::string last = las_vlr("b", 3, "");
  const std::string whole = text({first, large, last});
  for (const std::size_t most : {std::size_t{1208}, std::size_t{1 << 14}}) {
    CHECK(shorten_vlrs(whole, most, "why").text == whole);
    CHECK(shorten_vlrs(whole, most, "why").notes.empty());
  }
  const auto shorter = [&](std::size_t most) { return shorten_vlrs(whole, most, "why"); };
  CHECK(shorter(1207).text == text({first, large}));
  CHECK(shorter(154).text == text({first, last}));
  CHECK(shorter(154).notes ==
        std::vector<std::string>{"The record 2 of the user 'a', 1000 bytes, is left out: why."});
  CHECK(shorter(153).text == text({first}));
  CHECK(shorter(99).text == text({last}));
  CHECK(shorter(53).text.empty());
  CHECK(shorter(53).notes.size() == 3);
  // Extended records come last, and count with their longer headers
  const std::string longer = las_vlr("c", 4, std::string(40, 'z'), true);
  const std::string mixed =
      encode_vlrs(std::as_bytes(std::span(first)), std::as_bytes(std::span(longer)));
  CHECK(mixed == text({first}) + "," + text({longer}));
  CHECK(shorten_vlrs(mixed, 200, "why").text == mixed);
  CHECK(shorten_vlrs(mixed, 199, "why").text == text({first}));
  CHECK(shorten_vlrs(mixed, 199, "why").notes ==
        std::vector<std::string>{"The record 4 of the user 'c', 40 bytes, is left out: why."});
  const std::string alone = encode_vlrs({}, std::as_bytes(std::span(longer)));
  CHECK(shorten_vlrs(alone, 100, "why").text == alone);
  CHECK(shorten_vlrs(alone, 99, "why").text.empty());
  // A damaged text is left alone where it is short
  for (const std::string& damaged : {whole + "AAAA", std::string(2000, '?')}) {
    CHECK(shorten_vlrs(damaged, 2000, "why").text == damaged);
    CHECK(shorten_vlrs(damaged, 1207, "why").text.empty());
    CHECK(shorten_vlrs(damaged, 1207, "why").notes.size() == 1);
  }
}
