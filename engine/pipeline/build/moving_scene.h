// The containers of a scene that moves, one for each moment.
#pragma once

#include <filesystem>
#include <memory>

#include "engine/base/progress.h"
#include "engine/io/file/file.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/scene_part.h"

namespace ptc {

/// Builds containers of the moments of a scene, and keeps what stands still from one to the next.
/// Each container equals the one that is built for its moment alone.
class MovingScene {
 public:
  /// @param directory  for the container of what stands still, which is deleted with this object
  explicit MovingScene(std::filesystem::path directory) : directory_(std::move(directory)) {}

  /// Builds the container of the request's moment.
  /// @param request  the same at each call, but for its moment
  /// @throws as build_container()
  BuildReport build(const BuildRequest& request, const std::filesystem::path& target,
                    Progress& progress);

 private:
  /// The container of what stands still.
  struct Still {
    explicit Still(const std::filesystem::path& directory);
    std::filesystem::path path;
    TemporaryName name;
    ScenePart part;
  };

  std::filesystem::path directory_;
  std::unique_ptr<Still> still_;
  bool is_whole_ = false;  ///< the scene has no parts
};

}  // namespace ptc
