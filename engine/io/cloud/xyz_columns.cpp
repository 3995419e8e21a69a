// Says what the columns of XYZ text are.
//
// Text has numbers and, with luck, names. Without names the number of columns decides, together
// with two questions about three neighbouring columns in the first lines: do they look like
// normals (all within [-1, 1], of unit length within 2 %), or like colours (integers up to 255)?
//
//   3  x y z                         7  x y z normal radius, or x y z intensity r g b
//   4  x y z intensity               9  x y z with a normal and r g b in either order
//   6  x y z normal, or x y z r g b  10 x y z normal radius radiance
#include "engine/io/cloud/xyz_columns.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "engine/io/cloud/channel_names.h"

namespace ptc {
namespace {

using Rows = std::vector<std::vector<double>>;

// Says whether three columns hold unit normals; a normal of 0 is unknown.
bool looks_like_normals(const Rows& rows, std::size_t at) {
  bool some = false;
  for (const std::vector<double>& row : rows) {
    const double x = row[at], y = row[at + 1], z = row[at + 2];
    if (x == 0 && y == 0 && z == 0) continue;
    const double length = std::sqrt(x * x + y * y + z * z);
    const double most = std::max({std::abs(x), std::abs(y), std::abs(z)});
    if (!(most <= 1 && std::abs(length - 1) <= 0.02)) return false;
    some = true;
  }
  return some;
}

bool holds_integers(const Rows& rows, std::size_t column, double most) {
  return std::ranges::all_of(rows, [&](const std::vector<double>& row) {
    return row[column] >= 0 && row[column] <= most && row[column] == std::trunc(row[column]);
  });
}

bool looks_like_colours(const Rows& rows, std::size_t at) {
  return holds_integers(rows, at, 255) && holds_integers(rows, at + 1, 255) &&
         holds_integers(rows, at + 2, 255);
}

using Names = std::vector<std::string>;

Names joined(std::initializer_list<Names> parts) {
  Names all;
  for (const Names& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

// Chooses names for the columns of a file that has none.
Names guess_names(const Rows& rows, std::size_t count, bool has_normals, Names& notes) {
  const Names position = {"x", "y", "z"};
  const Names normal = {"nx", "ny", "nz"};
  const Names colour = {"red", "green", "blue"};
  const auto note = [&](const std::string& text) {
    notes.push_back("The file does not name its columns; " + text);
  };
  if (count == 3) return position;
  if (count == 4 && !has_normals) {
    note("the fourth is taken as intensity.");
    return joined({position, {"intensity"}});
  }
  if (count == 6) {
    if (has_normals) return joined({position, normal});
    const bool colours = !looks_like_normals(rows, 3) && looks_like_colours(rows, 3);
    note(colours ? "columns 4 to 6 are taken as 8-bit colours, because they are integers up to 255."
                 : "columns 4 to 6 are taken as normals.");
    return joined({position, colours ? colour : normal});
  }
  if (count == 7) {
    if (has_normals || looks_like_normals(rows, 3) || !looks_like_colours(rows, 4))
      return joined({position, normal, {"radius"}});
    note("column 4 is taken as intensity and columns 5 to 7 as 8-bit colours.");
    return joined({position, {"intensity"}, colour});
  }
  if (count == 9) {
    for (const bool first : {true, false}) {  // the colours precede the normals
      if (!looks_like_colours(rows, first ? 3 : 6) || !looks_like_normals(rows, first ? 6 : 3))
        continue;
      note(first ? "columns 4 to 6 are taken as 8-bit colours and columns 7 to 9 as normals."
                 : "columns 4 to 6 are taken as normals and columns 7 to 9 as 8-bit colours.");
      return joined({position, first ? colour : normal, first ? normal : colour});
    }
  }
  if (count == 10) {
    return joined({position, normal, {"radius", "radiance_r", "radiance_g", "radiance_b"}});
  }
  Names names = position;
  for (std::size_t i = 4; i <= count; ++i) names.push_back("column_" + std::to_string(i));
  note("columns 4 to " + std::to_string(count) + " are kept as numbers without a meaning.");
  return names;
}

// Returns the name by which PointLayout knows a column, or the name as it is.
std::string known_name(const std::string& name) {
  static const std::map<std::string, std::string, std::less<>> kNames = {
      {"x", "x"},      {"y", "y"},     {"z", "z"},         {"r", "red"},      {"g", "green"},
      {"b", "blue"},   {"red", "red"}, {"green", "green"}, {"blue", "blue"},  {"rf", "red"},
      {"gf", "green"}, {"bf", "blue"}, {"a", "alpha"},     {"i", "intensity"}};
  if (const auto part = surfel_name(name)) return std::string(*part);
  const auto found = kNames.find(bare_name(name));
  return found == kNames.end() ? name : found->second;
}

// Chooses how colours are stored, from the first lines: integers of 8 or 16 bits, or shares of 1.
// Anything else is no colour.
void choose_colours(const Rows& rows, bool srgb, XyzColumns& columns) {
  std::array<std::size_t, 3> at{};
  const std::array<const char*, 3> names = {"red", "green", "blue"};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto named = [&](const RecordField& f) { return f.channel.name == names[i]; };
    const auto found = std::ranges::find_if(columns.fields, named);
    if (found == columns.fields.end()) return;
    at[i] = static_cast<std::size_t>(found - columns.fields.begin());
  }
  const auto all = [&](const auto& holds) { return std::ranges::all_of(at, holds); };
  const auto set_type = [&](ChannelType type) {
    for (const std::size_t i : at) columns.fields[i].channel.type = type;
  };
  const auto is_share = [&](std::size_t column) {
    return std::ranges::all_of(
        rows, [&](const std::vector<double>& row) { return row[column] >= 0 && row[column] <= 1; });
  };
  if (srgb && all(is_share)) {
    columns.float_colours = FloatColours::srgb;
  } else if (all([&](std::size_t i) { return holds_integers(rows, i, 255); })) {
    set_type(ChannelType::u8);
  } else if (all([&](std::size_t i) { return holds_integers(rows, i, 65535); })) {
    set_type(ChannelType::u16);
    columns.notes.emplace_back("Colours are taken as 16-bit values, because some exceed 255.");
  } else if (all(is_share)) {
    columns.notes.emplace_back("Colours with fractions are taken as linear values up to 1.");
  } else {
    for (const std::size_t i : at) columns.fields[i].plain = true;
    columns.notes.emplace_back(
        "Colours are kept as numbers only, because they are neither integers nor shares of 1.");
  }
}

}  // namespace

XyzColumns choose_xyz_columns(const XyzSample& sample, bool has_normals) {
  XyzColumns columns;
  // Name the columns. A column that repeats a name of the surfel is only a channel.
  Names names = sample.names;
  const bool srgb =
      std::ranges::any_of(names, [](const std::string& name) { return bare_name(name) == "rf"; });
  if (names.empty()) {
    const std::size_t count = sample.rows.empty() ? 3 : sample.rows.front().size();
    names = guess_names(sample.rows, count, has_normals, columns.notes);
  } else {
    std::ranges::transform(names, names.begin(), known_name);
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    RecordField field;
    field.channel.name = names[i];
    field.channel.type = ChannelType::f64;
    const auto same = [&](const RecordField& f) { return f.channel.name == names[i]; };
    field.plain = std::ranges::any_of(columns.fields, same);
    columns.fields.push_back(std::move(field));
  }

  // Choose the types of colours, and place the fields.
  choose_colours(sample.rows, srgb, columns);
  std::size_t offset = 0;
  for (RecordField& field : columns.fields) {
    field.offset = offset;
    offset += field.channel.component_bytes();
  }
  return columns;
}

}  // namespace ptc
