// Internal to the LAS reader: the header of a file and the list of its records.
//
//   header | variable-length records (VLR) | points | extended records (EVLR)
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/surfel.h"
#include "engine/io/file/file.h"

namespace ptc {

/// The user and the number of the record that says how the points of a LAZ file are compressed.
inline constexpr std::string_view kLaszipUser = "laszip encoded";
inline constexpr unsigned kLaszipNumber = 22204;

/// The last point format of LAS.
inline constexpr unsigned kMaxLasFormat = 10;

/// A variable-length record: a header of 54 bytes, or 60 of an extended one, and a payload.
struct LasRecord {
  std::string user;           ///< who defined it, e.g. "LASF_Projection"
  unsigned number = 0;        ///< which of the user's records it is
  std::uint64_t offset = 0;   ///< of its header in the file
  std::uint64_t payload = 0;  ///< offset of the payload
  std::uint64_t bytes = 0;    ///< of the payload
  bool extended = false;
};

/// What the header of a LAS or LAZ file says. The texts are as in the file, without zeros at their
/// ends.
struct LasHeader {
  unsigned minor = 0;       ///< of version 1.MINOR
  unsigned format = 0;      ///< of the points, 0 to 10
  bool compressed = false;  ///< a LAZ file
  std::size_t record_bytes = 0;
  std::uint64_t points = 0;
  std::uint64_t points_offset = 0;
  std::array<double, 3> scale{};
  std::array<double, 3> offset{};
  Bounds bounds;  ///< of the points, as the writer says; may be anything; scene units
  unsigned source = 0;
  unsigned encoding = 0;  ///< global encoding bits
  std::array<std::uint8_t, 16> guid{};
  std::string system;
  std::string software;
  unsigned day = 0;
  unsigned year = 0;
  std::vector<LasRecord> records;  ///< VLRs, then EVLRs, in the order of the file

  /// Returns the first record of this user and number that is not empty; null when there is none.
  [[nodiscard]] const LasRecord* find(std::string_view user, unsigned number) const noexcept;
};

/// Throws a DataError about the bytes of a file at an offset.
[[noreturn]] void refuse_las(const InputFile& file, std::uint64_t offset, const std::string& rule);

/// Reads the header and the list of records. The points of an uncompressed file are compared with
/// its size.
/// @throws DataError that names file, offset and rule; std::system_error
[[nodiscard]] LasHeader read_las_header(const InputFile& file);

/// Returns the payload of a record, or nothing when it is over 1 MiB.
/// @throws std::system_error
[[nodiscard]] std::optional<std::vector<std::byte>> read_las_payload(const InputFile& file,
                                                                     const LasRecord& record);

}  // namespace ptc
