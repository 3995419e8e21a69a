// Internal to the E57 reader: which fields of a scan make a surfel, and which become channels.
//
//   scan 0   cartesianX Y Z   colorRed Green Blue   intensity (float)     rowIndex
//   scan 1   cartesianX Y Z   colorRed Green Blue   intensity (integer)
//            `-- position --' `- albedo and rgb -'  `- intensity, f64 -'  `- row -'
//
// Scans may have different fields, and a field may have different types. A channel is of a type
// that holds its values in all scans, and has a value that stands for "not known" where a scan
// lacks it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/io/e57/document.h"
#include "format/schema.h"

namespace ptc {

/// The indices of three fields that belong together.
using E57Triple = std::array<std::size_t, 3>;

/// The fields of a scan that make a surfel.
struct E57Roles {
  E57Triple position{};
  bool spherical = false;              ///< the position is range (m), azimuth and elevation (rad)
  std::optional<std::size_t> invalid;  ///< the record has a place only where this is 0
  std::optional<E57Triple> normal;
  std::optional<E57Triple> colour;
  std::optional<std::size_t> no_colour;  ///< the record has no colour where this is not 0
};

/// Finds the fields of a surfel, or returns nothing when the scan has no coordinates. Cartesian
/// coordinates take precedence over spherical ones.
[[nodiscard]] std::optional<E57Roles> find_e57_roles(const E57Scan& scan);

/// Returns the values that stand for black and full colour in each component: the limits that the
/// scan states. Without them, colours begin at 0 and end at 1, 255, 65535 or a greater 2^n - 1, at
/// the first of these that the values of the field do not exceed.
[[nodiscard]] std::array<E57Limits, 3> e57_colour_limits(const E57Scan& scan,
                                                         const E57Triple& colour);

/// How one component of a row is made of the fields of a record.
struct E57Cell {
  std::optional<std::size_t> field;    ///< where the value is; without it, it is `otherwise`
  std::optional<std::size_t> invalid;  ///< where this field is not 0, the value is `otherwise`
  std::uint64_t otherwise = 0;
  bool as_real = false;  ///< the component is E57Field::real() as f64, else the bits of the field
  std::uint8_t bytes = 0;
};

/// The channels of a file.
class E57Channels {
 public:
  /// Makes channels of all fields that are not part of the surfel, of the colours, and, when the
  /// file has several scans, of the scan's index. Scans without records do not count.
  /// @throws DataError when a scan has no coordinates, or the scans have more than kMaxChannels
  ///         different fields
  E57Channels(const E57Document& document, const E57Pages& pages);

  /// The greatest number of channels.
  static constexpr std::size_t kMaxChannels = 256;

  /// Returns the channels in the order of a row.
  [[nodiscard]] const std::vector<Channel>& channels() const noexcept { return channels_; }
  /// Returns the cells of a row of a scan, one for each component.
  [[nodiscard]] std::vector<E57Cell> cells(const E57Document& document, std::size_t scan) const;
  /// Returns sentences about what the channels leave out or assume.
  [[nodiscard]] const std::vector<std::string>& notes() const noexcept { return notes_; }

 private:
  // The types and ranges that a field has in the scans that have it.
  struct Union {
    enum class Kind { none, integer, single, real };
    Kind kind = Kind::none;
    std::int64_t low = 0;  // of integers, before scale and offset
    std::int64_t high = 0;
    double scale = 1;
    double offset = 0;
    std::size_t scans = 0;  // that have the field
    bool flagged = false;   // another field says where it is invalid

    void add(const E57Field& field);
    // Sets type, scale and offset of a channel, and no_value where `unknown` values may occur.
    void describe(Channel& channel, bool unknown) const;
  };
  // A field of one or more scans that becomes a channel.
  struct Named {
    std::string field;
    Union type;
  };

  void gather(const E57Document& document, const E57Pages& pages);
  void gather_scan(const E57Scan& scan, const E57Roles& roles, const E57Pages& pages);
  void add_colours(const E57Document& document);
  void add_fields();

  std::vector<Channel> channels_;
  std::vector<std::string> notes_;
  std::vector<Named> fields_;  // the last fields_.size() of channels_
  Union colours_;              // of all three components
  std::size_t scans_ = 0;      // with records
  bool several_ = false;       // the first channel is the index of the scan
  bool text_ = false;          // a field of text is left out
};

}  // namespace ptc
