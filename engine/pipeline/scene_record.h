// What a container's meta page records of the scene, by key, and its typed values.
#pragma once

#include "engine/scene/light/lights.h"
#include "engine/store/reader.h"

namespace ptc {

inline constexpr const char* kLightsKey = "lights";      ///< to_json() of the LightRig
inline constexpr const char* kEmittersKey = "emitters";  ///< "baked": emitters lit the surfels
inline constexpr const char* kCameraKey = "camera";      ///< to_json() of the Camera
inline constexpr const char* kSpacingKey = "spacing";    ///< between surfels on meshes, scene units
inline constexpr const char* kInputsKey = "inputs";      ///< file names, separated by spaces
inline constexpr const char* kRoundingKey = "rounding";  ///< kRounding when points were rounded

/// The lights that a container was built with; none when it records none.
/// @throws DataError when the record is no light rig
[[nodiscard]] LightRig recorded_lights(const ContainerReader& container);

/// True when emissive triangles lit the surfels, so that the radiance of the surfels around an
/// emitter includes the light that it gave them.
[[nodiscard]] bool lit_by_emitters(const ContainerReader& container);

/// Distance between neighbouring surfels in scene units: the recorded one, else the square root of
/// area over points; 0 for a container without points.
[[nodiscard]] double surfel_spacing(const ContainerReader& container);

}  // namespace ptc
