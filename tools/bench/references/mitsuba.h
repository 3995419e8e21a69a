// Pictures by Mitsuba 3, a path tracer that shares no code with this project.
//
//   mesh, lights, camera -> scene.xml + a PLY for each material -> Mitsuba in Python -> two EXR
#pragma once

#include <filesystem>
#include <string>

#include "engine/scene/camera.h"
#include "engine/scene/light/lights.h"

namespace ptc::bench {

/// Writes a scene for Mitsuba 3: materials are diffuse, and emit from their fronts. A sun is
/// directional there, which has no extent, and the film has square pixels without a filter.
/// @param directory  of scene.xml and of its meshes and textures
/// @throws RequestError when the scene has spot lights, a sky picture, vertex colours, emission
///         textures or surfaces that let light through; std::system_error
void write_mitsuba_scene(const std::filesystem::path& directory, const Mesh& mesh,
                         const LightRig& lights, const Camera& camera);

/// The program in Python that renders scene.xml twice, with seeds 0 and 1. Its arguments: the
/// scene, two pictures to write (EXR), the maximum number of reflections of a path, the paths of
/// each pixel of a picture, and a file for {"seconds": wall time of both, "version": "3.x.y"}.
[[nodiscard]] const std::string& mitsuba_program();

}  // namespace ptc::bench
