// Reading settings from JSON with an error that names the place.
#pragma once

#include <set>
#include <string>

#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>

namespace ptc {

using Json = nlohmann::json;

/// Bounds of a number, both included.
struct Range {
  double low;
  double high;
};

/// The members of one JSON object. A member that is absent leaves its variable as it is; one that
/// is unknown is an error, so that a misspelt name does not pass.
class JsonFields {
 public:
  /// @param where  what the object is, for messages: "light rig: suns[2]"; both must outlive this
  /// @throws DataError when `object` is no object
  JsonFields(const Json& object, std::string where);

  /// @throws DataError when the member is no number, or out of range
  void read(const char* name, float& value, const Range& range);
  void read(const char* name, unsigned& value, const Range& range);
  /// A vector is an array of three numbers, each in range.
  void read(const char* name, glm::vec3& value, const Range& range);
  void read(const char* name, glm::dvec3& value, const Range& range);
  void read(const char* name, std::string& value);
  /// The member, or null when absent.
  [[nodiscard]] const Json* find(const char* name);
  /// @throws DataError when a member was not asked for
  void finish() const;
  [[noreturn]] void fail(const std::string& what) const;

 private:
  [[nodiscard]] double number(const Json& value, const char* name, const Range& range) const;

  const Json& object_;
  std::string where_;
  std::set<std::string> known_;
};

/// @throws DataError when `text` is not JSON
[[nodiscard]] Json parse_json(const std::string& text, const std::string& where);
/// @throws std::invalid_argument when a string is not UTF-8
[[nodiscard]] std::string dump_json(const Json& json, const std::string& where);

template <typename Vector>
[[nodiscard]] Json to_json_array(const Vector& v) {
  return Json::array({v.x, v.y, v.z});
}

}  // namespace ptc
