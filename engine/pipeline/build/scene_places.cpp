#include "engine/pipeline/build/scene_places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <string_view>

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/trigonometric.hpp>

#include "engine/base/error.h"
#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

constexpr std::uint64_t kCopies = 3;  // of places: those that are read, and what becomes of them
constexpr double kMaxFrame = 1e9;
constexpr Range kScale{-std::numeric_limits<float>::max(), std::numeric_limits<float>::max()};
constexpr Range kPlace{-1e150, 1e150};

/// Returns the place of a translation, a rotation and a scale, applied from the last to the first.
Placement placement_of(const glm::dvec3& translate, const glm::dquat& rotate,
                       const glm::dvec3& scale) {
  const glm::dmat3 turn = glm::mat3_cast(rotate);
  return {turn[0] * scale.x, turn[1] * scale.y, turn[2] * scale.z, translate};
}

/// Returns the place of 12 or 16 numbers, row after row.
Placement placement_of(const std::vector<double>& rows) {
  Placement place;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      place[column][row] = rows[static_cast<std::size_t>(4 * row + column)];
  }
  return place;
}

/// Says whether a matrix has no last row, or 0 0 0 1 there.
bool ends_as_affine(const std::vector<double>& rows) {
  return rows.size() == 12 ||
         std::equal(rows.begin() + 12, rows.end(), std::array{0.0, 0.0, 0.0, 1.0}.begin());
}

/// Returns the numbers of a member.
/// @param counts  how many there may be: one or two choices
std::vector<double> numbers(const JsonFields& fields, const Json& json, const char* name,
                            std::initializer_list<std::size_t> counts) {
  const bool fits = json.is_array() && std::ranges::find(counts, json.size()) != counts.end() &&
                    std::ranges::all_of(json, [](const Json& n) { return n.is_number(); });
  if (!fits) {
    fields.fail(fmt::format(
        "{} must be an array of {}{} numbers", name, *counts.begin(),
        counts.size() == 2 ? fmt::format(" or {}", *(counts.begin() + 1)) : std::string()));
  }
  return json.get<std::vector<double>>();
}

/// The parts of a place, which are applied from the last to the first.
struct PlaceParts {
  glm::dvec3 translate{0};
  glm::dvec3 axis{0, 1, 0};  ///< unit
  double angle = 0;          ///< around it, radians
  glm::dvec3 scale{1};

  [[nodiscard]] Placement place() const {
    return placement_of(translate, glm::angleAxis(angle, axis), scale);
  }
};

/// Reads the members that give the parts of a place; those that are absent stay.
/// @return whether there are any
bool read_parts(JsonFields& fields, PlaceParts& parts) {
  const Json* const rotate = fields.find("rotate");
  const Json* const scale = fields.find("scale");
  const bool any = fields.find("translate") != nullptr || rotate != nullptr || scale != nullptr;
  fields.read("translate", parts.translate, kPlace);
  if (rotate != nullptr) {
    const std::vector<double> n = numbers(fields, *rotate, "rotate", {4});
    const glm::dvec3 axis(n[0], n[1], n[2]);
    const double length = glm::length(axis);
    if (!(length > 0)) fields.fail("the axis of rotate must not be zero");
    parts.axis = axis / length;
    parts.angle = glm::radians(n[3]);
  }
  if (scale != nullptr && scale->is_number()) {
    parts.scale = glm::dvec3(scale->get<double>());
  } else if (scale != nullptr) {
    if (!scale->is_array()) fields.fail("scale must be a number or an array of three numbers");
    fields.read("scale", parts.scale, kScale);
  }
  return any;
}

/// Returns the place between two others.
/// @param share  of the way to the second one
PlaceParts between(const PlaceParts& from, const PlaceParts& to, double share) {
  PlaceParts parts = from;
  parts.translate = glm::mix(from.translate, to.translate, share);
  parts.scale = glm::mix(from.scale, to.scale, share);
  // What is not turned has any axis, and a turn around one is one back around its opposite
  const glm::dvec3 axis = from.angle == 0 ? to.axis : from.axis;
  const double sign = to.axis == -axis ? -1 : 1;
  if (to.angle == 0 || to.axis == sign * axis) {
    parts.axis = axis;
    parts.angle = glm::mix(from.angle, sign * to.angle, share);
  } else {
    const glm::dquat turn =
        glm::slerp(glm::angleAxis(from.angle, from.axis), glm::angleAxis(to.angle, to.axis), share);
    parts.axis = glm::axis(turn);
    parts.angle = glm::angle(turn);
  }
  return parts;
}

}  // namespace

void check_places(std::uint64_t places, std::uint64_t memory_bytes, const std::string& where) {
  if (places <= memory_bytes / (kCopies * sizeof(Placement))) return;
  throw LimitError(fmt::format("{}: {} places or more take {} MiB of memory, more than there is",
                               where, places, (kCopies * sizeof(Placement) * places >> 20) + 1));
}

std::vector<Placement> read_places(const std::filesystem::path& path, std::uint64_t before,
                                   std::uint64_t memory_bytes) {
  std::vector<Placement> places;
  ByteStream stream(path);
  std::string_view line;
  std::vector<double> n;
  while (stream.next_line(line)) {
    n.clear();
    Words words(line.substr(0, line.find('#')));
    for (std::string_view word = words.next(); !word.empty(); word = words.next()) {
      const auto number = parse_number(word);
      if (!number || !std::isfinite(*number) || n.size() == 16)
        stream.fail_at_line("a place has 3, 8, 12 or 16 numbers, and nothing else");
      n.push_back(*number);
    }
    if (n.empty()) continue;
    Placement place(1);
    if (n.size() == 3 || n.size() == 8) place[3] = {n[0], n[1], n[2]};
    if (n.size() == 8) {
      const glm::dquat turn(n[6], n[3], n[4], n[5]);
      if (!(glm::length(turn) > 0)) stream.fail_at_line("the rotation of the place is zero");
      place = placement_of(place[3], glm::normalize(turn), glm::dvec3(n[7]));
    } else if (n.size() == 12 || n.size() == 16) {
      if (!ends_as_affine(n)) stream.fail_at_line("the last row of the matrix is not 0 0 0 1");
      place = placement_of(n);
    } else if (n.size() != 3) {
      stream.fail_at_line("a place has 3, 8, 12 or 16 numbers, and nothing else");
    }
    if (!is_placement(place)) stream.fail_at_line("the place cannot be inverted");
    places.push_back(place);
    if (places.size() % 4096 == 0)
      check_places(before + places.size(), memory_bytes, path.string());
  }
  if (places.empty()) throw DataError(path.string() + ": the file holds no place");
  return places;
}

std::optional<Placement> read_place(JsonFields& fields) {
  const Json* const matrix = fields.find("matrix");
  PlaceParts parts;
  const bool has_parts = read_parts(fields, parts);
  if (matrix == nullptr && !has_parts) return {};
  if (matrix != nullptr && has_parts) fields.fail("matrix excludes translate, rotate and scale");
  Placement place = parts.place();
  if (matrix != nullptr) {
    const std::vector<double> rows = numbers(fields, *matrix, "matrix", {12, 16});
    if (!ends_as_affine(rows)) fields.fail("the last row of matrix must be 0, 0, 0, 1");
    place = placement_of(rows);
  }
  if (!is_placement(place)) fields.fail("the place cannot be inverted");
  return place;
}

double read_frame(JsonFields& key, const std::optional<double>& before) {
  const Json* const frame = key.find("frame");
  if (frame == nullptr || !frame->is_number() || !(std::abs(frame->get<double>()) <= kMaxFrame))
    key.fail("frame must be a number of at most 1,000,000,000");
  const double at = frame->get<double>();
  if (before && !(at > *before)) key.fail("frame must be later than that of the key before");
  return at;
}

Placement read_keys(JsonFields& fields, const Json& keys, const std::string& where,
                    const std::optional<double>& at) {
  if (fields.find("matrix") != nullptr) fields.fail("keys excludes matrix");
  PlaceParts usual;
  read_parts(fields, usual);
  if (!keys.is_array() || keys.empty()) fields.fail("keys must be an array that is not empty");
  PlaceParts before, found;
  double frame_before = 0;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    JsonFields of(keys[i], fmt::format("{}: keys[{}]", where, i));
    const double frame = read_frame(of, i == 0 ? std::nullopt : std::optional(frame_before));
    PlaceParts parts = usual;
    read_parts(of, parts);
    of.finish();
    if (!is_placement(parts.place())) of.fail("the place cannot be inverted");
    if (i == 0) {
      found = parts;
    } else if (at && *at > frame_before) {
      found = between(before, parts, std::min(1.0, (*at - frame_before) / (frame - frame_before)));
    }
    before = parts;
    frame_before = frame;
  }
  const Placement place = found.place();
  if (!is_placement(place)) fields.fail("the place cannot be inverted between two keys");
  return place;
}

}  // namespace ptc
