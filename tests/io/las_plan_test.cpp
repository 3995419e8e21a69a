// Header, steps and records of LAS 1.4. Offsets are those of ASPRS LAS 1.4 R15.
#include <cmath>
#include <stdexcept>

#include "tests/io/las_files.h"
#include "tests/io/written_las.h"

using namespace ptc;
using namespace ptc::test;
using Catch::Matchers::Contains;

namespace {

std::string record_bytes(const std::string& user, std::uint16_t id, const std::string& content) {
  std::string name = user, none(32, '\0');
  name.resize(16);
  return raw(std::uint16_t{0xaabb}) + name + raw(id) +
         raw(static_cast<std::uint16_t>(content.size())) + none + content;
}

std::string base64(const std::string& bytes) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned bits = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? digits[bits >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

}  // namespace

TEST_CASE("las writer: a cloud from LAS keeps steps, names, date and identity",
          "[io][writers][las]") {
  std::vector<Surfel> surfels;
  for (const int x : {-2'147'483'647, 0, 2'147'483'647})
    surfels.push_back({.position = {x * 0.01 + 600'000, 12 * 0.02 - 5, x * 0.001}});
  PointWriteInfo info = plain_info(surfels);
  info.text["las.header"] =
      R"({"version":"1.2","format":3,"scale":[0.01,0.02,0.001],"offset":[600000,-5,0],)"
      R"("system":"EXTRACTION","software":"TerraScan","day":40,"year":2009,"encoding":31,)"
      R"("guid":"000102030405060708090a0b0c0d0eff"})";
  const Las las = written(info, surfels);
  CHECK(las.bytes.substr(26, 11) == std::string("EXTRACTION\0", 11));
  CHECK(las.bytes.substr(58, 10) == std::string("TerraScan\0", 10));
  CHECK(las.at<std::uint16_t>(90) == 40);
  CHECK(las.at<std::uint16_t>(92) == 2009);
  CHECK(las.encoding() == (1 | 8));  // times, synthetic returns; no waveforms, no WKT
  CHECK(las.bytes.substr(8, 16) ==
        std::string("\x00\x01\x02\x03\x04\x05\x06\x07\x08\x09\x0a\x0b\x0c\x0d\x0e\xff", 16));
  CHECK(las.at<double>(131) == 0.01);
  CHECK(las.at<double>(139) == 0.02);
  CHECK(las.at<double>(147) == 0.001);
  CHECK(las.at<double>(155) == 600'000);
  CHECK(las.point<std::int32_t>(0, 0) == -2'147'483'647);
  CHECK(las.point<std::int32_t>(2, 0) == 2'147'483'647);
  CHECK(las.point<std::int32_t>(1, 4) == 12);
  CHECK(las.point<std::int32_t>(2, 8) == 2'147'483'647);
  CHECK(losses(OutputFormat::las, info).empty());

  // Other names of the members, and bytes that are no ASCII
  PointWriteInfo named = info;
  named.text["las.header"] =
      R"({"scale":[0.01,0.02,0.001],"offset":[600000,-5,0],"system_id":"\u00e9t\u00e9\u20ac",)"
      R"("software":"12345678901234567890123456789012X","global_encoding":9,"file_source_id":77})";
  const Las same = written(named, surfels);
  CHECK(same.bytes.substr(26, 7) == "\xe9t\xe9\xe2\x82\xac" + std::string(1, '\0'));
  CHECK(same.bytes.substr(58, 32) == "12345678901234567890123456789012");
  CHECK(same.encoding() == 9);
  CHECK(same.at<std::uint16_t>(4) == 77);

  // A point that its steps cannot reach
  surfels.push_back({.position = {600'000 + 0.01 * 2'147'483'649.0, 0, 0}});
  info.count = 4;
  info.bounds.add(surfels.back().position);
  const Las other = written(info, surfels);
  CHECK(other.at<double>(131) == 0.1);
  CHECK(other.at<std::uint16_t>(92) == 2009);
  CHECK(losses(OutputFormat::las, info).size() == 2);
}

TEST_CASE("las writer: a header text that is not of its form is passed over",
          "[io][writers][las]") {
  const std::vector<Surfel> surfels = surfels_of(2);
  PointWriteInfo info = plain_info(surfels);
  const Las plain = written(info, surfels);
  for (const char* text :
       {"", "{", "[1]", "7", "{}", R"({"scale":[0,1,1],"offset":[0,0,0]})",
        R"({"scale":[1e-300,1,1],"offset":[0,0,0]})", R"({"scale":[-1,1,1],"offset":[0,0,0]})",
        R"({"scale":[1,1],"offset":[0,0,0]})", R"({"scale":["1",1,1],"offset":[0,0,0]})",
        R"({"scale":[1,1,1]})", R"({"scale":[1,1,1],"offset":[1e999,0,0]})",
        R"({"day":-1,"year":65536,"encoding":1.5,"guid":"00","system":3,"software":null})",
        R"({"guid":"0001020304050607080900000000000G"})"}) {
    INFO(text);
    info.text["las.header"] = text;
    CHECK(written(info, surfels).bytes == plain.bytes);
  }
}

TEST_CASE("las writer: original records are kept, except those about storage",
          "[io][writers][las]") {
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.has_radius = true;
  const std::string kept = record_bytes("LASF_Projection", 34735, "keys") +
                           record_bytes("somebody", 4, "") + record_bytes("LASF_Spec", 3, "text");
  const std::string all = record_bytes("laszip encoded", 22204, "zip") + kept.substr(0, 54 + 4) +
                          record_bytes("LASF_Spec", 4, "old") +
                          record_bytes("LASF_Spec", 100, "wave") + record_bytes("copc", 1, "tree") +
                          kept.substr(54 + 4);
  info.text["las.vlrs"] = base64(all);
  const Las las = written(info, surfels);
  CHECK(las.at<std::uint32_t>(100) == 4);
  CHECK(las.bytes.substr(375, kept.size()) == kept);
  CHECK(las.extra_names() == std::vector<std::string>{"radius 9"});
  CHECK(las.record("LASF_Spec", 4).size() == 192);
  CHECK(las.encoding() == 0);
  CHECK(losses(OutputFormat::las, info).size() == 1);  // the steps
  // Damaged ones are left out whole
  for (std::size_t size = 1; size < all.size(); ++size) {
    info.text["las.vlrs"] = base64(all.substr(0, size));
    const bool whole = size == 57 || size == 57 + 58 || size == 57 + 58 + 57 ||
                       size == 57 + 58 + 57 + 58 || size == 57 + 58 + 57 + 58 + 58 ||
                       size == 57 + 58 + 57 + 58 + 58 + 54;
    CHECK((losses(OutputFormat::las, info).size() == 1) == whole);
  }
  for (const char* text : {"?", "AAA", "AA=A", "AAAA\n", "===="}) {
    info.text["las.vlrs"] = text;
    INFO(text);
    CHECK(written(info, surfels).at<std::uint32_t>(100) == 1);
    CHECK_THAT(losses(OutputFormat::las, info).back(), Contains("las.vlrs is damaged"));
  }
}

TEST_CASE("las writer: extended records of any length lie behind the points",
          "[io][writers][las]") {
  std::vector<Surfel> surfels = surfels_of(3);
  PointWriteInfo info = plain_info(surfels);
  const std::string plain = record_bytes("somebody", 4, "plain");
  const std::string first = las_vlr("somebody", 5, std::string(65'536, 'x'), true);
  const std::string last = las_vlr("LASF_Projection", 2112, "WKT", true);
  const std::string all = first + las_vlr("LASF_Spec", 4, "old", true) + last;
  info.text["las.vlrs"] = base64(plain) + "," + base64(all);
  info.text["crs"] = "PROJCS[...]";
  const Las las = written(info, surfels);
  CHECK(las.at<std::uint32_t>(100) == 1);
  CHECK(las.bytes.substr(375, plain.size()) == plain);
  CHECK(las.at<std::uint32_t>(243) == 2);
  CHECK(las.extended_records() == first + last);
  CHECK(las.encoding() == 16);                         // WKT, of the extended record
  CHECK(losses(OutputFormat::las, info).size() == 1);  // the steps
  // Without points they follow the header, and the reader gives them back
  const test::TemporaryDirectory scratch;
  info.text["las.vlrs"] = "," + base64(first);
  info.text.erase("crs");
  for (const std::size_t count : {std::size_t{0}, std::size_t{3}}) {
    surfels.resize(count);
    info.count = count;
    write_points(scratch / "a.las", OutputFormat::las, info, surfels);
    CHECK(Las(scratch / "a.las").extended_records() == first);
    CHECK(read_las(scratch / "a.las").info.text.at("las.vlrs") == info.text["las.vlrs"]);
    surfels = surfels_of(3);
  }
  // Damaged ones are left out whole
  for (const std::size_t size : {std::size_t{1}, std::size_t{59}, first.size() - 1}) {
    info.text["las.vlrs"] = base64(plain) + "," + base64(first.substr(0, size));
    CHECK(written(info, surfels).extended_records().empty());
    CHECK_THAT(losses(OutputFormat::las, info).back(), Contains("las.vlrs is damaged"));
  }
  std::string endless = first;
  endless.replace(20, 8, 8, static_cast<char>(0xff));  // the size
  info.text["las.vlrs"] = base64(plain) + "," + base64(endless);
  CHECK_THAT(losses(OutputFormat::las, info).back(), Contains("las.vlrs is damaged"));
}

TEST_CASE("las writer: the reference system is a record of WKT, and the header says so",
          "[io][writers][las]") {
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.text["crs"] = "PROJCS[...]";
  const Las las = written(info, surfels);
  CHECK(las.record("LASF_Projection", 2112) == std::string("PROJCS[...]\0", 12));
  CHECK(las.encoding() == 16);
  // The original has one already
  info.text["las.vlrs"] = base64(record_bytes("LASF_Projection", 2112, "old"));
  const Las other = written(info, surfels);
  CHECK(other.record("LASF_Projection", 2112) == "old");
  CHECK(other.at<std::uint32_t>(100) == 1);
  CHECK(other.encoding() == 16);
  // The longest that a record holds
  info.text.erase("las.vlrs");
  info.text["crs"] = std::string(65'534, '[');
  CHECK(written(info, surfels).record("LASF_Projection", 2112).size() == 65'535);
  info.text["crs"] += '[';
  CHECK(written(info, surfels).record("LASF_Projection", 2112).empty());
  CHECK(written(info, surfels).encoding() == 0);
  CHECK_THAT(losses(OutputFormat::las, info).back(), Contains("reference system is left out"));
  // A name is no WKT; keys of GeoTIFF say the same
  info.text["crs"] = "EPSG:2993";
  CHECK(written(info, surfels).at<std::uint32_t>(100) == 0);
  CHECK_THAT(losses(OutputFormat::las, info).back(), Contains("it is not WKT"));
  info.text["las.vlrs"] = base64(record_bytes("LASF_Projection", 34735, "keys"));
  CHECK(written(info, surfels).at<std::uint32_t>(100) == 1);
  CHECK(losses(OutputFormat::las, info).size() == 1);
}

TEST_CASE("las writer: steps of its own suffice for every spread of points", "[io][writers][las]") {
  for (const double side : {0.0, 1e-12, 1e-3, 1.0, 2147.483647, 2147.483648, 4656.0, 1e9, 1e200}) {
    for (const double low : {0.0, -0.5, 848'882.1, -1e15}) {
      INFO(side << " from " << low);
      std::vector<Surfel> surfels(2);
      surfels[0].position = glm::dvec3(low, low, 7);
      surfels[1].position = glm::dvec3(low + side, low, 7);
      const Las las = written(plain_info(surfels), surfels);
      const double scale = las.at<double>(131), offset = las.at<double>(155);
      for (std::size_t i = 0; i < 2; ++i) {
        const double x = surfels[i].position.x;
        const double back = las.point<std::int32_t>(i, 0) * scale + offset;
        CHECK(std::abs(back - x) <= 0.5001 * scale + 1e-15 * std::abs(x));
        CHECK(las.point<std::int32_t>(i, 8) * las.at<double>(147) + las.at<double>(171) == 7);
      }
      CHECK((scale <= 1e-3 || scale <= 1e-8 * side));
    }
  }
}

TEST_CASE("las writer: a point outside of the announced bounds is refused", "[io][writers][las]") {
  const test::TemporaryDirectory scratch;
  std::vector<Surfel> surfels = surfels_of(2);
  const PointWriteInfo info = plain_info(surfels);
  const auto writer = create_points(scratch / "a.las", OutputFormat::las, info);
  surfels[1].position.x = 14;  // 3e9 steps of 1e-9 from the offset
  CHECK_THROWS_AS(writer->write(surfels, {}), std::invalid_argument);
}
