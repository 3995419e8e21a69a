// Reads settings from JSON; every error names the member that is wrong.
#pragma once

#include <set>
#include <string>

#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>

namespace ptc {

using Json = nlohmann::json;

/// An interval that a number must lie in.
struct Range {
  double low;   ///< the least value that is allowed
  double high;  ///< the greatest value that is allowed
};

/// Checked access to the members of one JSON object.
///
/// A member that is absent leaves its variable as it is. A member that was never asked for is an
/// error in finish(), so that a misspelt name does not pass unnoticed:
///
///     JsonFields fields(json, "light rig: suns[2]");
///     fields.read("angular_radius", sun.angular_radius, {0, 1.57});
///     fields.finish();
class JsonFields {
 public:
  /// Opens an object.
  /// @param object  must outlive this
  /// @param where   names the object in messages, for example "light rig: suns[2]"
  /// @throws DataError when `object` is not a JSON object
  JsonFields(const Json& object, std::string where);

  /// Reads a number.
  /// @throws DataError when the member is not a number, or out of range
  void read(const char* name, float& value, const Range& range);
  /// Reads a whole number that is not negative.
  /// @throws DataError when the member is not a whole number, or out of range
  void read(const char* name, unsigned& value, const Range& range);
  /// Reads a vector: an array of three numbers, each of which lies in the range.
  /// @throws DataError when the member is not such an array, or a number is out of range
  void read(const char* name, glm::vec3& value, const Range& range);
  /// Reads a vector in double precision: an array of three numbers, each of which lies in the
  /// range.
  /// @throws DataError when the member is not such an array, or a number is out of range
  void read(const char* name, glm::dvec3& value, const Range& range);
  /// Reads a string.
  /// @throws DataError when the member is not a string
  void read(const char* name, std::string& value);
  /// Returns the member as it stands, or null when it is absent.
  [[nodiscard]] const Json* find(const char* name);
  /// Checks that every member of the object was asked for by name.
  /// @throws DataError when a member is unknown
  void finish() const;
  /// Throws a DataError that says `what` and names the object.
  [[noreturn]] void fail(const std::string& what) const;

 private:
  /// Converts a member, or an element of it, to a number in range.
  [[nodiscard]] double number(const Json& value, const char* name, const Range& range) const;

  const Json& object_;
  std::string where_;
  std::set<std::string> known_;  ///< names that were asked for
};

/// Parses JSON text.
/// @param where  names the text in the message
/// @throws DataError when `text` is not JSON, or is nested more than 64 deep
[[nodiscard]] Json parse_json(const std::string& text, const std::string& where);
/// Returns JSON as text on one line.
/// @param where  names the text in the message
/// @throws std::invalid_argument when a string is not UTF-8
[[nodiscard]] std::string dump_json(const Json& json, const std::string& where);

/// Returns a vector as an array of its three numbers.
template <typename Vector>
[[nodiscard]] Json to_json_array(const Vector& v) {
  return Json::array({v.x, v.y, v.z});
}

}  // namespace ptc
