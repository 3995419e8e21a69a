// The binary section of a scan: packets that carry a piece of each field's bytestream (ASTM E2807,
// CompressedVector).
//
//   section header 32   length, where data begin, where an index begins
//   data packet         type 1, flags, length - 1, n, n lengths | bytes of stream 0 | of stream 1
//   ... index packet        type 0: serves random access; passed over empty packet        type 2;
//   passed over
//
// The pieces of a stream are one sequence of bits. A packet need not carry equally many values of
// each stream, so each has a buffer, and a record can be read when every buffer has a value.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/io/e57/document.h"
#include "engine/io/e57/pages.h"

namespace ptc {

/// Reads the records of a scan in their order, column by column in blocks.
///
/// Memory: 64 KiB of packet, up to 16 MiB of streams that run ahead of others, and a block.
class E57Section {
 public:
  /// The greatest number of records in a block.
  static constexpr std::size_t kBlockRecords = 512;
  /// The greatest number of records in a scan whose records take no space.
  static constexpr std::uint64_t kMaxEmptyRecords = 65536;

  /// Reads the header of the section and checks it against the file and the number of records. Both
  /// arguments must outlive this object.
  /// @throws DataError; std::system_error
  E57Section(E57Pages& pages, const E57Scan& scan);

  /// Reads the next block of records. @return their number; 0 behind the last one
  /// @throws DataError when a packet breaks a rule, the section ends too early, or an integer is
  ///         above the maximum of its field; std::system_error
  std::size_t next();
  /// Returns the values of a field in the block that next() read last, as E57Field::real() takes
  /// them. Empty for fields of text. Valid until the next call of next().
  [[nodiscard]] std::span<const std::uint64_t> column(std::size_t field) const noexcept {
    return streams_[field].values;
  }
  /// Returns the number of records that were read before the block that next() read last.
  [[nodiscard]] std::uint64_t block_begin() const noexcept { return read_ - block_; }
  /// Returns the logical offset of the packet that was read last, for errors.
  [[nodiscard]] std::uint64_t packet_offset() const noexcept { return packet_offset_; }

 private:
  // The bytes of one field that were read and not yet decoded.
  struct Stream {
    unsigned width = 0;  // bits of a value
    std::vector<std::byte> bytes;
    std::size_t first_bit = 0;  // of the next value in `bytes`
    std::vector<std::uint64_t> values;

    [[nodiscard]] std::size_t bits_left() const noexcept { return 8 * bytes.size() - first_bit; }
  };

  void read_header();
  // Reads packets up to a data packet and appends its bytes to the streams.
  void read_packet();
  void read_data_packet(std::size_t bytes);
  void append(std::size_t field, std::span<const std::byte> bytes);
  // Ends the numbers before a packet that starts the compressor anew.
  void restart();
  void decode(std::size_t field, std::size_t count);

  E57Pages& pages_;
  const E57Scan& scan_;
  std::vector<Stream> streams_;
  std::vector<std::byte> packet_;    // the packet that was read last
  std::uint64_t at_ = 0;             // logical offset of the next packet
  std::uint64_t end_ = 0;            // logical offset of the end of the section
  std::uint64_t packet_offset_ = 0;  // logical
  std::uint64_t read_ = 0;           // records that were decoded
  std::size_t block_ = 0;            // records in the block
};

}  // namespace ptc
