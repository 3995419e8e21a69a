// Animations of glTF: each channel gives one property of a node a value at a time.
//
// The times of a sampler are read once, from front to back, which checks them and finds the two
// keys around the wanted time. Of the values, those of these two keys are read. In a cubic spline
// each key has three values, of which the marked ones count between keys k and k + 1:
//
//   values   | a0 v0 b0 | ... | ak vk bk | ak+1 vk+1 bk+1 | ...     a: tangent in, b: tangent out
//                                  ^  ^     ^    ^
//
// All values are read once more, to see whether the node moves at all: exporters write keys for
// objects that stand still as well, and who knows that need not read a mesh for each picture.
#include "engine/io/mesh/gltf_animation.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "engine/base/error.h"
#include "engine/io/mesh/gltf_numbers.h"

namespace ptc {
namespace {

// Returns a rotation of unit length; one of length 0 turns nothing.
glm::dquat unit_rotation(std::span<const double> r) {
  return glm::normalize(glm::dquat(r[3], r[0], r[1], r[2]));
}

// Says whether a value is a property, but for what rounding to float makes of it.
bool is_same(std::span<const double> value, std::span<const double> property) {
  constexpr double kRounding = 1e-6;
  if (value.size() == 4) {
    return std::abs(glm::dot(unit_rotation(value), unit_rotation(property))) >
           1 - kRounding * kRounding;
  }
  for (std::size_t i = 0; i < value.size(); ++i) {
    if (std::abs(value[i] - property[i]) > kRounding * (1 + std::abs(property[i]))) return false;
  }
  return true;
}

}  // namespace

glm::dmat4 GltfTransform::matrix() const {
  glm::dmat4 matrix = glm::mat4_cast(unit_rotation(rotation));
  for (int i = 0; i < 3; ++i) matrix[i] *= scale[static_cast<std::size_t>(i)];
  matrix[3] = {translation[0], translation[1], translation[2], 1};
  return matrix;
}

GltfAnimation::GltfAnimation(GltfDocument& document, std::optional<double> seconds,
                             MeshWarnings& warnings)
    : document_(document), warnings_(warnings) {
  if (seconds) time_ = static_cast<float>(*seconds);
  for (std::uint64_t i = 0; i < document_.count("animations"); ++i) {
    attempt([&] { find_channels(i); });
  }
}

void GltfAnimation::attempt(const std::function<void()>& work) {
  try {
    work();
  } catch (const DataError& error) {
    if (time_) throw;
    const std::string text = error.what();
    const std::string prefix = document_.path().string() + ": ";
    warnings_.add(kAnimationLeftOut, text.starts_with(prefix) ? text.substr(prefix.size()) : text);
  }
}

void GltfAnimation::find_channels(std::uint64_t animation) {
  const std::string name = "animation " + std::to_string(animation);
  const Json& json = document_.at("animations", animation);
  const auto channels = json.find("channels");
  if (channels == json.end() || !channels->is_array()) document_.fail(name + " has no channels");
  for (std::size_t i = 0; i < channels->size(); ++i) {
    const Json& channel = (*channels)[i];
    if (!channel.is_object()) document_.fail(name + " has a channel that is not an object");
    add_channel(animation, i, channel);
  }
}

void GltfAnimation::add_channel(std::uint64_t animation, std::uint64_t index, const Json& channel) {
  const std::string name =
      "animation " + std::to_string(animation) + ": channel " + std::to_string(index);
  const Json* const target = GltfDocument::member(channel, "target");
  const auto path = target == nullptr ? Json::const_iterator() : target->find("path");
  if (target == nullptr || path == target->end() || !path->is_string())
    document_.fail(name + " has no target");
  // What extensions animate has no node, or a path of its own
  const auto node = document_.unsigned_at(*target, "node");
  if (!node) return;
  if (*node >= document_.count("nodes")) {
    document_.fail(name + " moves node " + std::to_string(*node) + ", which does not exist");
  }
  if (*path == "weights") morphed_.insert(*node);
  constexpr std::array<const char*, 3> kPaths{"translation", "rotation", "scale"};
  const auto* const known = std::ranges::find(kPaths, path->get<std::string>());
  if (known == kPaths.end()) return;
  const auto sampler = document_.unsigned_at(channel, "sampler");
  if (!sampler) document_.fail(name + " has no sampler");
  const auto property = static_cast<Property>(known - kPaths.begin());
  const bool added = channels_.try_emplace({*node, property}, animation, index, *sampler).second;
  if (!added && time_) {
    warnings_.add(kAnimationLeftOut, name + " has the target of another: " + *known + " of node " +
                                         std::to_string(*node));
  }
}

GltfAnimation::Pose GltfAnimation::pose(std::uint64_t node) {
  // Read the node's own transform
  const Json& json = document_.at("nodes", node);
  Pose pose;
  const auto matrix = document_.numbers_at<16>(json, "matrix");
  if (matrix) {
    for (int i = 0; i < 16; ++i) pose.local[i / 4][i % 4] = (*matrix)[static_cast<std::size_t>(i)];
  }
  GltfTransform own;
  if (const auto t = document_.numbers_at<3>(json, "translation")) own.translation = *t;
  if (const auto r = document_.numbers_at<4>(json, "rotation")) own.rotation = *r;
  if (const auto s = document_.numbers_at<3>(json, "scale")) own.scale = *s;
  if (!matrix) pose.local = own.matrix();
  if (morphed_.contains(node)) warnings_.add(kMorphLeftOut, "node " + std::to_string(node));

  // Animate its parts
  const std::array<std::span<double>, 3> properties{own.translation, own.rotation, own.scale};
  attempt([&] {
    for (std::size_t i = 0; i < properties.size(); ++i) {
      const auto channel = channels_.find({node, static_cast<Property>(i)});
      if (channel == channels_.end()) continue;
      if (matrix) {
        document_.fail("node " + std::to_string(node) + " has a matrix, and animation " +
                       std::to_string(channel->second.animation) + " moves it");
      }
      pose.moves |= apply(channel->second, properties[i]);
    }
    if (!matrix) pose.local = own.matrix();
  });
  return pose;
}

bool GltfAnimation::apply(const Channel& channel, std::span<double> property) {
  // Find the sampler of the channel
  const Json& animation = document_.at("animations", channel.animation);
  const std::string name = "animation " + std::to_string(channel.animation) + ": sampler " +
                           std::to_string(channel.sampler);
  const auto samplers = animation.find("samplers");
  if (samplers == animation.end() || !samplers->is_array() || channel.sampler >= samplers->size() ||
      !(*samplers)[channel.sampler].is_object()) {
    document_.fail(name + " does not exist");
  }
  const Json& sampler = (*samplers)[channel.sampler];
  Interpolation how = Interpolation::linear;
  if (const auto word = sampler.find("interpolation"); word != sampler.end()) {
    if (*word == "STEP") {
      how = Interpolation::step;
    } else if (*word == "CUBICSPLINE") {
      how = Interpolation::cubic;
    } else if (*word != "LINEAR") {
      document_.fail(name + " has an interpolation that is neither LINEAR, STEP nor CUBICSPLINE");
    }
  }

  // Find its times and values
  const auto input = document_.unsigned_at(sampler, "input");
  const auto output = document_.unsigned_at(sampler, "output");
  if (!input || !output) document_.fail(name + " lacks its input or its output");
  const Keys& keys = find_keys(*input);
  const GltfDocument::Elements values = document_.find_elements(*output, property.size());
  const bool is_rotation = property.size() == 4;
  if (values.type != kGltfFloat && !(is_rotation && values.normalised))
    document_.fail(name + " has values that are neither floats nor normalised rotations");
  const std::uint64_t of_key = how == Interpolation::cubic ? 3 : 1;
  if (values.count % of_key != 0 || values.count / of_key != keys.count) {
    document_.fail(name + " has " + std::to_string(keys.count) + " times, but " +
                   std::to_string(values.count) + " values");
  }

  count_reads(values.count);
  const bool moves = differs(values, how, property);
  if (time_) set_value(values, how, keys, property);
  return moves;
}

const GltfAnimation::Keys& GltfAnimation::find_keys(std::uint64_t accessor) {
  const auto known = keys_.find(accessor);
  if (known != keys_.end()) return known->second;
  const std::string name = "accessor " + std::to_string(accessor);
  const GltfDocument::Elements times = document_.find_elements(accessor, 1);
  if (times.type != kGltfFloat) document_.fail(name + " has times that are not floats");
  if (times.count == 0) document_.fail(name + " has no times");
  count_reads(times.count);
  const double wanted = time_.value_or(0);
  Keys keys{.count = times.count};
  std::uint64_t index = 0;
  document_.read(times, [&](std::span<const double> time) {
    const double t = time[0];
    if (!std::isfinite(t)) document_.fail(name + " has a time that is not finite");
    if (index > 0 && t < keys.end) document_.fail(name + " has times that decrease");
    if (t <= wanted) keys.before = index;
    if (index == keys.before + 1 && keys.end <= wanted) {  // the next key is after the time
      keys.length = t - keys.end;
      keys.fraction = (wanted - keys.end) / keys.length;
    }
    keys.end = t;
    ++index;
  });
  end_seconds_ = std::max(end_seconds_, keys.end);
  return keys_.emplace(accessor, keys).first->second;
}

void GltfAnimation::count_reads(std::uint64_t elements) {
  // As for vertices: accessors may share their bytes, so a small file can name very many keys
  const std::uint64_t most = (std::uint64_t{1} << 20) + 64 * document_.bytes_read();
  if (elements > most || elements_read_ > most - elements)
    document_.fail("its animations repeat keys to more than this program accepts");
  elements_read_ += elements;
}

bool GltfAnimation::differs(const GltfDocument::Elements& values, Interpolation how,
                            std::span<const double> property) const {
  constexpr std::array<double, 4> kFlat{};
  bool differs = false;
  std::uint64_t index = 0;
  document_.read(values, [&](std::span<const double> value) {
    for (const double number : value) {
      if (!std::isfinite(number)) document_.fail("an animation has a value that is not finite");
    }
    const bool is_tangent = how == Interpolation::cubic && index++ % 3 != 1;
    differs |= is_tangent ? !std::ranges::equal(value, std::span(kFlat).first(value.size()))
                          : !is_same(value, property);
  });
  return differs;
}

void GltfAnimation::set_value(const GltfDocument::Elements& values, Interpolation how,
                              const Keys& keys, std::span<double> property) const {
  // Read the values of the key before the time and of the next one, if it counts
  const std::uint64_t of_key = how == Interpolation::cubic ? 3 : 1;
  const bool between = keys.fraction > 0 && how != Interpolation::step;
  const GltfDocument::Elements around =
      values.part(keys.before * of_key, between ? 2 * of_key : of_key);
  std::array<std::array<double, 4>, 6> read{};
  std::size_t index = 0;
  document_.read(around, [&](std::span<const double> value) {
    std::ranges::copy(value, read[index++].begin());
  });
  const std::array<double, 4>& here = read[of_key / 2];
  if (!between) {
    std::ranges::copy_n(here.begin(), std::ssize(property), property.begin());
    return;
  }
  const std::array<double, 4>& next = read[of_key + of_key / 2];

  // Interpolate (appendix C.3 to C.5)
  const double t = keys.fraction;
  if (how == Interpolation::cubic) {
    const std::array<double, 4>&out = read[2], &in = read[3];
    const double t2 = t * t, t3 = t2 * t;
    for (std::size_t i = 0; i < property.size(); ++i) {
      property[i] = (2 * t3 - 3 * t2 + 1) * here[i] + keys.length * (t3 - 2 * t2 + t) * out[i] +
                    (3 * t2 - 2 * t3) * next[i] + keys.length * (t3 - t2) * in[i];
    }
  } else if (property.size() == 4) {
    const glm::dquat q = glm::slerp(unit_rotation(here), unit_rotation(next), t);
    std::ranges::copy(std::array{q.x, q.y, q.z, q.w}, property.begin());
  } else {
    for (std::size_t i = 0; i < property.size(); ++i) property[i] = (1 - t) * here[i] + t * next[i];
  }
}

}  // namespace ptc
