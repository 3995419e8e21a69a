// The XML section of an E57 file: which scans the file has, where their records lie, and of which
// fields these records are made (ASTM E2807, XML section).
//
//   e57Root
//     coordinateMetadata                       the coordinate reference system
//     data3D
//       vectorChild                            a scan
//         pose          rotation, translation  from the scan's coordinates to those of the file
//         colorLimits   colorRedMinimum ...
//         points        fileOffset, recordCount
//           prototype   cartesianX type minimum maximum ...   the fields, in the order of
//           bytestreams
//     images2D                                 pictures
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "engine/io/e57/pages.h"

namespace ptc {

/// The type of an E57 field. Fields of text have values of varying length, which nothing reads.
enum class E57Type { integer, scaled, float32, float64, text };

/// A field of the records of a scan.
struct E57Field {
  std::string name;  ///< with its prefix; that of the surface normals is always "nor:"
  E57Type type = E57Type::float64;
  std::int64_t minimum = 0;  ///< of an integer or scaled integer, before scale and offset
  std::int64_t maximum = 0;
  double scale = 1;   ///< finite, not 0; 1 for other types than scaled integers
  double offset = 0;  ///< finite; 0 for other types than scaled integers
  std::optional<std::array<double, 2>> range;  ///< what a float states; finite, ascending

  /// Says whether the values are integers, scaled or not.
  [[nodiscard]] bool is_integer() const noexcept {
    return type == E57Type::integer || type == E57Type::scaled;
  }
  /// Returns the number of bits that a value takes in the file; 0 when all values are equal. Text
  /// takes at least 8.
  [[nodiscard]] unsigned bits() const noexcept;
  /// Returns the number that a value stands for.
  /// @param value  an integer in two's complement, or the bits of a float
  [[nodiscard]] double real(std::uint64_t value) const noexcept;
};

/// The smallest and the greatest value that a colour may have.
struct E57Limits {
  double low = 0;   ///< finite
  double high = 0;  ///< finite, above `low`
};

/// A scan of the file: records of one shape, and where they were taken.
struct E57Scan {
  std::vector<E57Field> fields;  ///< at most kMaxFields; the names differ
  std::uint64_t records = 0;
  std::uint64_t section =
      0;                   ///< physical offset of the CompressedVector section; 0 without records
  bool has_pose = false;   ///< otherwise the pose is the identity
  glm::dmat3 rotation{1};  ///< from the scan's coordinates to those of the file
  glm::dvec3 translation{0};  ///< finite; where the scanner stood, metres
  std::optional<std::array<E57Limits, 3>> colour_limits;  ///< of red, green and blue
  double start = 0;  ///< GPS time of the first measurement, s; 0 when it is not known

  /// The greatest number of fields that a reader accepts.
  static constexpr std::size_t kMaxFields = 256;

  /// Returns the number of bits that a record takes in the file, those of text at the least.
  [[nodiscard]] std::uint64_t record_bits() const noexcept;
  /// Returns the index of the field of this name.
  [[nodiscard]] std::optional<std::size_t> find(std::string_view name) const noexcept;
};

/// What the XML section says.
struct E57Document {
  std::vector<E57Scan> scans;  ///< at most 65535
  std::string crs;             ///< coordinate reference system as WKT; may be empty
  std::size_t pictures = 0;    ///< images2D
  std::uint64_t records = 0;   ///< of all scans
};

/// Reads and checks the XML section of a file.
/// @throws DataError when the XML is not well-formed, has more than 16 MiB or is nested more than
/// 64
///         deep, or a scan breaks a rule; std::system_error
/// Memory: up to twenty times the length of the section, given back at the end.
[[nodiscard]] E57Document read_e57_document(E57Pages& pages);

}  // namespace ptc
