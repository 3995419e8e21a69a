// PLY files: the header, and records of any shape. Source: Turk, "The PLY Polygon File Format",
// 1994.
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

enum class PlyEncoding { ascii, little_endian, big_endian };

enum class PlyType { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::float32;
  std::optional<PlyType> length_type;  ///< of a list
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
  std::size_t fixed_bytes = 0;  ///< of every binary record; 0 when there is a list

  /// Index of the property of this name.
  [[nodiscard]] std::optional<std::size_t> find(std::string_view property) const;
  /// Index of the first property that has one of these names.
  [[nodiscard]] std::optional<std::size_t> find_any(
      std::initializer_list<std::string_view> names) const;
  [[nodiscard]] bool has_list() const;
};

/// One record; every type of PLY is exact in double.
struct PlyRecord {
  std::vector<double> scalars;             ///< by index of the property; 0 for lists
  std::vector<std::vector<double>> lists;  ///< by index of the property; empty for scalars
  std::uint64_t place = 0;                 ///< offset (binary) or line (ascii)
};

/// Reads a PLY file front to back: the header when it is opened, then the elements in their order.
class PlyReader {
 public:
  /// @throws DataError when the header breaks a rule or counts more than the file can hold;
  ///         std::system_error
  explicit PlyReader(const std::filesystem::path& path);

  [[nodiscard]] const std::vector<PlyElement>& elements() const noexcept { return elements_; }
  [[nodiscard]] const PlyElement* find(std::string_view element) const;

  /// Reads the next record of the file, which belongs to `element`.
  /// @throws DataError when the file ends, or (ascii) a line has not the values that it should
  void read(const PlyElement& element, PlyRecord& record);
  /// Passes over all records of an element.
  void skip(const PlyElement& element);
  /// @throws DataError when there is more than the header says; binary: any byte, ascii: any word
  void require_end();
  /// @throws DataError "PATH: offset N: RULE" or "PATH: line N: RULE" of a record
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
