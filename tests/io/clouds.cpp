#include "tests/io/clouds.h"

#include <cstring>
#include <stdexcept>

#include <catch2/catch.hpp>

namespace ptc {
namespace {

template <typename T>
double as(const std::byte* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return static_cast<double>(value);
}

double number(const std::byte* from, ChannelType type) {
  switch (type) {
    case ChannelType::u8:
      return as<std::uint8_t>(from);
    case ChannelType::u16:
      return as<std::uint16_t>(from);
    case ChannelType::u32:
      return as<std::uint32_t>(from);
    case ChannelType::u64:
      return as<std::uint64_t>(from);
    case ChannelType::i8:
      return as<std::int8_t>(from);
    case ChannelType::i16:
      return as<std::int16_t>(from);
    case ChannelType::i32:
      return as<std::int32_t>(from);
    case ChannelType::i64:
      return as<std::int64_t>(from);
    case ChannelType::f32:
      return as<float>(from);
    case ChannelType::f64:
      return as<double>(from);
    case ChannelType::half:
      break;
  }
  throw std::out_of_range("no reader gives half");
}

}  // namespace

double Cloud::value(std::size_t point, const std::string& name, std::size_t component) const {
  std::size_t row = 0;
  for (const Channel& c : info.channels) row += c.components * c.component_bytes();
  std::size_t at = point * row;
  for (const Channel& c : info.channels) {
    if (c.name == name) return number(&rows.at(at + component * c.component_bytes()), c.type);
    at += c.components * c.component_bytes();
  }
  throw std::out_of_range(name);
}

const Channel& Cloud::channel(const std::string& name) const {
  for (const Channel& c : info.channels) {
    if (c.name == name) return c;
  }
  throw std::out_of_range(name);
}

std::string Cloud::names() const {
  std::string all;
  for (const Channel& c : info.channels) all += (all.empty() ? "" : " ") + c.name;
  return all;
}

std::string Cloud::notes() const {
  std::string all;
  for (const std::string& note : info.notes) all += (all.empty() ? "" : "\n") + note;
  return all;
}

Cloud read_cloud(const std::filesystem::path& path, std::size_t block) {
  PointFile file = open_points(path);
  Cloud cloud;
  std::vector<Surfel> some(block);
  while (const std::size_t count = file.source->next(some)) {
    cloud.surfels.insert(cloud.surfels.end(), some.begin(),
                         some.begin() + static_cast<std::ptrdiff_t>(count));
    const auto rows = file.source->attributes();
    cloud.rows.insert(cloud.rows.end(), rows.begin(), rows.end());
  }
  CHECK(file.source->next(some) == 0);
  CHECK(file.source->attributes().empty());
  cloud.left_out = file.source->left_out();
  cloud.info = std::move(file.info);
  std::size_t row = 0;
  for (const Channel& c : cloud.info.channels) row += c.components * c.component_bytes();
  CHECK(cloud.rows.size() == row * cloud.surfels.size());
  if (cloud.info.count) CHECK(*cloud.info.count == cloud.surfels.size() + cloud.left_out);
  return cloud;
}

std::string cloud_fault(const test::TemporaryDirectory& scratch, const std::string& name,
                        const std::string& bytes) {
  const auto path = scratch.file(name, bytes);
  std::string text = refusal([&] { static_cast<void>(read_cloud(path)); });
  const std::string prefix = path.string() + ": ";
  if (!text.empty()) CHECK(text.starts_with(prefix));
  return text.starts_with(prefix) ? text.substr(prefix.size()) : text;
}

}  // namespace ptc
