// Internal to the LAS reader: point records in the order of the file, from LAS or LAZ.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "engine/io/cloud/las_header.h"

namespace ptc {

/// Records as they lie in an uncompressed file, one after another.
struct LasBlock {
  std::span<const std::byte> records;  ///< a whole number of them; empty at the end of the file
  std::uint64_t offset = 0;            ///< in the file: of the first record, or of its chunk
  std::size_t stride = 0;  ///< bytes from one record to the next in the file; 0 in chunks
};

/// Takes a block of whole records.
using LasLook = std::function<void(std::span<const std::byte>)>;

/// Yields the records of a file.
class LasRecordSource {
 public:
  virtual ~LasRecordSource() = default;
  /// Returns the next records, which are valid until the next call.
  /// @throws DataError; std::system_error
  virtual LasBlock next() = 0;
  /// Calls look(records) for blocks of records from up to 17 places that are spread evenly over the
  /// file, 2^17 records or a few more in all; of a shorter file, for all of them. It ends what
  /// next() returned last, and changes nothing else.
  /// @throws DataError; std::system_error
  virtual void sample(const LasLook& look) = 0;
};

/// Opens the records of a file. The file and the header must outlive the source.
/// @throws DataError when the compression is not supported or its chunks break a rule;
///         std::system_error
[[nodiscard]] std::unique_ptr<LasRecordSource> open_las_records(const InputFile& file,
                                                                const LasHeader& header);

}  // namespace ptc
