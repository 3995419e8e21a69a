// Scenes that the hunt found, made small, with what goes wrong in each.
#pragma once

#include <span>

#include "tools/bench/hunt/judge.h"

namespace ptc::bench {

/// A scene whose error is known.
struct KeptScene {
  const char* name;    ///< a few words
  std::uint64_t seed;  ///< of the scene that it was shrunk from
  HuntError kind;
  double bound;      ///< the most that the error may be
  const char* why;   ///< what goes wrong, a few words
  const char* text;  ///< the scene, as scene_of() reads it
};

/// Returns all kept scenes.
[[nodiscard]] std::span<const KeptScene> kept_scenes();

}  // namespace ptc::bench
