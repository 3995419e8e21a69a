// Pilots: receivers of a run that stand for all of them when settings are chosen.
//
//   receivers of the run   |---------------|---------------|---------------|---   stride
//   pilots                      |=====|         |=====|         |=====|           64 to 128 of them
//   compared with rays           ' ' '           ' ' '           ' ' '            8 in each
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <set>
#include <span>
#include <vector>

#include "engine/shade/shading.h"

namespace ptc {

/// A group of neighbours among the receivers of a run. All are shaded together, as in the run
/// itself; some are compared with rays.
struct Pilot {
  static constexpr std::size_t kCompared = 8;  ///< maximum of receivers that are compared

  std::vector<Receiver> receivers;
  unsigned variant = 0;  ///< variant that shades them, as for Shader::shade()

  /// Returns the number of receivers that are compared with rays: kCompared, or all when there are
  /// fewer.
  [[nodiscard]] std::size_t compared() const noexcept {
    return std::min(kCompared, receivers.size());
  }
  /// Returns the index of the k-th compared receiver. They are evenly spread.
  [[nodiscard]] std::size_t compared_at(std::size_t k) const noexcept {
    return (2 * k + 1) * receivers.size() / (2 * compared());
  }
};

/// The number and the length of the pilots of a run.
struct PilotPlan {
  std::size_t count = 0;      ///< number of pilots; 0 only for a run without receivers
  std::uint64_t stride = 0;   ///< receivers from the first of one pilot to the first of the next
  std::size_t receivers = 0;  ///< length of each pilot, at most `stride`
};

/// Chooses the number and the length of the pilots for a run.
/// @param receivers  number of receivers of the run
[[nodiscard]] PilotPlan plan_pilots(std::uint64_t receivers);

/// Returns the compared receivers of all pilots, in order.
[[nodiscard]] std::vector<Receiver> compared_of(std::span<const Pilot> pilots);

/// A set of receivers; those at the same position count as one.
class ReceiverPlaces {
 public:
  void add(const Receiver& receiver) { places_.insert(place(receiver)); }
  [[nodiscard]] bool contains(const Receiver& receiver) const {
    return places_.contains(place(receiver));
  }

 private:
  using Place = std::array<double, 3>;
  static Place place(const Receiver& r) { return {r.position.x, r.position.y, r.position.z}; }
  std::set<Place> places_;
};

}  // namespace ptc
