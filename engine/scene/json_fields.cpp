// Checked access to the members of a JSON object.
#include "engine/scene/json_fields.h"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "engine/base/error.h"

namespace ptc {

JsonFields::JsonFields(const Json& object, std::string where)
    : object_(object), where_(std::move(where)) {
  if (!object_.is_object()) fail("must be an object");
}

void JsonFields::fail(const std::string& what) const {
  throw DataError(where_ + ": " + what);
}

const Json* JsonFields::find(const char* name) {
  known_.insert(name);
  const auto found = object_.find(name);
  return found == object_.end() ? nullptr : &*found;
}

double JsonFields::number(const Json& value, const char* name, const Range& range) const {
  if (!value.is_number()) fail(std::string(name) + " must be a number");
  const double number = value.get<double>();
  // Negated, so that no NaN passes.
  if (!(number >= range.low && number <= range.high)) {
    fail(std::string(name) + " must lie in [" + Json(range.low).dump() + ", " +
         Json(range.high).dump() + "]");
  }
  return number;
}

void JsonFields::read(const char* name, float& value, const Range& range) {
  if (const Json* member = find(name)) value = static_cast<float>(number(*member, name, range));
}

void JsonFields::read(const char* name, unsigned& value, const Range& range) {
  const Json* member = find(name);
  if (member == nullptr) return;
  if (!member->is_number_unsigned()) fail(std::string(name) + " must be a whole number");
  value = static_cast<unsigned>(number(*member, name, range));
}

void JsonFields::read(const char* name, glm::dvec3& value, const Range& range) {
  const Json* member = find(name);
  if (member == nullptr) return;
  if (!member->is_array() || member->size() != 3) {
    fail(std::string(name) + " must be an array of three numbers");
  }
  for (int axis = 0; axis < 3; ++axis) {
    value[axis] = number((*member)[static_cast<std::size_t>(axis)], name, range);
  }
}

void JsonFields::read(const char* name, glm::vec3& value, const Range& range) {
  glm::dvec3 wide(value);
  read(name, wide, range);
  value = glm::vec3(wide);
}

void JsonFields::read(const char* name, std::string& value) {
  const Json* member = find(name);
  if (member == nullptr) return;
  if (!member->is_string()) fail(std::string(name) + " must be a string");
  value = member->get<std::string>();
}

void JsonFields::finish() const {
  for (const auto& [name, value] : object_.items()) {
    if (known_.count(name) == 0) fail("unknown member \"" + name + "\"");
  }
}

Json parse_json(const std::string& text, const std::string& where) {
  constexpr int kMaxDepth = 64;  // of arrays and objects in each other
  const auto check_depth = [&](int depth, Json::parse_event_t, const Json&) {
    if (depth > kMaxDepth) throw DataError(where + ": its JSON is nested more than 64 deep");
    return true;
  };
  try {
    return Json::parse(text, check_depth);
  } catch (const Json::exception& error) {
    throw DataError(where + " is not JSON: " + error.what());
  }
}

std::string dump_json(const Json& json, const std::string& where) {
  try {
    return json.dump();
  } catch (const Json::exception& error) {
    throw std::invalid_argument(where + ": " + error.what());
  }
}

}  // namespace ptc
