// Writes USD as text.
//
// The columns are collected in a file without a name, as numbers, and become text at the end, one
// after another:
//
//   point3f[] points = [(x, y, z), (x, y, z), ...]
//   float[] primvars:occlusion = [a, b, ...] (
//       interpolation = "vertex"
//   )
#include <algorithm>
#include <cstring>
#include <iterator>
#include <string>

#include <fmt/format.h>

#include "engine/io/cloud/usd_points.h"
#include "engine/io/file/buffered_output.h"

namespace ptc {
namespace {

constexpr std::size_t kBlockValues = 4096;  // values that are read and formatted at once

template <typename T>
void append_number(std::string& text, const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  fmt::format_to(std::back_inserter(text), "{}", value);
}

void append_number(std::string& text, ChannelType type, const std::byte* at) {
  using enum ChannelType;
  switch (type) {
    case f32:
      return append_number<float>(text, at);
    case f64:
      return append_number<double>(text, at);
    case u32:
      return append_number<std::uint32_t>(text, at);
    case u64:
      return append_number<std::uint64_t>(text, at);
    case i64:
      return append_number<std::int64_t>(text, at);
    default:
      return append_number<std::int32_t>(text, at);
  }
}

class UsdaWriter : public UsdWriter {
 public:
  UsdaWriter(const std::filesystem::path& target, const PointWriteInfo& info)
      : UsdWriter(info, 0, 0), out_(target), columns_file_(directory_of(out_.target())) {}

 private:
  void store(std::uint64_t offset, std::span<const std::byte> bytes) override {
    columns_file_.write_at(offset, bytes);
  }

  void end() override {
    flush();
    put_text(head());
    for (const UsdColumn& column : columns()) put_column(column);
    put_text(foot());
    out_.publish();
  }

  [[nodiscard]] std::string head() const {
    std::string text = "#usda 1.0\n(\n    defaultPrim = \"points\"\n";
    if (stage().metres_per_unit) {
      text += fmt::format("    metersPerUnit = {}\n", *stage().metres_per_unit);
    }
    text += fmt::format("    upAxis = \"{}\"\n)\n\ndef Points \"points\"\n{{\n", stage().up);
    const std::vector<glm::vec3> box = extent();
    return text + fmt::format("    float3[] extent = [({}, {}, {}), ({}, {}, {})]\n", box[0].x,
                              box[0].y, box[0].z, box[1].x, box[1].y, box[1].z);
  }

  void put_column(const UsdColumn& column) {
    put_text(fmt::format("    {}[] {} = [", column.type, column.name));
    std::vector<std::byte> block(kBlockValues * column.value_bytes());
    for (std::uint64_t done = 0; done < announced();) {
      const auto count =
          static_cast<std::size_t>(std::min<std::uint64_t>(kBlockValues, announced() - done));
      const auto values = std::span(block).first(count * column.value_bytes());
      columns_file_.read_at(column.begin + done * column.value_bytes(), values);
      put_values(column, values, done == 0);
      done += count;
    }
    // Say of a primvar that it has one value for each point, which USD does not assume
    put_text(column.source == UsdSource::position
                 ? "]\n"
                 : "] (\n        interpolation = \"vertex\"\n    )\n");
  }

  void put_values(const UsdColumn& column, std::span<const std::byte> values, bool first) {
    std::string text;
    const std::size_t bytes = channel_bytes(column.number);
    for (std::size_t at = 0; at < values.size(); at += column.value_bytes()) {
      if (at > 0 || !first) text += ", ";
      if (column.numbers > 1) text += '(';
      for (std::size_t i = 0; i < column.numbers; ++i) {
        if (i > 0) text += ", ";
        append_number(text, column.number, values.data() + at + i * bytes);
      }
      if (column.numbers > 1) text += ')';
    }
    put_text(text);
  }

  [[nodiscard]] std::string foot() const {
    if (!stage().translation) return "}\n";
    const glm::dvec3& by = *stage().translation;
    return fmt::format(
        "    double3 xformOp:translate = ({}, {}, {})\n"
        "    uniform token[] xformOpOrder = [\"xformOp:translate\"]\n}}\n",
        by.x, by.y, by.z);
  }

  void put_text(const std::string& text) { out_.put(text.data(), text.size()); }

  BufferedOutput out_;
  TempFile columns_file_;
};

}  // namespace

std::unique_ptr<PointWriter> create_usda(const std::filesystem::path& target,
                                         const PointWriteInfo& info) {
  return std::make_unique<UsdaWriter>(target, info);
}

}  // namespace ptc
