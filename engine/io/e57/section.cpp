// Walks the packets of a section and decodes blocks of records. What is decoded next is always the
// same record of every stream; streams that got more bytes than others keep them until then:
//
//   packet 1    X: records 0-9    Y: 0-7       block: records 0-7
//   packet 2    X: 10-15          Y: 8-15      block: records 8-15
#include "engine/io/e57/section.h"

#include <algorithm>
#include <array>
#include <bit>

#include "engine/io/e57/bit_pack.h"
#include "format/bytes.h"

namespace ptc {
namespace {

constexpr std::size_t kSectionHeader = 32;
constexpr std::uint8_t kCompressedVector = 1;
constexpr Field<std::uint8_t> kSectionType{0};
constexpr Field<std::uint64_t> kSectionBytes{8};
constexpr Field<std::uint64_t> kDataOffset{16};

enum PacketType : std::uint8_t { kIndex = 0, kData = 1, kEmpty = 2 };
constexpr Field<std::uint8_t> kPacketType{0};
constexpr Field<std::uint8_t> kPacketFlags{1};
constexpr Field<std::uint16_t> kPacketBytesLess1{2};
constexpr Field<std::uint16_t> kStreamCount{4};
constexpr std::size_t kPacketHeader = 4;
constexpr std::size_t kDataHeader = 6;
constexpr unsigned kRestart = 1;  // flag

// Bytes of all streams that may wait for other streams.
constexpr std::size_t kMaxWaiting = std::size_t{1} << 24;

}  // namespace

E57Section::E57Section(E57Pages& pages, const E57Scan& scan) : pages_(pages), scan_(scan) {
  streams_.resize(scan.fields.size());
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    const E57Field& field = scan.fields[i];
    streams_[i].width = field.type == E57Type::text ? 0 : field.bits();
  }
  if (scan.records > 0) read_header();
}

void E57Section::read_header() {
  // Find the section in the file.
  const std::uint64_t begin =
      pages_.logical(scan_.section, "the section of a scan", pages_.xml_offset());
  std::array<std::byte, kSectionHeader> header;
  pages_.read(begin, header);
  if (kSectionType.of(header.data()) != kCompressedVector) {
    pages_.fail_at(begin, "no CompressedVector section begins here");
  }
  const std::uint64_t bytes = kSectionBytes.of(header.data());
  if (bytes < kSectionHeader || bytes > pages_.size() - begin) {
    pages_.fail_at(begin + kSectionBytes.at, "the section's length does not fit in the file");
  }
  end_ = begin + bytes;
  at_ = pages_.logical(kDataOffset.of(header.data()), "the first packet of a section",
                       begin + kDataOffset.at);
  if (at_ < begin + kSectionHeader || at_ > end_) {
    pages_.fail_at(begin + kDataOffset.at, "the first packet is not inside its section");
  }
  packet_offset_ = at_;

  // Compare the number of records with the bits that the section can hold.
  const std::uint64_t bits = scan_.record_bits();
  const std::uint64_t most = bits == 0 ? kMaxEmptyRecords : 8 * (end_ - at_) / bits;
  if (scan_.records > most) {
    pages_.fail_at(begin, "the scan has " + std::to_string(scan_.records) +
                              " records, more than its section can hold");
  }
}

std::size_t E57Section::next() {
  // Read packets until every stream has a value.
  block_ = static_cast<std::size_t>(std::min<std::uint64_t>(kBlockRecords, scan_.records - read_));
  const auto ready = [&] {
    std::size_t count = block_;
    for (const Stream& stream : streams_) {
      if (stream.width > 0) count = std::min(count, stream.bits_left() / stream.width);
    }
    return count;
  };
  std::size_t count = ready();
  while (count == 0 && block_ > 0) {
    read_packet();
    count = ready();
  }

  // Decode the records that are whole.
  for (std::size_t i = 0; i < streams_.size(); ++i) decode(i, count);
  read_ += count;
  block_ = count;
  return count;
}

void E57Section::read_packet() {
  while (true) {
    packet_offset_ = at_;
    if (end_ - at_ < kPacketHeader) {
      pages_.fail_at(at_, "the section ends before record " + std::to_string(read_) + " of " +
                              std::to_string(scan_.records));
    }
    std::array<std::byte, kPacketHeader> header;
    pages_.read(at_, header);
    const unsigned type = kPacketType.of(header.data());
    const std::size_t bytes = std::size_t{kPacketBytesLess1.of(header.data())} + 1;
    if (type > kEmpty) pages_.fail_at(at_, "a packet has the unknown type " + std::to_string(type));
    if (bytes % 4 != 0) pages_.fail_at(at_, "the length of a packet is no multiple of 4");
    if (bytes > end_ - at_) pages_.fail_at(at_, "a packet goes on behind the end of its section");
    if (type == kData) return read_data_packet(bytes);
    at_ += bytes;
  }
}

void E57Section::read_data_packet(std::size_t bytes) {
  // Read the packet, and check the lengths of its streams.
  packet_.resize(bytes);
  pages_.read(at_, packet_);
  const std::byte* const packet = packet_.data();
  if (bytes < kDataHeader) pages_.fail_at(at_, "a data packet is shorter than its header");
  const std::size_t streams = kStreamCount.of(packet);
  if (streams != streams_.size()) {
    pages_.fail_at(at_, "a packet has " + std::to_string(streams) + " bytestreams, but the scan " +
                            std::to_string(streams_.size()) + " fields");
  }
  std::size_t from = kDataHeader + 2 * streams;
  if (from > bytes) pages_.fail_at(at_, "a data packet is shorter than its header");
  if ((kPacketFlags.of(packet) & kRestart) != 0) restart();

  // Append its bytes to the streams.
  for (std::size_t i = 0; i < streams; ++i) {
    const std::size_t length = load<std::uint16_t>(packet, kDataHeader + 2 * i);
    if (length > bytes - from) pages_.fail_at(at_, "a bytestream goes on behind its packet");
    append(i, std::span<const std::byte>(packet_).subspan(from, length));
    from += length;
  }
  std::size_t waiting = 0;
  for (const Stream& stream : streams_) waiting += stream.bytes.size() - stream.first_bit / 8;
  if (waiting > kMaxWaiting) {
    pages_.fail_at(at_, "bytestreams run more than 16 MiB ahead of others");
  }
  at_ += bytes;
}

void E57Section::append(std::size_t field, std::span<const std::byte> bytes) {
  Stream& stream = streams_[field];
  if (stream.width == 0) return;  // nobody reads it
  // Drop what was decoded once it is the greater part, so that no byte is moved often.
  const std::size_t done = stream.first_bit / 8;
  if (done >= stream.bytes.size() - done) {
    stream.bytes.erase(stream.bytes.begin(),
                       stream.bytes.begin() + static_cast<std::ptrdiff_t>(done));
    stream.first_bit %= 8;
  }
  stream.bytes.insert(stream.bytes.end(), bytes.begin(), bytes.end());
}

void E57Section::restart() {
  // An encoder ends a stream with a whole word, so up to one word less a bit is no value. The word
  // has 8, 16, 32 or 64 bits, just enough for a value.
  for (Stream& stream : streams_) {
    if (stream.bits_left() >= std::bit_ceil(std::max(stream.width, 8U))) {
      pages_.fail_at(at_, "a packet starts the compressor anew before a record is complete");
    }
    stream.bytes.clear();
    stream.first_bit = 0;
  }
}

void E57Section::decode(std::size_t field, std::size_t count) {
  const E57Field& type = scan_.fields[field];
  Stream& stream = streams_[field];
  if (type.type == E57Type::text) return;
  stream.values.resize(count);
  unpack_bits(stream.bytes, stream.first_bit, stream.width, stream.values);
  stream.first_bit += count * stream.width;
  if (!type.is_integer()) return;

  // Integers are stored as their distance from the minimum.
  const auto low = static_cast<std::uint64_t>(type.minimum);
  const std::uint64_t most = static_cast<std::uint64_t>(type.maximum) - low;
  for (std::size_t i = 0; i < count; ++i) {
    if (stream.values[i] > most) {
      pages_.fail_at(packet_offset_, "record " + std::to_string(read_ + i) + ": field '" +
                                         type.name.substr(0, 64) + "' is above its maximum");
    }
    stream.values[i] += low;
  }
}

}  // namespace ptc
