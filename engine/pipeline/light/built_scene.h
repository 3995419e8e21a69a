// The scene of a run: a container that exists, or one that is built of meshes and clouds and goes
// when the run ends.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/file/file.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/moving_scene.h"
#include "engine/pipeline/light/lighting.h"

namespace ptc {

/// Returns the files of a request's scene: LightingRequest::scene, then those joined with it.
[[nodiscard]] std::vector<std::filesystem::path> scene_files(const LightingRequest& request);

/// Says whether a request names one container, which is used as it is. Otherwise a BuiltScene is
/// needed.
/// @throws std::system_error when a file cannot be read
[[nodiscard]] bool is_container_alone(const LightingRequest& request);

/// A container that is built of the files of a request's scene, and removed with this object.
class BuiltScene {
 public:
  /// Builds the container.
  /// @param build   how it is built; its inputs, their names, the sampling, the axis that points up
  ///                and the resources are taken from the request
  /// @param target  output of the run; its directory holds the container when the request names no
  ///                directories for temporary files
  /// @param moving  builds it as a moment of a scene that moves; null: build_container() does
  /// @throws as build_container()
  BuiltScene(const LightingRequest& request, BuildRequest build,
             const std::filesystem::path& target, Progress& progress,
             MovingScene* moving = nullptr);

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  /// BuildReport::las_records of the build.
  [[nodiscard]] const std::string& las_records() const noexcept { return las_records_; }
  /// Adds the stages of the build before those of the run.
  void add_stages(StageSeconds& seconds) const;

 private:
  std::filesystem::path path_;
  TemporaryName name_;  // before the build, so that a build that fails leaves nothing
  StageSeconds seconds_;
  std::string las_records_;
};

}  // namespace ptc
