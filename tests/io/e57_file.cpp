#include "tests/io/e57_file.h"

#include <algorithm>
#include <stdexcept>

#include "engine/io/cloud/formats.h"
#include "tests/io/files.h"

namespace ptc::test {
namespace {

std::uint64_t physical(std::uint64_t logical, std::size_t page) {
  return logical / (page - 4) * page + logical % (page - 4);
}

}  // namespace

std::uint32_t crc32c_by_bits(std::string_view bytes) {
  // x^32 + x^28 + x^27 + ... with the lowest bits first, as iSCSI has it.
  std::uint32_t rest = 0xffffffff;
  for (const char c : bytes) {
    for (int bit = 0; bit < 8; ++bit) {
      const bool one = ((static_cast<unsigned char>(c) >> bit & 1) ^ (rest & 1)) != 0;
      rest = one ? rest >> 1 ^ 0x82f63b78 : rest >> 1;
    }
  }
  return ~rest;
}

std::string e57_pages(std::string_view logical, std::size_t page) {
  std::string file;
  for (std::size_t at = 0; at < logical.size(); at += page - 4) {
    std::string payload(logical.substr(at, page - 4));
    payload.resize(page - 4);
    const std::uint32_t crc = crc32c_by_bits(payload);
    file += payload;
    for (int shift = 24; shift >= 0; shift -= 8) file += static_cast<char>(crc >> shift & 255);
  }
  return file;
}

std::string e57_logical(std::string_view file, std::size_t page) {
  std::string logical;
  for (std::size_t at = 0; at < file.size(); at += page) logical += file.substr(at, page - 4);
  return logical;
}

std::string e57_bits(const std::vector<std::uint64_t>& values, unsigned width) {
  std::string bytes((values.size() * width + 7) / 8, '\0');
  std::size_t at = 0;
  for (const std::uint64_t value : values) {
    for (unsigned bit = 0; bit < width; ++bit, ++at) {
      if ((value >> bit & 1) != 0) bytes[at / 8] = static_cast<char>(bytes[at / 8] | 1 << at % 8);
    }
  }
  return bytes;
}

std::string e57_packet(const std::vector<std::string>& streams, char flags) {
  std::string body = raw(static_cast<std::uint16_t>(streams.size()));
  for (const std::string& stream : streams) body += raw(static_cast<std::uint16_t>(stream.size()));
  for (const std::string& stream : streams) body += stream;
  while (body.size() % 4 != 0) body += '\0';
  return std::string("\x01") + flags + raw(static_cast<std::uint16_t>(body.size() + 3)) + body;
}

E57File& E57File::scan(const std::string& fields, std::uint64_t records, const std::string& packets,
                       const std::string& more) {
  const std::uint64_t offset = section(packets);
  return data3d("<vectorChild type=\"Structure\">" + more +
                "<points type=\"CompressedVector\" fileOffset=\"" + std::to_string(offset) +
                "\" recordCount=\"" + std::to_string(records) +
                "\"><prototype type=\"Structure\">" + fields +
                "</prototype></points></vectorChild>");
}

E57File& E57File::root(const std::string& xml) {
  root_ += xml;
  return *this;
}

E57File& E57File::data3d(const std::string& xml) {
  scans_ += xml + "\n";
  return *this;
}

std::uint64_t E57File::section(const std::string& packets, std::uint64_t length) {
  const std::uint64_t begin = sections_.size();
  sections_ += raw(std::uint64_t{1}) + raw(length == 0 ? 32 + packets.size() : length) +
               raw(physical(begin + 32, page_)) + raw(std::uint64_t{0}) + packets;
  return physical(begin, page_);
}

std::string E57File::bytes() const {
  const std::string xml =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<e57Root type=\"Structure\" "
      "xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\" "
      "xmlns:s=\"http://www.libe57.org/E57_NOR_surface_normals.txt\">\n" +
      root_ + "<data3D type=\"Vector\">\n" + scans_ + "</data3D></e57Root>\n";
  std::string logical = sections_ + xml;
  const std::uint64_t pages = (logical.size() + page_ - 5) / (page_ - 4);
  logical.replace(0, 48,
                  "ASTM-E57" + raw(1U) + raw(0U) + raw(pages * page_) +
                      raw(physical(sections_.size(), page_)) + raw(std::uint64_t{xml.size()}) +
                      raw(std::uint64_t{page_}));
  return e57_pages(logical, page_);
}

std::string e57_field(const std::string& name, const std::string& type_and_more) {
  const std::size_t blank = type_and_more.find(' ');
  const std::string more = blank == std::string::npos ? "" : type_and_more.substr(blank);
  return "<" + name + " type=\"" + type_and_more.substr(0, blank) + "\"" + more + "/>";
}

std::string e57_fields(const std::vector<std::string>& names, const std::string& type_and_more) {
  std::string xml;
  for (const std::string& name : names) xml += e57_field(name, type_and_more);
  return xml;
}

std::string e57_xyz() {
  return e57_fields({"cartesianX", "cartesianY", "cartesianZ"}, "Float");
}

std::vector<std::string> e57_xyz_streams(std::size_t count) {
  std::vector<std::string> streams(3);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < count; ++i) {
      streams[axis] += raw(static_cast<double>(10 * axis + i));
    }
  }
  return streams;
}

std::string e57_xyz_packet(std::size_t count, const std::vector<std::string>& more) {
  std::vector<std::string> streams = e57_xyz_streams(count);
  streams.insert(streams.end(), more.begin(), more.end());
  return e57_packet(streams);
}

std::uint64_t Cloud::bits(std::size_t point, std::string_view name, std::size_t component) const {
  std::size_t row = 0;
  std::size_t at = 0;
  std::size_t bytes = 0;
  for (const Channel& each : info.channels) {
    if (each.name == name) {
      bytes = channel_bytes(each.type);
      at = row + component * bytes;
    }
    row += channel_bytes(each.type) * each.components;
  }
  if (bytes == 0) return ~std::uint64_t{0};
  std::uint64_t value = 0;
  std::memcpy(&value, &rows.at(point * row + at), bytes);
  return value;
}

const Channel& Cloud::channel(std::string_view name) const {
  const auto found = std::ranges::find(info.channels, name, &Channel::name);
  if (found == info.channels.end()) throw std::out_of_range("no channel " + std::string(name));
  return *found;
}

Cloud read_e57(const std::filesystem::path& path, std::size_t block) {
  PointFile file = open_e57(path);
  Cloud cloud;
  cloud.info = file.info;
  std::vector<Surfel> some(block);
  while (const std::size_t count = file.source->next(some)) {
    cloud.surfels.insert(cloud.surfels.end(), some.begin(),
                         some.begin() + static_cast<std::ptrdiff_t>(count));
    const auto rows = file.source->attributes();
    cloud.rows.insert(cloud.rows.end(), rows.begin(), rows.end());
  }
  cloud.left_out = file.source->left_out();
  return cloud;
}

Cloud read_e57_scan(const std::string& fields, std::size_t count,
                    const std::vector<std::string>& streams, const std::string& more) {
  const TemporaryDirectory scratch;
  E57File file;
  file.scan(e57_xyz() + fields, count, e57_xyz_packet(count, streams), more);
  return read_e57(scratch.file("a.e57", file.bytes()));
}

}  // namespace ptc::test
