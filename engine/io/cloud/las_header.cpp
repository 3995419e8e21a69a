// Reads the header of LAS 1.0 to 1.5 and walks its records.
//
//   offset  field                          offset  field
//        0  "LASF"                            104  point format u8; bit 7: compressed
//        4  source u16, encoding u16          105  bytes of a point record u16
//        8  GUID                              107  points u32; since 1.4 kept for old readers
//       24  version u8 u8                     131  scale x y z f64, offset x y z f64
//       26  system, software: 32 bytes each   179  bounds: max and min of x, of y, of z f64
//       90  day u16, year u16                 227  since 1.3: offset of wave packets u64
//       94  bytes of the header u16           235  since 1.4: offset of EVLRs u64, their number u32
//       96  offset of points u32              247  since 1.4: points u64
//      100  number of VLRs u32
//
// Every number is compared with the size of the file before it leads anywhere.
// Source: LAS Specification 1.4 R15, ASPRS 2019; versions 1.0 to 1.3.
#include "engine/io/cloud/las_header.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "engine/base/error.h"
#include "engine/io/cloud/las_vlrs.h"
#include "engine/io/laz/layout.h"
#include "format/bytes.h"

namespace ptc {
namespace {

constexpr std::size_t kHeaderBytes = 227;    // of versions 1.0 to 1.2
constexpr std::size_t kHeaderBytes13 = 235;  // of version 1.3
constexpr std::size_t kHeaderBytes14 = 375;  // of version 1.4; later ones have more
constexpr std::uint64_t kMaxPayload = std::uint64_t{1} << 20;
constexpr std::size_t kMaxRecordBytes = 2048;
constexpr unsigned kMaxMinor = 5;

// Returns the text of a field that zeros fill up.
std::string text_at(std::span<const std::byte> bytes, std::size_t at, std::size_t size) {
  std::string text(reinterpret_cast<const char*>(bytes.data()) + at, size);
  text.resize(text.find_last_not_of('\0') + 1);
  return text;
}

// Returns the text of a field up to its first zero.
std::string name_at(std::span<const std::byte> bytes, std::size_t at, std::size_t size) {
  std::string text = text_at(bytes, at, size);
  return text.substr(0, text.find('\0'));
}

class HeaderReader {
 public:
  explicit HeaderReader(const InputFile& file) : file_(file) {}

  LasHeader read() {
    read_bytes();
    read_version();
    read_facts();
    read_layout();
    read_placement();
    read_vlrs();
    const std::uint64_t evlrs = minor() >= 4 && evlr_count() > 0 ? evlr_offset() : file_.size();
    if (minor() >= 4 && evlr_count() > 0) read_evlrs();
    if (header_.find(kLaszipUser, kLaszipNumber) != nullptr) header_.compressed = true;
    if (!header_.compressed) check_points(std::min(evlrs, waves_offset()));
    return std::move(header_);
  }

 private:
  [[noreturn]] void fail(std::uint64_t offset, const std::string& rule) const {
    refuse_las(file_, offset, rule);
  }

  [[nodiscard]] unsigned minor() const noexcept { return header_.minor; }
  [[nodiscard]] std::uint64_t evlr_offset() const {
    return load<std::uint64_t>(bytes_.data(), 235);
  }
  [[nodiscard]] std::uint32_t evlr_count() const { return load<std::uint32_t>(bytes_.data(), 243); }

  void read_bytes() {
    bytes_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(file_.size(), kHeaderBytes14)));
    file_.read_at(0, bytes_);
    if (bytes_.size() < 4 || std::memcmp(bytes_.data(), "LASF", 4) != 0) fail(0, "not a LAS file");
    if (bytes_.size() < kHeaderBytes) fail(bytes_.size(), "the file ends inside the LAS header");
  }

  void read_version() {
    const auto major = load<std::uint8_t>(bytes_.data(), 24);
    header_.minor = load<std::uint8_t>(bytes_.data(), 25);
    if (major != 1 || minor() > kMaxMinor) {
      fail(24, "LAS version " + std::to_string(major) + "." + std::to_string(minor()) +
                   " is not supported");
    }
    header_bytes_ = load<std::uint16_t>(bytes_.data(), 94);
    const std::size_t least = minor() >= 4   ? kHeaderBytes14
                              : minor() == 3 ? kHeaderBytes13
                                             : kHeaderBytes;
    if (header_bytes_ < least) {
      fail(94, "the LAS header has " + std::to_string(header_bytes_) + " bytes, but version 1." +
                   std::to_string(minor()) + " has " + std::to_string(least));
    }
    if (bytes_.size() < least || file_.size() < header_bytes_)
      fail(file_.size(), "the file ends inside the LAS header");
  }

  // Reads what only a writer of LAS files needs.
  void read_facts() {
    header_.source = load<std::uint16_t>(bytes_.data(), 4);
    header_.encoding = load<std::uint16_t>(bytes_.data(), 6);
    std::memcpy(header_.guid.data(), bytes_.data() + 8, header_.guid.size());
    header_.system = text_at(bytes_, 26, 32);
    header_.software = text_at(bytes_, 58, 32);
    header_.day = load<std::uint16_t>(bytes_.data(), 90);
    header_.year = load<std::uint16_t>(bytes_.data(), 92);
  }

  void read_layout() {
    const unsigned format = load<std::uint8_t>(bytes_.data(), 104);
    header_.compressed = (format & 0x80) != 0;
    header_.format = format & 0x7f;
    if (header_.format > kMaxLasFormat)
      fail(104, "point format " + std::to_string(header_.format) + " is not supported");
    header_.record_bytes = load<std::uint16_t>(bytes_.data(), 105);
    if (header_.record_bytes < laz::format_bytes(header_.format)) {
      fail(105, "point records have " + std::to_string(header_.record_bytes) +
                    " bytes, but point format " + std::to_string(header_.format) + " needs " +
                    std::to_string(laz::format_bytes(header_.format)));
    }
    if (header_.record_bytes > kMaxRecordBytes)
      fail(105, "point records of more than 2048 bytes are not supported");
    for (std::size_t axis = 0; axis < 3; ++axis) {
      header_.scale[axis] = load<double>(bytes_.data(), 131 + 8 * axis);
      header_.offset[axis] = load<double>(bytes_.data(), 155 + 8 * axis);
      const auto k = static_cast<int>(axis);
      header_.bounds.high[k] = load<double>(bytes_.data(), 179 + 16 * axis);
      header_.bounds.low[k] = load<double>(bytes_.data(), 187 + 16 * axis);
      if (!std::isfinite(header_.scale[axis]) || header_.scale[axis] == 0)
        fail(131 + 8 * axis, "a scale of coordinates is 0 or not a number");
      if (!std::isfinite(header_.offset[axis]))
        fail(155 + 8 * axis, "an offset of coordinates is not a number");
    }
  }

  void read_placement() {
    const std::uint64_t legacy = load<std::uint32_t>(bytes_.data(), 107);
    header_.points = legacy;
    if (minor() >= 4) {
      const auto count = load<std::uint64_t>(bytes_.data(), 247);
      if (count != 0) header_.points = count;
      if (count != 0 && legacy != 0 && count != legacy) {
        fail(247, "the header counts " + std::to_string(count) + " points here and " +
                      std::to_string(legacy) + " in its old field");
      }
    }
    header_.points_offset = load<std::uint32_t>(bytes_.data(), 96);
    if (header_.points_offset < header_bytes_) fail(96, "the points begin inside the header");
    if (header_.points_offset > file_.size()) fail(file_.size(), "the file ends before its points");
  }

  void read_vlrs() {
    const auto count = load<std::uint32_t>(bytes_.data(), 100);
    std::uint64_t offset = header_bytes_;
    for (std::uint32_t i = 0; i < count; ++i)
      offset = read_record(offset, header_.points_offset, kVlrHeaderBytes, "the points");
  }

  void read_evlrs() {
    std::uint64_t offset = evlr_offset();
    if (offset < header_.points_offset || offset > file_.size())
      fail(235, "the extended records begin before the points or after the end of the file");
    for (std::uint32_t i = 0; i < evlr_count(); ++i)
      offset = read_record(offset, file_.size(), kEvlrHeaderBytes, "the end of the file");
  }

  // Reads the header of a record, which lies before `end`, and returns where it ends.
  std::uint64_t read_record(std::uint64_t offset, std::uint64_t end, std::uint64_t header_bytes,
                            const char* what_follows) {
    if (header_bytes > end - offset)
      fail(offset, std::string("a record's header goes on past ") + what_follows);
    std::array<std::byte, kEvlrHeaderBytes> header;
    file_.read_at(offset, std::span(header).first(static_cast<std::size_t>(header_bytes)));
    LasRecord record;
    record.extended = header_bytes == kEvlrHeaderBytes;
    record.user = name_at(header, 2, 16);
    record.number = load<std::uint16_t>(header.data(), 18);
    record.offset = offset;
    record.payload = offset + header_bytes;
    record.bytes = record.extended ? load<std::uint64_t>(header.data(), 20)
                                   : load<std::uint16_t>(header.data(), 20);
    if (record.bytes > end - record.payload) {
      fail(offset, "record " + std::to_string(record.number) + " goes on past " + what_follows);
    }
    header_.records.push_back(record);
    return record.payload + record.bytes;
  }

  // Returns where waves begin inside the file, or the end of the file when it has none.
  [[nodiscard]] std::uint64_t waves_offset() const {
    if (minor() < 3 || !laz::has_wave_packet(header_.format)) return file_.size();
    const auto offset = load<std::uint64_t>(bytes_.data(), 227);
    return offset < header_.points_offset ? file_.size() : std::min(offset, file_.size());
  }

  // Checks that the points fill the bytes from their offset to `end`.
  void check_points(std::uint64_t end) const {
    const std::uint64_t room = end - header_.points_offset;
    const std::uint64_t fit = room / header_.record_bytes;
    if (header_.points > fit) {
      fail(end, "the header counts " + std::to_string(header_.points) + " points of " +
                    std::to_string(header_.record_bytes) + " bytes, but only " +
                    std::to_string(fit) + " lie before this place");
    }
    if (header_.points < fit) {
      fail(header_.points_offset + header_.points * header_.record_bytes,
           "the header counts " + std::to_string(header_.points) + " points, but " +
               std::to_string(room - header_.points * header_.record_bytes) + " bytes follow them");
    }
  }

  const InputFile& file_;
  std::vector<std::byte> bytes_;  // of the header, as far as it is read
  std::uint64_t header_bytes_ = 0;
  LasHeader header_;
};

}  // namespace

const LasRecord* LasHeader::find(std::string_view user, unsigned number) const noexcept {
  const auto found = std::ranges::find_if(records, [&](const LasRecord& record) {
    return record.user == user && record.number == number && record.bytes > 0;
  });
  return found == records.end() ? nullptr : &*found;
}

void refuse_las(const InputFile& file, std::uint64_t offset, const std::string& rule) {
  throw DataError(file.path().string() + ": offset " + std::to_string(offset) + ": " + rule);
}

LasHeader read_las_header(const InputFile& file) {
  return HeaderReader(file).read();
}

std::optional<std::vector<std::byte>> read_las_payload(const InputFile& file,
                                                       const LasRecord& record) {
  if (record.bytes > kMaxPayload) return std::nullopt;
  std::vector<std::byte> payload(static_cast<std::size_t>(record.bytes));
  file.read_at(record.payload, payload);
  return payload;
}

}  // namespace ptc
