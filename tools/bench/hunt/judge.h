// The errors of a scene of the hunt beside rays at the same discs, and smaller scenes with the same
// fault.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "tools/bench/hunt/scene.h"

namespace ptc::bench {

/// What is compared.
enum class HuntError : std::uint8_t {
  occlusion,  ///< largest error of one receiver
  light,      ///< of surfaces and sky over pi, largest error of one receiver in any channel
  mean,       ///< light, RMS error of all receivers and channels over its mean
};
inline constexpr std::array kHuntErrors{HuntError::occlusion, HuntError::light, HuntError::mean};

/// Returns what an error is of, a few words.
[[nodiscard]] const char* name_of(HuntError error);

/// What was found in a scene. Errors are shares of white: 1 where white surrounds a receiver.
///
/// Two results by rays a, b are independent, so that their noise cancels in (ours - a) (ours - b),
/// of which errors are roots.
struct Judgement {
  std::array<double, 3> errors{};      ///< by HuntError; that of the mean is 0 below kLeastLight
  double noise = 0;                    ///< RMS error of the rays' light at a receiver
  std::array<std::size_t, 2> worst{};  ///< receivers of the largest errors of occlusion and light
  bool sound = true;                   ///< is_sound() of all results

  [[nodiscard]] double operator[](HuntError error) const noexcept {
    return errors[static_cast<std::size_t>(error)];
  }
};

/// Mean light below which an error over it is not told.
inline constexpr double kLeastLight = 0.005;

/// Says whether a result is what it may be where no radiance is above 1: finite, occlusion from 0
/// to 1, a bent normal of length 1, and light from 0 to white but for what parallax adds and takes.
[[nodiscard]] bool is_sound(const Shading& shading);

/// Shades a scene with the default settings, traces rays, and compares. A scene without surfels or
/// receivers has no errors, and a receiver in the plane of a disc that it lies on is left out,
/// since what it sees of that disc depends on rounding.
/// @param rays  for each receiver, twice; best a power of 4
[[nodiscard]] Judgement judge(const HuntScene& scene, const Lab& lab, unsigned rays);

/// Says whether results of thousands of receivers are the same, to the bit, on one thread and on
/// several. Receivers lie between those of the scene.
[[nodiscard]] bool same_on_any_threads(const HuntScene& scene, const Lab& lab);

/// Makes a scene smaller while a measure of it stays at 80 % of what it was or more: takes away
/// receivers and shapes, and makes parameters simpler.
/// @param budget  the number of measurements, at most
[[nodiscard]] HuntScene shrink(HuntScene scene,
                               const std::function<double(const HuntScene&)>& measure,
                               unsigned budget);

}  // namespace ptc::bench
