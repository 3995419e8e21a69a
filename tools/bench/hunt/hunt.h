// Hunts through many scenes for those whose errors are largest.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "tools/bench/hunt/judge.h"

namespace ptc::bench {

/// Which scenes are looked at, and how closely.
struct HuntOptions {
  std::uint64_t scenes = 10'000;
  std::uint64_t first = 1;       ///< seed of the first scene; the others follow
  unsigned rays = 1024;          ///< for each receiver, twice
  unsigned worst = 10;           ///< scenes to shrink, of each kind of error
  unsigned close_rays = 16384;   ///< rays for scenes that are shrunk
  unsigned budget = 300;         ///< measurements for shrinking a scene, at most
  unsigned threads_every = 100;  ///< scenes from one to the next that is shaded by several threads
};

/// A scene of the hunt that was shrunk.
struct Prey {
  std::uint64_t seed = 0;
  HuntError kind = HuntError::occlusion;
  double error = 0;   ///< of the scene as it was drawn
  HuntScene scene;    ///< as it was shrunk
  double shrunk = 0;  ///< error of the shrunk scene
};

/// What a hunt found.
struct Bag {
  std::vector<Judgement> judgements;  ///< by seed
  std::vector<std::uint64_t> unsound,
      uneven;  ///< seeds: results that cannot be, or depend on threads
  /// The worst scenes of each kind of error, one for each set of shapes that was left.
  std::vector<Prey> worst;
};

/// Judges scenes, and shrinks the worst. @param progress  advances by one for each scene
[[nodiscard]] Bag hunt(const HuntOptions& options, const Lab& lab, Progress& progress);

/// Returns the error of a sorted list that a share of them does not exceed.
/// @pre it is not empty
[[nodiscard]] double quantile(const std::vector<double>& sorted, double share);

}  // namespace ptc::bench
