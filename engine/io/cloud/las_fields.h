// Internal to the LAS reader: the fields of a point record as channels and rows of attributes.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "engine/io/cloud/las_header.h"
#include "format/schema.h"

namespace ptc {

/// The channels of a LAS file, in the order of a row.
struct LasChannels {
  std::vector<Channel> channels;
  std::vector<std::string> notes;  ///< sentences for the user
};

/// Makes the channels of a file.
/// @param descriptions  payload of the record that describes extra bytes; may be empty
[[nodiscard]] LasChannels make_las_channels(const LasHeader& header,
                                            std::span<const std::byte> descriptions);

/// Turns point records into rows of attributes.
class LasRows {
 public:
  explicit LasRows(const LasHeader& header);
  /// Returns the bytes of a row.
  [[nodiscard]] std::size_t row_bytes() const noexcept { return row_bytes_; }
  /// Writes the row of a record.
  void write(const std::byte* record, std::byte* row) const noexcept;

 private:
  bool layered_;      // formats 6 to 10
  std::size_t tail_;  // offset in the record of the fields that rows have as they are
  std::size_t tail_bytes_;
  std::size_t row_bytes_;
};

}  // namespace ptc
