// A reader of PLY files: the header, and records of any shape. Source: Turk, "The PLY Polygon File
// Format", 1994.
//
//   ply                            magic
//   format ascii 1.0               PlyEncoding
//   element vertex 8               PlyElement: a name and the number of its records
//   property float x               PlyProperty of the element above: a scalar ...
//   property list uchar int face   ... or a list: a length, then that many values
//   end_header
//   records of the first element, records of the second element, ...
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/io/text/byte_stream.h"

namespace ptc {

/// The encoding of the records of a PLY file.
enum class PlyEncoding { ascii, little_endian, big_endian };

/// The type of a number in a PLY file.
enum class PlyType { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

/// A property of an element: a scalar or a list in each of its records.
struct PlyProperty {
  std::string name;
  PlyType type = PlyType::float32;     ///< type of the scalar, or of each value of the list
  std::optional<PlyType> length_type;  ///< type of the length of a list; nothing for a scalar
};

/// An element: a kind of record, such as "vertex" or "face".
struct PlyElement {
  std::string name;
  std::uint64_t count = 0;              ///< number of records
  std::vector<PlyProperty> properties;  ///< in the order of a record
  std::size_t fixed_bytes = 0;          ///< size of a binary record; 0 when it has a list

  /// Returns the index of the property of this name, if there is one.
  [[nodiscard]] std::optional<std::size_t> find(std::string_view property) const;
  /// Returns the index of the property for the first of these names that the element has.
  [[nodiscard]] std::optional<std::size_t> find_any(
      std::initializer_list<std::string_view> names) const;
  /// Says whether a property is a list.
  [[nodiscard]] bool has_list() const;
};

/// One record of an element. Every type of PLY is exact in double.
struct PlyRecord {
  std::vector<double> scalars;             ///< by index of the property; 0 for lists
  std::vector<std::vector<double>> lists;  ///< by index of the property; empty for scalars
  std::uint64_t place = 0;                 ///< offset (binary) or line (ascii) of the record
};

/// Reads a PLY file from front to back: the header on construction, then the records of all
/// elements in the order of elements().
class PlyReader {
 public:
  /// Opens a file and reads its header.
  /// @throws DataError when the header breaks a rule or counts more records than the file can hold;
  ///         std::system_error
  explicit PlyReader(const std::filesystem::path& path);

  /// Returns the elements in the order of the file.
  [[nodiscard]] const std::vector<PlyElement>& elements() const noexcept { return elements_; }
  /// Returns the element of this name, or null.
  [[nodiscard]] const PlyElement* find(std::string_view element) const;

  /// Returns the encoding of the records.
  [[nodiscard]] PlyEncoding encoding() const noexcept { return encoding_; }

  /// Reads the next record of the file, which must belong to `element`.
  /// @throws DataError when the file ends or a line (ascii) does not have the values that it should
  void read(const PlyElement& element, PlyRecord& record);
  /// Returns the bytes of the next binary record, as the file has them, and sets record.place only.
  /// The bytes are valid until the next call.
  /// @param element  that of the record; it has no list
  [[nodiscard]] const std::byte* read_bytes(const PlyElement& element, PlyRecord& record) {
    record.place = stream_.offset();
    return stream_.take(element.fixed_bytes).data();
  }
  /// Skips all records of an element, none of which was read yet.
  void skip(const PlyElement& element);
  /// Checks that nothing follows the records: no byte (binary) or no word (ascii).
  /// @throws DataError when something does
  void require_end();
  /// Refuses the file because of a record.
  /// @throws DataError "PATH: offset N: RULE" (binary) or "PATH: line N: RULE" (ascii)
  [[noreturn]] void fail(const PlyRecord& record, const std::string& rule) const;

 private:
  void read_header();
  bool read_header_line(std::string_view line);
  void add_element(std::string_view name, std::string_view count);
  void add_property(std::string_view line);
  void check_counts() const;
  void read_ascii(const PlyElement& element, PlyRecord& record);
  void read_fixed(const PlyElement& element, PlyRecord& record);
  void read_lists(const PlyElement& element, PlyRecord& record);
  double load(const std::byte* from, PlyType type) const noexcept;
  std::size_t list_length(const PlyRecord& record, double value) const;

  ByteStream stream_;
  PlyEncoding encoding_ = PlyEncoding::ascii;
  std::vector<PlyElement> elements_;
};

}  // namespace ptc
