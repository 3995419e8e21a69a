// Scenes of the hunt as text.
#include <array>
#include <map>
#include <sstream>
#include <string_view>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "tools/bench/hunt/scene.h"

namespace ptc::bench {
namespace {

constexpr std::array<std::string_view, 12> kKinds{"wall",   "sheet", "pair",   "wedge",
                                                  "slit",   "box",   "room",   "ball",
                                                  "hollow", "disc",  "leaves", "rod"};
constexpr std::array<std::string_view, 3> kSkies{"none", "white", "rising"};

/// Returns the place of a word in a list; the list's size where it is not there.
template <std::size_t N>
std::size_t place_of(const std::array<std::string_view, N>& words, std::string_view word) {
  std::size_t i = 0;
  while (i < N && words[i] != word) ++i;
  return i;
}

std::string numbers(const glm::dvec3& v) {
  return fmt::format(" {} {} {}", v.x, v.y, v.z);
}

void read(std::istream& in, double& value) {
  in >> value;
}

void read(std::istream& in, glm::dvec3& value) {
  in >> value.x >> value.y >> value.z;
}

std::string line_of(const Shape& shape) {
  const Shape plain;
  std::string line(kKinds[static_cast<std::size_t>(shape.kind)]);
  const auto add = [&](const char* name, glm::dvec3 Shape::*member) {
    if (shape.*member != plain.*member) line += fmt::format(" {}{}", name, numbers(shape.*member));
  };
  add("at", &Shape::at);
  add("turn", &Shape::turn);
  add("size", &Shape::size);
  if (shape.gap != plain.gap) line += fmt::format(" gap {}", shape.gap);
  if (shape.spacing != plain.spacing) line += fmt::format(" spacing {}", shape.spacing);
  add("light", &Shape::light);
  add("back", &Shape::back);
  return line;
}

/// Reads what follows the name of a shape. @return false where it is no shape
bool read_shape(std::istream& in, Shape& shape) {
  for (std::string name; in >> name;) {
    if (name == "at")
      read(in, shape.at);
    else if (name == "turn")
      read(in, shape.turn);
    else if (name == "size")
      read(in, shape.size);
    else if (name == "gap")
      read(in, shape.gap);
    else if (name == "spacing")
      read(in, shape.spacing);
    else if (name == "light")
      read(in, shape.light);
    else if (name == "back")
      read(in, shape.back);
    else
      return false;
    if (!in) return false;
  }
  return true;
}

/// Reads a line into a scene. @return false where it is none
bool read_line(const std::string& line, HuntScene& scene) {
  std::istringstream in(line);
  std::string word;
  in >> word;
  if (word == "sky") {
    in >> word;
    const std::size_t sky = place_of(kSkies, word);
    scene.sky = static_cast<HuntSky>(sky);
    return sky < kSkies.size();
  }
  if (word == "scale") return static_cast<bool>(in >> scene.scale);
  if (word == "receiver") {
    HuntReceiver receiver;
    read(in, receiver.at);
    if (!(in >> word) || word != "normal") return false;
    read(in, receiver.normal);
    scene.receivers.push_back(receiver);
    return static_cast<bool>(in);
  }
  const std::size_t kind = place_of(kKinds, word);
  if (kind == kKinds.size()) return false;
  Shape shape{.kind = static_cast<ShapeKind>(kind)};
  const bool whole = read_shape(in, shape);
  scene.shapes.push_back(shape);
  return whole;
}

}  // namespace

std::string text_of(const HuntScene& scene) {
  std::string text;
  if (scene.sky != HuntSky::none)
    text += fmt::format("sky {}\n", kSkies[static_cast<std::size_t>(scene.sky)]);
  if (scene.scale != 1) text += fmt::format("scale {}\n", scene.scale);
  for (const Shape& shape : scene.shapes) text += line_of(shape) + '\n';
  for (const HuntReceiver& receiver : scene.receivers)
    text += fmt::format("receiver{} normal{}\n", numbers(receiver.at), numbers(receiver.normal));
  return text;
}

HuntScene scene_of(const std::string& text) {
  HuntScene scene;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty()) continue;
    if (!read_line(line, scene)) throw DataError("'" + line + "' is no line of a scene");
  }
  return scene;
}

std::string kinds_of(const HuntScene& scene) {
  std::map<std::string_view, int> counts;
  for (const Shape& shape : scene.shapes) ++counts[kKinds[static_cast<std::size_t>(shape.kind)]];
  std::string text;
  for (const auto& [kind, count] : counts) {
    text += fmt::format("{}{}", text.empty() ? "" : ", ", kind);
    if (count > 1) text += fmt::format(" x{}", count);
  }
  return text;
}

}  // namespace ptc::bench
