// Internal to the glTF reader: where animations put the nodes of a file at a time.
//
//   node --> channel --> sampler --> input   (accessor of times, seconds)
//            (property)         `--> output  (accessor of values)
//
// Source: Khronos, "glTF 2.0 Specification", section 3.11 and appendix C.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include <glm/mat4x4.hpp>

#include "engine/io/mesh/gltf_document.h"
#include "engine/io/mesh/mesh_warnings.h"

namespace ptc {

/// A transform in parts, which are applied from the last to the first.
struct GltfTransform {
  std::array<double, 3> translation{0, 0, 0};
  std::array<double, 4> rotation{0, 0, 0, 1};  ///< quaternion x, y, z, w of any length
  std::array<double, 3> scale{1, 1, 1};

  /// Returns the transform as a matrix. A rotation of length 0 turns nothing.
  [[nodiscard]] glm::dmat4 matrix() const;
};

/// The animations of a file, all of which are shown together. Where two move the same property of a
/// node, the first one in the file counts.
///
/// Without a time, nodes stand as the file puts them, and animations that break a rule are told by
/// a warning. With one, they are errors. Either way only those of the nodes that are asked for are
/// read.
///
/// Memory: about 100 bytes for each channel and each accessor of times; keys are read piecewise.
class GltfAnimation {
 public:
  /// Finds the channels of the animations, but reads no key.
  /// @param document  must outlive this
  /// @param seconds   time to show, finite; it is rounded to float, as times of keys are, so that
  ///                  the time of a key is that key; empty: as the file puts its nodes
  /// @param warnings  receives what is left out; must outlive this
  /// @throws DataError when a channel breaks a rule and there is a time
  GltfAnimation(GltfDocument& document, std::optional<double> seconds, MeshWarnings& warnings);

  /// How a node stands in its parent.
  struct Pose {
    glm::dmat4 local{1};
    /// Whether a key gives the node another place, turn or scale than its own.
    bool moves = false;
  };
  /// Returns the pose of a node. Ask for each node once.
  /// @throws DataError when the node or, with a time, one of its channels breaks a rule;
  ///         std::system_error
  [[nodiscard]] Pose pose(std::uint64_t node);
  /// Returns the time of the last key of the nodes that were asked for, seconds; 0 if there is
  /// none.
  [[nodiscard]] double end_seconds() const noexcept { return end_seconds_; }

 private:
  using Json = GltfDocument::Json;
  enum class Property : std::uint8_t { translation, rotation, scale };
  enum class Interpolation : std::uint8_t { step, linear, cubic };
  /// A channel, by its place in the file.
  struct Channel {
    std::uint64_t animation, index, sampler;
  };
  /// Where the time lies among the times of an accessor.
  struct Keys {
    std::uint64_t count = 0;
    std::uint64_t before = 0;  ///< last key that is not after the time; the first if all are
    double fraction = 0;       ///< of the way to the next key; 0 at either end
    double length = 0;         ///< from that key to the next, seconds
    double end = 0;            ///< time of the last key
  };

  void find_channels(std::uint64_t animation);
  void add_channel(std::uint64_t animation, std::uint64_t index, const Json& channel);
  /// Sets a property of a node to its value at the time, if there is one.
  /// @param property  3 numbers, or 4 of a rotation
  /// @return          whether a key has another value than the property
  bool apply(const Channel& channel, std::span<double> property);
  const Keys& find_keys(std::uint64_t accessor);
  [[nodiscard]] bool differs(const GltfDocument::Elements& values, Interpolation how,
                             std::span<const double> property) const;
  void set_value(const GltfDocument::Elements& values, Interpolation how, const Keys& keys,
                 std::span<double> property) const;
  /// Counts elements that are read, and refuses more than the size of the files justifies.
  void count_reads(std::uint64_t elements);
  /// Does some work; without a time, what it throws becomes a warning.
  void attempt(const std::function<void()>& work);

  GltfDocument& document_;
  std::optional<double> time_;  ///< seconds
  MeshWarnings& warnings_;
  std::map<std::pair<std::uint64_t, Property>, Channel> channels_;  ///< by node
  std::set<std::uint64_t> morphed_;     ///< nodes whose morph targets are animated
  std::map<std::uint64_t, Keys> keys_;  ///< by accessor of times
  std::uint64_t elements_read_ = 0;     ///< of all accessors
  double end_seconds_ = 0;
};

}  // namespace ptc
