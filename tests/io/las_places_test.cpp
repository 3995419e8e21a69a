// Which channels fill the standard places of LAS records, and how values that do not fit are
// scaled.
#include <limits>

#include "engine/io/cloud/point_survey.h"
#include "tests/io/written_las.h"

using namespace ptc;
using namespace ptc::test;

namespace {

// One channel of some points, measured as the converter does it.
struct Column {
  PointWriteInfo info;
  std::vector<Surfel> surfels;
  std::vector<std::byte> rows;

  template <typename T>
  Column(Channel channel, const std::vector<T>& values)
      : surfels(surfels_of(static_cast<int>(values.size()))) {
    info = plain_info(surfels);
    info.channels = {std::move(channel)};
    for (const T value : values) append_value(rows, value);
    PointSurvey survey(OutputFormat::las, info.channels);
    survey.add(rows);
    survey.finish(info);
  }

  // Returns the numbers of a place of the written records.
  template <typename T>
  [[nodiscard]] std::vector<T> written_at(std::size_t offset) const {
    const Las las = written(info, surfels, rows);
    CHECK(las.extra_names().empty());
    std::vector<T> numbers;
    for (std::size_t i = 0; i < surfels.size(); ++i) numbers.push_back(las.point<T>(i, offset));
    return numbers;
  }
  [[nodiscard]] std::vector<std::string> extra_names() const {
    return written(info, surfels, rows).extra_names();
  }
  // Returns what is lost beside positions.
  [[nodiscard]] std::string lost() const {
    const std::vector<std::string> sentences = losses(OutputFormat::las, info);
    return sentences.size() == 1 ? std::string() : sentences.back();
  }
};

Channel floats(const char* name) {
  return {.name = name, .type = ChannelType::f32};
}

Channel doubles(const char* name) {
  return {.name = name, .type = ChannelType::f64};
}

using Words = std::vector<std::uint16_t>;
using Bytes = std::vector<std::uint8_t>;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kEndless = std::numeric_limits<float>::infinity();

}  // namespace

TEST_CASE("las places: an intensity of integers stays as it is, whatever its type",
          "[io][writers][las]") {
  const Column column(floats("intensity"), std::vector{0.0F, 1.0F, 65535.0F, kNan});
  CHECK(column.written_at<std::uint16_t>(12) == Words{0, 1, 65535, 0});
  CHECK(column.lost().empty());
  const Column ints({.name = "intensity", .type = ChannelType::i32},
                    std::vector<std::int32_t>{0, 65535});
  CHECK(ints.written_at<std::uint16_t>(12) == Words{0, 65535});
}

TEST_CASE("las places: an intensity up to 1 is spread over 16 bits", "[io][writers][las]") {
  const Column column(floats("intensity"), std::vector{0.0F, 0.5F, 1.0F, kEndless, -kEndless});
  CHECK(column.written_at<std::uint16_t>(12) == Words{0, 32768, 65535, 65535, 0});
  CHECK(column.lost() ==
        "Values of the channel intensity, from 0 to 1, are multiplied by 65535 and are rounded.");
}

TEST_CASE("las places: an intensity of PTS gets steps of 16 from -2048 on", "[io][writers][las]") {
  const Column column(floats("intensity"), std::vector{-2048.0F, -1.0F, 0.0F, 2047.0F});
  CHECK(column.written_at<std::uint16_t>(12) == Words{0, 32752, 32768, 65520});
  CHECK(column.lost() ==
        "Values of the channel intensity, from -2048 to 2047, become 16 (v + 2048).");
  const Column parts(floats("intensity"), std::vector{-0.5F, 0.03F});
  CHECK(parts.written_at<std::uint16_t>(12) == Words{32760, 32768});
  CHECK(parts.lost() ==
        "Values of the channel intensity, from -0.5 to 0.03, become 16 (v + 2048) and are "
        "rounded.");
}

TEST_CASE("las places: other intensities are rounded, or spread from the least to the greatest",
          "[io][writers][las]") {
  const Column rounded(floats("intensity"), std::vector{0.25F, 1.5F, 65534.9F});
  CHECK(rounded.written_at<std::uint16_t>(12) == Words{0, 2, 65535});
  CHECK(rounded.lost() ==
        "Values of the channel intensity, from 0.25 to 65534.9, are rounded to integers.");
  for (const double low : {-2049.0, -1e300, 0.0, 65536.0}) {
    const Column spread(doubles("intensity"), std::vector{low, 1e300, low});
    CHECK(spread.written_at<std::uint16_t>(12) == Words{0, 65535, 0});
  }
}

TEST_CASE("las places: a scaled intensity is written by what its integers mean",
          "[io][writers][las]") {
  const Channel scaled{.name = "intensity",
                       .type = ChannelType::i16,
                       .no_value = 0x8000,
                       .scale = 0.25,
                       .offset = 100};
  const Column column(scaled, std::vector<std::int16_t>{-400, 4, -32768});
  CHECK(column.written_at<std::uint16_t>(12) == Words{0, 101, 0});
}

TEST_CASE("las places: floats that are all integers of a field's range fill it",
          "[io][writers][las]") {
  CHECK(Column(floats("classification"), std::vector{0.0F, 255.0F}).written_at<std::uint8_t>(16) ==
        Bytes{0, 255});
  CHECK(Column(floats("user_data"), std::vector{0.0F, 255.0F}).written_at<std::uint8_t>(17) ==
        Bytes{0, 255});
  CHECK(
      Column(doubles("point_source_id"), std::vector{0.0, 65535.0}).written_at<std::uint16_t>(20) ==
      Words{0, 65535});
  CHECK(Column(floats("return_number"), std::vector{1.0F, 15.0F}).written_at<std::uint8_t>(14) ==
        Bytes{0x11, 0xff});
  CHECK(
      Column(floats("number_of_returns"), std::vector{1.0F, 15.0F}).written_at<std::uint8_t>(14) ==
      Bytes{0x11, 0xf1});
  CHECK(Column(floats("scan_direction"), std::vector{0.0F, 1.0F}).written_at<std::uint8_t>(15) ==
        Bytes{0, 64});
  CHECK(Column({.name = "gps_time", .type = ChannelType::i32}, std::vector<std::int32_t>{-7, 9})
            .written_at<double>(22) == std::vector{-7.0, 9.0});
}

TEST_CASE("las places: values beyond a field's range go to extra bytes whole, and that is said",
          "[io][writers][las]") {
  const auto misses = [](const Column& column, const std::string& held) {
    const std::string name = column.info.channels[0].name;
    CHECK(column.extra_names() == std::vector<std::string>{name + "_ 9"});
    CHECK(column.lost() == "The channel " + name + " goes to the extra bytes " + name +
                               "_, because the field of LAS holds " + held + " alone.");
  };
  misses({floats("classification"), std::vector{0.0F, 256.0F}}, "integers from 0 to 255");
  misses({floats("classification"), std::vector{-1.0F, 2.0F}}, "integers from 0 to 255");
  misses({floats("classification"), std::vector{0.5F, 2.0F}}, "integers from 0 to 255");
  misses({floats("return_number"), std::vector{16.0F}}, "integers from 0 to 15");
  misses({floats("point_source_id"), std::vector{65536.0F}}, "integers from 0 to 65535");
  misses({floats("scan_angle"), std::vector{180.5F}}, "degrees from -180 to 180");
}

TEST_CASE("las places: angles in degrees become steps of 0.006", "[io][writers][las]") {
  const std::vector<std::int16_t> steps{-30000, 83, 30000};
  const Column column(floats("scan_angle"), std::vector{-180.0F, 0.5F, 180.0F});
  CHECK(column.written_at<std::int16_t>(18) == steps);
  CHECK(column.lost() == "Values of the channel scan_angle are rounded to steps of 0.006 degrees.");
  const Column plain({.name = "scan_angle", .type = ChannelType::i16}, steps);
  CHECK(plain.written_at<std::int16_t>(18) == steps);
  CHECK(plain.lost() == "Integers of the channel scan_angle are taken as steps of 0.006 degrees.");
}

TEST_CASE("las places: only what needs it is measured", "[io][writers][las]") {
  const std::vector<Channel> channels{floats("intensity"),
                                      {.name = "classification", .type = ChannelType::u8},
                                      {.name = "user_data", .type = ChannelType::u16},
                                      {.name = "scan_angle", .type = ChannelType::i16},
                                      doubles("gps_time"),
                                      floats("other"),
                                      {.name = "nir", .type = ChannelType::f32, .components = 3}};
  CHECK(measured_channels(OutputFormat::las, channels) ==
        std::vector<std::string>{"intensity", "user_data"});
  CHECK(measured_channels(OutputFormat::ply, channels).empty());
}
