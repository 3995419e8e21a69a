// Where the values of points go in LAS 1.4. Offsets are those of ASPRS LAS 1.4 R15.
#include <cmath>

#include "engine/base/error.h"
#include "tests/io/las_files.h"
#include "tests/io/written_las.h"

using namespace ptc;
using namespace ptc::test;

namespace {

Channel channel(const char* name, ChannelType type, std::uint8_t components = 1) {
  return {.name = name, .type = type, .components = components};
}

}  // namespace

TEST_CASE("las writer: the header is that of version 1.4", "[io][writers][las]") {
  std::vector<Surfel> surfels = surfels_of(3);
  const Las las = written(plain_info(surfels), surfels);
  CHECK(las.bytes.substr(0, 4) == "LASF");
  CHECK(las.at<std::uint8_t>(24) == 1);
  CHECK(las.at<std::uint8_t>(25) == 4);
  CHECK(las.at<std::uint16_t>(94) == 375);
  CHECK(las.points_begin() == 375);
  CHECK(las.at<std::uint32_t>(100) == 0);
  CHECK(las.format() == 6);
  CHECK(las.point_bytes() == 30);
  CHECK(las.encoding() == 0);
  CHECK(las.at<std::uint64_t>(247) == 3);
  CHECK(las.at<std::uint64_t>(255) == 3);  // first returns
  CHECK(las.at<std::uint64_t>(263) == 0);
  CHECK(las.bytes.substr(107, 24) == std::string(24, '\0'));  // legacy counts
  CHECK(las.bytes.size() == 375 + 3 * 30);
  const double step = las.at<double>(131);
  for (std::size_t i = 0; i < 3; ++i) {
    const double scale = las.at<double>(131 + 8 * i), offset = las.at<double>(155 + 8 * i);
    CHECK(scale == step);
    const auto axis = static_cast<int>(i);
    double low = 1e9, high = -1e9;
    for (std::size_t k = 0; k < 3; ++k) {
      const double x = las.point<std::int32_t>(k, 4 * i) * scale + offset;
      CHECK(std::abs(x - surfels[k].position[axis]) <= 0.5001 * scale);
      low = std::min(low, x);
      high = std::max(high, x);
    }
    CHECK(las.at<double>(179 + 16 * i) == high);
    CHECK(las.at<double>(187 + 16 * i) == low);
  }
  CHECK(step == 1e-9);  // 2 units have 2e9 of them
}

TEST_CASE("las writer: known channels fill their fields", "[io][writers][las]") {
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  std::vector<std::byte> rows;
  const auto add = [&](const char* name, ChannelType type, auto value) {
    info.channels.push_back(channel(name, type));
    append_value(rows, value);
  };
  add("nir", ChannelType::u16, std::uint16_t{0xabcd});
  add("intensity", ChannelType::u16, std::uint16_t{0x1234});
  add("return_number", ChannelType::u8, std::uint8_t{2});
  add("number_of_returns", ChannelType::u8, std::uint8_t{5});
  add("class_flags", ChannelType::u8, std::uint8_t{0b1010});
  add("scanner_channel", ChannelType::u8, std::uint8_t{2});
  add("scan_direction", ChannelType::u8, std::uint8_t{1});
  add("edge_of_flight_line", ChannelType::u8, std::uint8_t{0});
  add("classification", ChannelType::u8, std::uint8_t{77});
  add("user_data", ChannelType::u8, std::uint8_t{88});
  add("scan_angle", ChannelType::i8, std::int8_t{-12});
  add("point_source_id", ChannelType::u16, std::uint16_t{999});
  add("gps_time", ChannelType::f64, 123'456.75);
  info.channels.push_back(stored_colour(ChannelType::u16));
  for (const std::uint16_t v : std::initializer_list<std::uint16_t>{1, 2, 65535})
    append_value(rows, v);
  const Las las = written(info, surfels, rows);
  CHECK(las.format() == 8);
  CHECK(las.point_bytes() == 38);
  CHECK(las.at<std::uint32_t>(100) == 0);
  CHECK(las.point<std::uint16_t>(0, 12) == 0x1234);
  CHECK(las.point<std::uint8_t>(0, 14) == 0x52);
  CHECK(las.point<std::uint8_t>(0, 15) == 0b0110'1010);
  CHECK(las.point<std::uint8_t>(0, 16) == 77);
  CHECK(las.point<std::uint8_t>(0, 17) == 88);
  CHECK(las.point<std::int16_t>(0, 18) == -2000);
  CHECK(las.point<std::uint16_t>(0, 20) == 999);
  CHECK(las.point<double>(0, 22) == 123'456.75);
  CHECK(las.point<std::uint16_t>(0, 30) == 1);
  CHECK(las.point<std::uint16_t>(0, 32) == 2);
  CHECK(las.point<std::uint16_t>(0, 34) == 65535);
  CHECK(las.point<std::uint16_t>(0, 36) == 0xabcd);
  CHECK(las.at<std::uint64_t>(255) == 0);
  CHECK(las.at<std::uint64_t>(263) == 1);  // second returns
}

TEST_CASE("las writer: values beyond a field of bits are cut, and that is said",
          "[io][writers][las]") {
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  std::vector<std::byte> rows;
  for (const char* name : {"return_number", "number_of_returns", "class_flags", "scanner_channel",
                           "scan_direction", "edge_of_flight_line"}) {
    info.channels.push_back(channel(name, ChannelType::u8));
    append_value(rows, std::uint8_t{200});
  }
  const Las las = written(info, surfels, rows);
  CHECK(las.point<std::uint8_t>(0, 14) == 0xff);
  CHECK(las.point<std::uint8_t>(0, 15) == 0xff);
  CHECK(las.at<std::uint64_t>(255 + 14 * 8) == 1);
  const auto sentences = losses(OutputFormat::las, info);
  CHECK(sentences.size() == 1 + 6);
  CHECK(sentences.at(1) == "Values of the channel return_number above 15 become 15.");
  info.text["las.header"] = "{}";
  CHECK(losses(OutputFormat::las, info).size() == 2);
}

TEST_CASE("las writer: points without numbers of returns are the first of one",
          "[io][writers][las]") {
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  CHECK(written(info, surfels).point<std::uint8_t>(0, 14) == 0x11);
  info.channels = {channel("return_number", ChannelType::u8)};
  CHECK(written(info, surfels, {std::byte{3}}).point<std::uint8_t>(0, 14) == 0x33);
  info.channels.front().offset = 1;  // counted from 0, as in E57
  CHECK(written(info, surfels, {std::byte{3}}).point<std::uint8_t>(0, 14) == 0x44);
  info.channels = {channel("number_of_returns", ChannelType::u8)};
  CHECK(written(info, surfels, {std::byte{3}}).point<std::uint8_t>(0, 14) == 0x31);
}

TEST_CASE("las writer: what is not known is as in a file without the channel",
          "[io][writers][las]") {
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.has_albedo = true;
  std::vector<std::byte> rows;
  const auto add = [&](const char* name, ChannelType type, auto bits) {
    info.channels.push_back(channel(name, type));
    info.channels.back().no_value = bits;
    append_value(rows, bits);
  };
  add("intensity", ChannelType::u16, std::uint16_t{0xffff});
  add("return_number", ChannelType::u8, std::uint8_t{0xff});
  add("number_of_returns", ChannelType::u8, std::uint8_t{0xff});
  add("class_flags", ChannelType::u8, std::uint8_t{0xff});
  add("classification", ChannelType::u8, std::uint8_t{0xff});
  add("scan_angle", ChannelType::i8, std::uint8_t{0x80});
  add("gps_time", ChannelType::f64, std::uint64_t{0x7ff8000000000000});
  add("mine", ChannelType::u8, std::uint8_t{0xff});
  const auto standard = [&](double scale) {
    PointWriteInfo with_colour = info;
    with_colour.channels.push_back(stored_colour(ChannelType::u16));
    with_colour.channels.back().scale = scale;
    with_colour.channels.back().no_value = 0xffff;
    std::vector<std::byte> all = rows;
    for (int i = 0; i < 3; ++i) append_value(all, std::uint16_t{0xffff});
    return written(with_colour, surfels, all);
  };
  const Las las = standard(1);
  CHECK(las.point<std::uint16_t>(0, 12) == 0);
  CHECK(las.point<std::uint8_t>(0, 14) == 0x11);
  CHECK(las.point<std::uint8_t>(0, 15) == 0);
  CHECK(las.point<std::uint8_t>(0, 16) == 0);
  CHECK(las.point<std::int16_t>(0, 18) == 0);
  CHECK(las.point<double>(0, 22) == 0);
  CHECK(las.point<std::uint8_t>(0, 36) == 0xff);  // its description says what that means
  // The albedo is the colour: sRGB of 1/4 is 0.5370987
  CHECK(las.point<std::uint16_t>(0, 30) == 35199);
  CHECK(las.point<std::uint16_t>(0, 32) == 65535);
  CHECK(las.point<std::uint16_t>(0, 34) == 0);
  CHECK(standard(1 / 255.0).point<std::uint16_t>(0, 30) == 35199);
  info.text["las.header"] = "{}";
  const Las bytes = standard(1 / 255.0);
  CHECK(bytes.point<std::uint16_t>(0, 30) == 137);
  CHECK(bytes.point<std::uint16_t>(0, 32) == 255);
  CHECK(unknown_losses(OutputFormat::las, info) ==
        std::vector<std::string>{
            "LAS has no value for \"not known\": points without intensity, class_flags, "
            "classification, scan_angle, gps_time get 0 there.",
            "Points without return_number, number_of_returns become the first of one return."});
}

TEST_CASE("las writer: channels that fit no field, and surfels, become extra bytes",
          "[io][writers][las]") {
  const std::vector<Surfel> surfels = surfels_of(2);
  PointWriteInfo info = full_info(surfels);
  info.channels = {channel("occlusion", ChannelType::half),
                   channel("sky", ChannelType::half, 3),
                   channel("intensity", ChannelType::f32),
                   channel("id", ChannelType::u64),
                   {.name = "angle",
                    .type = ChannelType::i16,
                    .unit = "rad",
                    .no_value = 0xffff,
                    .scale = 0.5,
                    .offset = 3}};
  std::vector<std::byte> rows;
  for (int i = 0; i < 2; ++i) {
    for (const std::uint16_t half : std::initializer_list<std::uint16_t>{0x3800, 0x3c00, 0, 0x4000})
      append_value(rows, half);
    append_value(rows, -7.5F);
    append_value(rows, std::uint64_t{1} << 60 | static_cast<std::uint64_t>(i));
    append_value(rows, static_cast<std::int16_t>(-4 - i));
  }
  const Las las = written(info, surfels, rows);
  CHECK(las.format() == 7);
  CHECK(las.extra_names() ==
        std::vector<std::string>{"normal_x 9", "normal_y 9", "normal_z 9", "radius 9",
                                 "radiance_r 9", "radiance_g 9", "radiance_b 9", "emission_r 9",
                                 "emission_g 9", "emission_b 9", "occlusion 9", "sky_r 9",
                                 "sky_g 9", "sky_b 9", "intensity_ 9", "id 7", "angle 4"});
  CHECK(las.point_bytes() == 36 + 15 * 4 + 8 + 2);
  const std::string extra =
      las.bytes.substr(las.points_begin() + las.point_bytes() + 36, 15 * 4 + 8 + 2);
  CHECK(extra == raw(0.6F) + raw(-0.8F) + raw(0.0F) + raw(1.5F) + raw(1.0F) + raw(2.0F) +
                     raw(0.125F) + raw(0.0F) + raw(1.0F) + raw(3.0F) + raw(0.5F) + raw(1.0F) +
                     raw(0.0F) + raw(2.0F) + raw(-7.5F) + raw(std::uint64_t{1} << 60 | 1) +
                     raw(std::int16_t{-5}));
  // The albedo became the colour: sRGB of 1/4 is 0.5370987
  CHECK(las.point<std::uint16_t>(0, 30) == 35199);
  CHECK(las.point<std::uint16_t>(0, 32) == 65535);
  CHECK(las.point<std::uint16_t>(0, 34) == 0);
  // The description of `angle`: no data, scale and offset hold
  const std::string angle = las.record("LASF_Spec", 4).substr(16 * 192);
  CHECK(angle[3] == 1 + 8 + 16);
  CHECK(number_at<std::int64_t>(angle, 40) == -1);
  CHECK(number_at<double>(angle, 112) == 0.5);
  CHECK(number_at<double>(angle, 136) == 3);
  CHECK(angle.substr(160, 4) == std::string("rad\0", 4));
  CHECK(las.record("LASF_Spec", 4)[3] == 0);
}

TEST_CASE("las writer: names of extra bytes are at most 32 bytes long and unlike each other",
          "[io][writers][las]") {
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  const std::string longest(31, 'a');
  info.channels = {channel(longest.c_str(), ChannelType::u8, 3),
                   channel((longest.substr(1) + "b").c_str(), ChannelType::u8, 16),
                   channel((std::string(30, 'a') + "c").c_str(), ChannelType::u8, 16),
                   channel("blue", ChannelType::u8)};
  const Las las = written(info, surfels, std::vector<std::byte>(36));
  const std::vector<std::string> names = las.extra_names();
  REQUIRE(names.size() == 36);
  CHECK(names[0] == std::string(30, 'a') + "_r 1");
  CHECK(names[3] == std::string(29, 'a') + "_0 1");
  CHECK(names[18] == std::string(29, 'a') + "_15 1");
  CHECK(names[19] == std::string(28, 'a') + "__0 1");
  CHECK(names[35] == "blue_ 1");
}

TEST_CASE("las writer: more extra bytes than one record can describe are refused",
          "[io][writers][las]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  for (int i = 0; i < 341; ++i)
    info.channels.push_back(
        channel(std::string("c").append(std::to_string(i)).c_str(), ChannelType::u8));
  CHECK(written(info, surfels, std::vector<std::byte>(341)).extra_names().size() == 341);
  info.has_radius = true;
  CHECK_THROWS_AS(create_points(scratch / "a.las", OutputFormat::las, info), RequestError);
  CHECK(scratch.listing().empty());
}

TEST_CASE("las writer: bytes in fields of 16 bits are widened unless they come from a LAS file",
          "[io][writers][las]") {
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.channels = {stored_colour(ChannelType::u16)};
  info.channels[0].scale = 1 / 255.0;
  std::vector<std::byte> row;
  for (const int v : {255, 51, 300})
    append_value(row, static_cast<std::uint16_t>(v));  // 300: above
  const auto colour = [&] {
    const Las las = written(info, surfels, row);
    return std::array{las.point<std::uint16_t>(0, 30), las.point<std::uint16_t>(0, 32),
                      las.point<std::uint16_t>(0, 34)};
  };
  CHECK(colour() == std::array<std::uint16_t, 3>{65535, 13107, 65535});
  info.text["las.header"] = "{}";
  CHECK(colour() == std::array<std::uint16_t, 3>{255, 51, 255});
}

TEST_CASE("las writer: a colour from a channel takes the place of the stored one, which is kept",
          "[io][writers][las]") {
  const std::vector<Surfel> surfels = surfels_of(1);
  PointWriteInfo info = plain_info(surfels);
  info.has_albedo = true;
  info.channels = {stored_colour(ChannelType::u8), channel("occlusion", ChannelType::f32)};
  std::vector<std::byte> rows{std::byte{1}, std::byte{2}, std::byte{255}};
  append_value(rows, 1.0F);
  const Las stored = written(info, surfels, rows);
  CHECK(stored.point<std::uint16_t>(0, 30) == 257);
  CHECK(stored.point<std::uint16_t>(0, 34) == 65535);
  CHECK(stored.extra_names() == std::vector<std::string>{"occlusion 9"});
  info.colour_from = "occlusion";
  const Las shown = written(info, surfels, rows);
  for (const std::size_t offset : {30U, 32U, 34U})
    CHECK(shown.point<std::uint16_t>(0, offset) == 0);
  CHECK(shown.extra_names() == std::vector<std::string>{"albedo_r 9", "albedo_g 9", "albedo_b 9",
                                                        "rgb_r 1", "rgb_g 1", "rgb_b 1",
                                                        "occlusion 9"});
}

TEST_CASE("las writer: surfels and channels come back from a file as they went in",
          "[io][writers][las]") {
  const test::TemporaryDirectory scratch;
  const std::vector<Surfel> surfels = surfels_of(50);
  PointWriteInfo info = full_info(surfels);
  info.channels = {channel("occlusion", ChannelType::f32), channel("id", ChannelType::u16)};
  info.colour_from = "occlusion";  // so that the albedo has extra bytes of its own
  std::vector<std::byte> rows;
  for (std::uint16_t i = 0; i < 50; ++i) {
    append_value(rows, static_cast<float>(i) / 64);
    append_value(rows, i);
  }
  write_points(scratch / "a.las", OutputFormat::las, info, surfels, rows);
  const LasCloud back = read_las(scratch / "a.las");
  REQUIRE(back.surfels.size() == 50);
  for (std::size_t i = 0; i < 50; ++i) {
    CHECK(back.surfels[i].normal == surfels[i].normal);
    CHECK(back.surfels[i].radius == surfels[i].radius);
    CHECK(back.surfels[i].radiance == surfels[i].radiance);
    CHECK(back.surfels[i].emission == surfels[i].emission);
    CHECK(back.surfels[i].albedo == surfels[i].albedo);
    const std::size_t row = back.rows.size() / 50;
    CHECK(back.rows.substr((i + 1) * row - 6, 6) ==
          std::string(reinterpret_cast<const char*>(rows.data()) + 6 * i, 6));
  }
}

TEST_CASE("las writer: long records of a LAS file are those of the file that is written",
          "[io][writers][las]") {
  const test::TemporaryDirectory scratch;
  LasFile file{.minor = 4, .format = 6, .record_bytes = 30, .points = 1};
  file.records = las_point(1, 2, 3) + std::string(10, '\0');
  std::string all;
  for (const unsigned size : {20'000U, 60'000U, 0U, 65'535U, 20'001U, 60'001U}) {
    std::string payload(size, '\0');
    for (std::size_t i = 0; i < size; ++i) payload[i] = static_cast<char>(i * i >> 7);
    const auto number = static_cast<unsigned>(file.vlrs.size());
    file.vlrs.push_back(las_vlr("someone", number, payload));
    all += file.vlrs.back();
  }
  file.evlrs = {las_vlr("someone", 9, std::string(60'000, 'e'), true),
                las_vlr("someone", 10, std::string(300'000, 'f'), true)};
  const LasCloud cloud = read_las(scratch.file("a.las", file.bytes()));
  CHECK(cloud.info.notes.empty());
  PointWriteInfo info = plain_info(cloud.surfels);
  info.channels = cloud.info.channels;
  info.text = cloud.info.text;
  std::vector<std::byte> rows(cloud.rows.size());
  std::memcpy(rows.data(), cloud.rows.data(), rows.size());
  const Las las = written(info, cloud.surfels, rows);
  CHECK(las.at<std::uint32_t>(100) == 6);
  CHECK(las.points_begin() == 375 + all.size());
  CHECK(las.bytes.substr(375, all.size()) == all);
  CHECK(las.extended_records() == file.evlrs[0] + file.evlrs[1]);
}

TEST_CASE("las writer: extra bytes keep the names and descriptions that they had in a LAS file",
          "[io][writers][las]") {
  const test::TemporaryDirectory scratch;
  const auto description = [](unsigned type, std::string name, const std::string& says) {
    std::string out(192, '\0');
    out[2] = static_cast<char>(type);
    name.resize(32);
    out.replace(4, 32, name);
    return out.replace(160, says.size(), says);
  };
  LasFile file;
  file.points = 1;
  file.record_bytes = 20 + 2 + 4 + 6 + 12 + 1 + 1;
  file.records = las_point(1, 2, 3) + std::string(26, '\0');
  file.vlrs = {las_vlr("LASF_Spec", 4,
                       description(3, "Echo Width", "of the pulse [ns]") +
                           description(5, "Intensity", "Brightness") +
                           description(23, "Colours", "three") + description(9, "NormalX", "") +
                           description(9, "NormalY", "north") + description(9, "NormalZ", "") +
                           description(1, "echo width", "another") +
                           description(1, "z", "hides a coordinate"))};
  const auto path = scratch.file("a.las", file.bytes());
  const auto names_of = [&](const LasCloud& cloud) {
    PointWriteInfo info = plain_info(cloud.surfels);
    info.channels = cloud.info.channels;
    info.text = cloud.info.text;
    info.has_normals = cloud.info.has_normals;
    std::vector<std::byte> rows(cloud.rows.size());
    std::memcpy(rows.data(), cloud.rows.data(), rows.size());
    write_points(scratch / "b.las", OutputFormat::las, info, cloud.surfels, rows);
    return Las(scratch / "b.las").extra_names();
  };
  const LasCloud cloud = read_las(path);
  CHECK(names_of(cloud) == std::vector<std::string>{"NormalX 9", "NormalY 9", "NormalZ 9",
                                                    "Echo Width 3", "Intensity 5", "Colours_r 3",
                                                    "Colours_g 3", "Colours_b 3", "echo width 1",
                                                    "z_ 1"});
  const std::string list = Las(scratch / "b.las").record("LASF_Spec", 4);
  const auto says = [&](std::size_t i) {
    return std::string(list.substr(i * 192 + 160, 32).c_str());
  };
  CHECK(says(1) == "north");
  CHECK(says(2) == "1");  // the unit
  CHECK(says(3) == "of the pulse [ns]");
  CHECK(says(4) == "Brightness");
  CHECK(says(6) == "three");
  CHECK(says(8) == "another");
  // Written again, the names stay; without the records, or a header that fits them, they are plain
  CHECK(names_of(read_las(scratch / "b.las"))[3] == "Echo Width 3");
  LasCloud other = cloud;
  other.info.text["las.vlrs"] = "AAAA";
  CHECK(names_of(other)[3] == "echo_width 3");
  for (const char* header :
       {R"({"format":11,"record_length":99})", R"({"format":0})", "{}", "no"}) {
    other = cloud;
    other.info.text["las.header"] = header;
    CHECK(names_of(other)[3] == "echo_width 3");
  }
}
