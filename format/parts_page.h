// The payload of parts pages: the files that make up a scene of parts (spec/parts.md).
//
//   | part 0, 384 bytes | part 1 | ... |      in the order of the curve
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "format/checksum.h"
#include "format/container.h"
#include "format/morton.h"

namespace ptc {

/// One file of a scene of parts, as the scene describes it.
struct PartRecord {
  Uuid uuid{};
  std::uint64_t superblock_xxh3 = 0;  ///< checksum of the part's superblock
  std::uint64_t file_bytes = 0;       ///< length of the part's file
  std::uint64_t first_point = 0;      ///< points of the parts before it
  std::uint64_t points = 0;
  std::uint32_t first_node_page = 0;  ///< node pages of the scene's own and of the parts before it
  std::uint32_t node_pages = 0;
  MortonKey first_key, last_key;  ///< of its first and last point
  std::string name;               ///< path from the scene's folder, 1 to 255 bytes of UTF-8
  friend bool operator==(const PartRecord&, const PartRecord&) = default;
};

/// Appends a record as it lies in a parts page.
/// @throws std::invalid_argument when the name has more than 255 bytes
void append_part(const PartRecord& part, std::vector<std::byte>& out);

/// Decodes a record and checks what it alone shows.
/// @param record  kPartBytes
/// @throws FormatError with the offset in the record
[[nodiscard]] PartRecord decode_part(std::span<const std::byte> record);

/// The parts of a scene, collected page by page.
class PartList {
 public:
  /// @param own_node_pages  node pages of the scene's own file
  explicit PartList(std::uint32_t own_node_pages) : node_pages_(own_node_pages) {}

  /// Decodes and checks the records of the next parts page.
  /// @param payload  a multiple of kPartBytes
  /// @throws FormatError with the offset in the payload
  void add_page(std::span<const std::byte> payload);

  /// Returns the parts so far, in the order of the curve.
  [[nodiscard]] const std::vector<PartRecord>& parts() const noexcept { return parts_; }
  /// Returns the number of their points.
  [[nodiscard]] std::uint64_t points() const noexcept { return points_; }
  /// Returns the number of node pages of the scene's own file and of the parts.
  [[nodiscard]] std::uint32_t node_pages() const noexcept { return node_pages_; }

 private:
  void check_sums(const PartRecord& part) const;
  void check_order(const PartRecord& part) const;

  std::vector<PartRecord> parts_;
  std::set<std::string> names_;
  std::uint64_t points_ = 0;
  std::uint32_t node_pages_;
};

}  // namespace ptc
