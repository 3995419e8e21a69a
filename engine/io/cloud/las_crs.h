// Internal to the LAS reader: the coordinate reference system of a file.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/io/cloud/las_header.h"

namespace ptc {

/// What the records of a file say about its coordinates.
struct LasCrs {
  std::string text;                       ///< WKT, or "EPSG:n"; empty when it is not known
  std::optional<double> metres_per_unit;  ///< of x and y; nothing when it is not known
  std::vector<std::string> notes;         ///< sentences for the user
};

/// Reads the records about the coordinate system: WKT, else GeoTIFF keys.
/// @throws std::system_error
[[nodiscard]] LasCrs read_las_crs(const InputFile& file, const LasHeader& header);

/// What a WKT text says about the coordinates of x and y.
struct WktFacts {
  bool geographic = false;                ///< they are angles
  std::optional<double> metres_per_unit;  ///< nothing when it is not known
};

/// Finds the facts in WKT of OGC 01-009 ("WKT 1") or 18-010 ("WKT 2"). Text that is no WKT has
/// none.
[[nodiscard]] WktFacts find_wkt_facts(std::string_view wkt);

}  // namespace ptc
