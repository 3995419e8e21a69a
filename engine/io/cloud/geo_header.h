// Internal to the reader of Houdini's classic geometry: the header, in binary or as text.
//
//   .bgeo, big-endian                      .geo
//   "BgeoV", i32 5                         PGEOMETRY V5
//   i32 points, primitives                 NPoints 5 NPrims 1
//   i32 groups of points, of primitives    NPointGroups 0 NPrimGroups 0
//   i32 attributes of points, of vertices, NPointAttrib 2 NVertexAttrib 0
//       of primitives, of all              NPrimAttrib 1 NAttrib 0
//   an attribute of points:                PointAttrib
//     u16 + bytes  name                    life 2 float 0 0
//     u16 size, i32 type                   id 1 int 0
//     defaults: i32 or f32 for each number
//     (an index: i32 number of texts,      name 1 index 2 first second
//      each u16 + bytes)
//   a point: f32[4] x y z w, the numbers   0 0.1 0.2 1 (-1.2 10 0)
//   of its attributes
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "engine/io/cloud/point_layout.h"
#include "engine/io/text/byte_stream.h"

namespace ptc {

/// What the header of a classic geometry says of its points.
struct GeoHeader {
  bool text = false;  ///< the file is a .geo
  std::uint64_t points = 0;
  /// All numbers of a point, 4 bytes each: x y z w, then the attributes.
  std::size_t numbers = 4;
  std::vector<bool> is_integer;     ///< by number
  std::vector<RecordField> fields;  ///< of a packed record, which has all numbers
  /// The first number of the surfel that an attribute gave, and what the file calls the attribute.
  std::map<std::string, std::string> parts;
  std::vector<std::string> notes;  ///< what is left out, a sentence each
};

/// The key of the text that keeps the names of attributes for the writer, a JSON object. Its
/// members are channels, and numbers of the surfel such as nx, radius, red and radiance_r.
inline constexpr const char* kGeoNames = "bgeo.names";

/// Reads the header, so that the stream is at the first point.
/// @throws DataError with the offset or the line that breaks a rule
[[nodiscard]] GeoHeader read_geo_header(ByteStream& stream);

}  // namespace ptc
