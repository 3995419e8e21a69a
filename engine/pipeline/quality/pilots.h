// Pilots: receivers of a run that stand for all of them when settings are chosen.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <set>
#include <span>
#include <vector>

#include "engine/shade/shading.h"

namespace ptc {

/// Neighbours among the receivers of a run: all are shaded together, some are compared with rays.
struct Pilot {
  static constexpr std::size_t kCompared = 8;  ///< receivers that are compared, at most

  std::vector<Receiver> receivers;
  unsigned variant = 0;  ///< of Shader::shade()

  /// Number of receivers that are compared with rays: kCompared, or all when there are fewer.
  [[nodiscard]] std::size_t compared() const noexcept {
    return std::min(kCompared, receivers.size());
  }
  /// Index of the k-th compared receiver; they are evenly spread.
  [[nodiscard]] std::size_t compared_at(std::size_t k) const noexcept {
    return (2 * k + 1) * receivers.size() / (2 * compared());
  }
};

/// How many pilots stand for a run, and how long they are.
struct PilotPlan {
  std::size_t count = 0;      ///< 0 only for an empty run
  std::uint64_t stride = 0;   ///< receivers from the beginning of one pilot to that of the next
  std::size_t receivers = 0;  ///< in each pilot, at most `stride`
};

/// @param receivers  number of receivers of the run
[[nodiscard]] PilotPlan plan_pilots(std::uint64_t receivers);

/// The compared receivers of all pilots, in order.
[[nodiscard]] std::vector<Receiver> compared_of(std::span<const Pilot> pilots);

/// A set of receivers, told apart by their positions.
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
