// Reads the points of Houdini's classic geometry: .bgeo in binary and .geo as text. The fourth
// number of a position is a weight for curves, and is left out.
#include <algorithm>
#include <map>
#include <string>

#include <nlohmann/json.hpp>

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/geo_header.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/record_source.h"
#include "engine/io/text/text.h"
#include "format/text.h"

namespace ptc {
namespace {

class GeoSource : public RecordSource {
 public:
  explicit GeoSource(const std::filesystem::path& path)
      : stream_(path), header_(read_geo_header(stream_)), packed_(header_.numbers * 4) {
    set_layout(
        PointLayout(path, header_.fields,
                    {.owner = "the points of the BGEO", .float_colours = FloatColours::unbounded}));
  }

  [[nodiscard]] PointFileInfo info() const {
    PointFileInfo info;
    layout().describe(info);
    info.count = header_.points;
    info.notes = header_.notes;
    add_names(info);
    return info;
  }

 private:
  // Keeps the names of attributes that channels do not have, if they are short. Attributes that are
  // no part of the surfel are the last channels.
  void add_names(PointFileInfo& info) const {
    constexpr std::size_t kMostBytes = 1024;
    std::map<std::string, std::string> names = header_.parts;
    const auto is_plain = [](const RecordField& field) { return field.plain; };
    const auto plain = static_cast<std::size_t>(std::ranges::count_if(header_.fields, is_plain));
    auto channel = info.channels.end() - static_cast<std::ptrdiff_t>(plain);
    for (const RecordField& field : header_.fields) {
      if (!field.plain) continue;
      if (channel->name != field.channel.name) names[channel->name] = field.channel.name;
      ++channel;
    }
    std::erase_if(names, [](const auto& name) { return !is_utf8(name.second); });
    const std::string text = nlohmann::json(names).dump();
    if (!names.empty() && text.size() <= kMostBytes) info.text.emplace(kGeoNames, text);
  }

  const std::byte* next_record() override {
    if (done_ == header_.points) return nullptr;
    header_.text ? read_line() : read_binary();
    ++done_;
    return packed_.data();
  }

  void read_binary() {
    place_ = stream_.offset();
    std::ranges::copy(stream_.take(packed_.size()), packed_.begin());
    for (std::size_t at = 0; at < packed_.size(); at += 4) {
      std::reverse(packed_.data() + at, packed_.data() + at + 4);
    }
  }

  void read_line() {
    std::string_view line;
    do {
      if (!stream_.next_line(line)) {
        stream_.fail_at_line("the file ends too early: " + std::to_string(header_.points - done_) +
                             " points are missing");
      }
    } while (Words(line).rest().empty());
    // Attributes stand in parentheses, which mean nothing more.
    line_ = line;
    std::ranges::replace_if(
        line_, [](char c) { return c == '(' || c == ')'; }, ' ');
    Words words(line_);
    for (std::size_t i = 0; i < header_.numbers; ++i) {
      const ChannelType type = header_.is_integer[i] ? ChannelType::i32 : ChannelType::f32;
      const std::string_view word = words.next();
      if (word.empty()) stream_.fail_at_line("a value of the point is missing");
      if (!store_word(word, type, packed_.data() + 4 * i))
        stream_.fail_at_line("a value of the point is not of its type");
    }
    if (!words.next().empty())
      stream_.fail_at_line("the line has more values than the points have");
  }

  void fail_record(const std::string& rule) const override {
    if (header_.text) stream_.fail_at_line(rule);
    stream_.fail_at(place_, rule);
  }

  ByteStream stream_;
  GeoHeader header_;
  std::vector<std::byte> packed_;  // the point that was read last
  std::string line_;               // kept between calls
  std::uint64_t place_ = 0;        // offset of the point that was read last
  std::uint64_t done_ = 0;         // points that were read
};

}  // namespace

PointFile open_bgeo(const std::filesystem::path& path) {
  return open_source<GeoSource>(path);
}

}  // namespace ptc
