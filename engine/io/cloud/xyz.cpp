// Reads clouds from XYZ text: "x y z [nx ny nz [radius [r g b]]]" on each line.
#include <array>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/cloud/surfel_check.h"
#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

constexpr std::size_t kMaxValues = 10;

class XyzSource : public PointSource {
 public:
  explicit XyzSource(const std::filesystem::path& path) : stream_(path) { read_line(); }

  [[nodiscard]] PointFileInfo info() const {
    return {std::nullopt, columns_ >= 6, columns_ >= 7, columns_ == 10, false};
  }

  std::size_t next(std::span<Surfel> out) override {
    std::size_t count = 0;
    for (; count < out.size() && has_line_; ++count, ++done_) {
      const std::string rule = convert_surfel(raw(), columns_ >= 6, out[count]);
      if (!rule.empty()) {
        stream_.fail_at_line("point " + std::to_string(done_) + ": " + rule);
      }
      read_line();
    }
    return count;
  }

 private:
  // Reads the values of the next line that has some. The first such line decides how many values
  // every line has.
  void read_line() {
    std::string_view line;
    std::size_t count = 0;
    while (count == 0) {
      has_line_ = stream_.next_line(line);
      if (!has_line_) return;
      count = read_values(line.substr(0, line.find('#')));
    }
    if (columns_ == 0) {
      if (count != 3 && count != 6 && count != 7 && count != 10) {
        stream_.fail_at_line(std::to_string(count) +
                             " values, but lines of XYZ have 3, 6, 7 or 10");
      }
      columns_ = count;
    }
    if (count != columns_) {
      stream_.fail_at_line(std::to_string(count) + " values, but the first line has " +
                           std::to_string(columns_));
    }
  }

  std::size_t read_values(std::string_view line) {
    Words words(line);
    std::size_t count = 0;
    for (std::string_view word = words.next(); !word.empty(); word = words.next()) {
      const std::optional<double> value = parse_number(word);
      if (!value) stream_.fail_at_line("a value is not a number");
      if (count == kMaxValues) stream_.fail_at_line("the line has more than 10 values");
      values_[count++] = *value;
    }
    return count;
  }

  [[nodiscard]] RawSurfel raw() const {
    RawSurfel surfel;
    surfel.position = {values_[0], values_[1], values_[2]};
    if (columns_ >= 6) surfel.normal = {values_[3], values_[4], values_[5]};
    if (columns_ >= 7) surfel.radius = values_[6];
    if (columns_ >= 10) surfel.radiance = {values_[7], values_[8], values_[9]};
    return surfel;
  }

  ByteStream stream_;
  std::array<double, kMaxValues> values_{};  // of the line that was read last
  std::size_t columns_ = 0;                  // values in each line; 0 before the first
  bool has_line_ = false;                    // values_ holds a line that next() has not returned
  std::uint64_t done_ = 0;                   // points that next() has returned
};

}  // namespace

PointFile open_xyz(const std::filesystem::path& path) {
  auto source = std::make_unique<XyzSource>(path);
  const PointFileInfo info = source->info();
  return {info, std::move(source)};
}

}  // namespace ptc
