// Scenes of which one group of lights shines: how the light of groups is kept apart.
//
//   scene ---- lights of key  ----> temporary container ---- shaded or rendered ---> light_key
//         ---- lights of fill ----> temporary container ---- shaded or rendered ---> light_fill
//         ---- all other light ---> temporary container ---- shaded or rendered ---> light_rest
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/file/file.h"
#include "engine/pipeline/light/light_container.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// The groups of a scene's lights, with the empty name of the rest at the end where there is one.
/// @param emits  whether points or meshes emit
/// @throws RequestError when no light is in a group, or the request asks for what is not measured
///         for groups: an error, estimates, a check, or a run past damaged pages
[[nodiscard]] std::vector<std::string> groups_of(const LightingRequest& request,
                                                 const LightRig& rig, bool emits);

/// A temporary container of a scene's points that other lights light (light_container()).
class RelitScene {
 public:
  /// @param request   its scene is lit, with its resources, gather, lift and back end
  /// @param emission  whether points that emit do so
  /// @param sampling  shadow rays of each point
  /// @param target    output of the run, as for roomiest_temp_dir()
  /// @throws as light_container()
  RelitScene(const LightingRequest& request, const LightRig& rig, bool emission,
             const LightSampling& sampling, const std::filesystem::path& target,
             StageSeconds& seconds, Progress& progress);

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
  TemporaryName name_;
};

/// Adds what a group's run cost to the report of all. Stages of one name become one.
void add_costs(LightingReport& report, const LightingReport& group);
/// Adds another run, with receivers of its own, to the report of all: its costs, the errors of
/// those that were checked, and what fell short most.
void add_run(LightingReport& report, const LightingReport& run);

}  // namespace ptc
