// Internal to the reader of XYZ text: what the columns of a file are.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/io/cloud/point_layout.h"

namespace ptc {

/// The columns of an XYZ file, one field of a packed record for each.
struct XyzColumns {
  std::vector<RecordField> fields;  ///< their offsets are set
  FloatColours float_colours = FloatColours::linear;
  std::vector<std::string> notes;  ///< what was assumed, a sentence each
};

/// The first lines of an XYZ file.
struct XyzSample {
  std::vector<std::string> names;         ///< of the columns; empty when the file has none
  std::vector<std::vector<double>> rows;  ///< values of the first lines, equally many in each
};

/// Chooses what the columns are: by their names or, without names, by their number and the values
/// of the first lines.
/// @param has_normals  the name of the file says that normals follow the position
[[nodiscard]] XyzColumns choose_xyz_columns(const XyzSample& sample, bool has_normals);

}  // namespace ptc
