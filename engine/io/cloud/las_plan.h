// Internal to the LAS writer: what a file will look like, decided before its first point.
//
// Source: ASPRS LAS 1.4 R15. The sections that are named here are those of that document.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/io/cloud/display_colour.h"
#include "engine/io/cloud/las_fields.h"
#include "engine/io/cloud/las_places.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/point_writer.h"

namespace ptc::las {

/// The facts of a LAS header that do not follow from the points.
struct Head {
  glm::dvec3 scale{1};   ///< a coordinate is X scale + offset, X an i32
  glm::dvec3 offset{0};  ///< scene units
  std::string system = "PTCX";
  std::string software = "PTCX";
  std::uint16_t day = 0;  ///< of the year; 0 when it is not known
  std::uint16_t year = 0;
  std::uint16_t encoding = 0;  ///< "Global Encoding"
  std::uint16_t source = 0;    ///< "File Source ID"
  std::array<std::byte, 16> guid{};
  bool own_steps = false;  ///< scale and offset are not those of the text `las.header`
};

/// Returns the head of a file: that of the text `las.header` where there is one and it is of the
/// form that the reader of LAS gives it, with other steps if its own cannot hold the bounds.
[[nodiscard]] Head plan_head(const PointWriteInfo& info);

/// Says whether positions move when they are rounded to the steps of a head, by more than the last
/// bits of a double; true where that was not measured, unless the head is that of a LAS file.
[[nodiscard]] bool moves_positions(const PointWriteInfo& info, const Head& head);

/// The records between the header and the points, and the extended ones behind the points.
struct Records {
  std::vector<std::byte> bytes;
  std::uint32_t count = 0;
  std::vector<std::byte> extended;
  std::uint32_t extended_count = 0;
  bool has_wkt = false;              ///< one of them names the coordinate reference system as WKT
  bool has_geotiff = false;          ///< one of them names it by keys of GeoTIFF
  std::vector<std::string> dropped;  ///< what is left out, a sentence each

  /// Appends a record that is not extended (section "Variable Length Records").
  void add(std::string_view user, std::uint16_t id, std::string_view description,
           std::string_view content);
};

/// Returns the records of the text `las.vlrs`, without those that describe how the points of that
/// file were stored, and one with the text `crs` if none names the reference system as WKT.
[[nodiscard]] Records plan_records(const PointWriteInfo& info);

/// Returns what the LAS file that the points came from calls its extra bytes, by the texts
/// `las.header` and `las.vlrs`.
[[nodiscard]] std::vector<LasName> original_names(const PointWriteInfo& info);

/// What the bytes after the standard ones of a record hold, and where their values come from.
enum class ExtraSource : std::uint8_t { normal, radius, radiance, emission, albedo, channel };

/// One quantity in the extra bytes: one number of a type of LAS for each of its components.
struct Extra {
  ExtraSource source{};
  RowChannel channel;  ///< its type, names, unit and scale; of a surfel's quantity, too
  /// For people, of each component, at most 32 bytes; empty: the unit.
  std::vector<std::string> descriptions{};
};

/// Where all values go in the record of a point.
struct Layout {
  explicit Layout(const PointWriteInfo& info);

  /// Returns the records of the extra bytes (section "Extra Bytes").
  [[nodiscard]] std::string extra_records() const;

  DisplayColour colour;
  std::vector<PlacedChannel> fields;
  std::vector<Extra> extras;
  std::vector<std::string> misfits;  ///< about channels that do not fit a place, a sentence each
  std::uint8_t point_format = 6;
  std::size_t standard_bytes = 30;  ///< of the point format
  std::size_t record_bytes = 0;     ///< with the extra bytes
  std::size_t extra_numbers = 0;    ///< components of all extras
};

/// Returns the type in which the extra bytes hold the numbers of a channel.
[[nodiscard]] ChannelType extra_type(ChannelType type) noexcept;

}  // namespace ptc::las
