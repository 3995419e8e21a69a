// Internal to the LAS reader: the fields of a point record as parts of the surfel, channels and
// rows of attributes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/io/cloud/las_header.h"
#include "format/schema.h"

namespace ptc {

/// A number of the surfel in the extra bytes of a record.
struct LasNumber {
  std::size_t offset = 0;  ///< in the record, bytes
  Channel channel;         ///< its type and what its values mean
};

/// Three numbers of the surfel that belong together.
using LasTriple = std::array<LasNumber, 3>;

/// The parts of the surfel that extra bytes hold.
struct LasSurfel {
  std::optional<LasTriple> normal;
  std::optional<LasNumber> radius;
  std::optional<LasTriple> radiance;
  std::optional<LasTriple> emission;
  std::optional<LasTriple> albedo;

  /// Returns the numbers of all parts, in the order of the record.
  [[nodiscard]] std::vector<LasNumber> numbers() const;
};

/// What a file calls a field of its extra bytes.
struct LasName {
  std::string channel;      ///< the channel that it became, or the name of surfel_name()
  std::string name;         ///< as the file has it
  std::string description;  ///< as the file has it
};

/// What the fields of a point record mean.
struct LasFields {
  std::vector<Channel> channels;  ///< in the order of a row
  LasSurfel surfel;
  std::vector<LasName> names;      ///< of the described extra bytes
  std::vector<std::string> notes;  ///< sentences for the user
};

/// Finds out what the fields of a file's records mean. Extra bytes that are floats, or integers
/// with a scale, are parts of the surfel where they have the names by which surfel_name() knows
/// them and a part is there as a whole; all other fields become channels.
/// @param header        its point format and the bytes of a record count
/// @param descriptions  payload of the record that describes extra bytes; may be empty
[[nodiscard]] LasFields make_las_fields(const LasHeader& header,
                                        std::span<const std::byte> descriptions);

/// Turns point records into rows of attributes, without what is part of the surfel.
class LasRows {
 public:
  LasRows(const LasHeader& header, const LasSurfel& surfel);
  /// Returns the bytes of a row.
  [[nodiscard]] std::size_t row_bytes() const noexcept { return row_bytes_; }
  /// Writes the row of a record.
  void write(const std::byte* record, std::byte* row) const noexcept;

 private:
  // Bytes that a row has as the record has them.
  struct Run {
    std::size_t from;
    std::size_t to;
    std::size_t bytes;
  };

  bool layered_;  // formats 6 to 10
  std::vector<Run> runs_;
  std::size_t row_bytes_;
};

}  // namespace ptc
