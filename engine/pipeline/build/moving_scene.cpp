#include "engine/pipeline/build/moving_scene.h"

#include <utility>

#include "engine/pipeline/temporary_container.h"

namespace ptc {

MovingScene::Still::Still(const std::filesystem::path& directory)
    : path(temporary_container_path(directory)), name(path) {}

BuildReport MovingScene::build(const BuildRequest& request, const std::filesystem::path& target,
                               Progress& progress) {
  if (is_whole_ || !may_have_parts(request)) return build_container(request, target, progress);
  StageSeconds seconds;
  BuildReport report;
  const auto build_still = [&] {
    auto made = std::make_unique<Still>(directory_);
    BuildRequest of_still = request;
    of_still.profile = Profile::raw;  // points are rounded once, when they are lit
    BuildReport still = build_part(of_still, made->part, made->path, progress);
    seconds = std::move(still.seconds);
    still_ = std::move(made);
  };
  const auto build_moving = [&] {
    BuildRequest of_moving = request;
    of_moving.append = still_->path;
    ScenePart part = still_->part;
    part.motion = Motion::moving;
    report = build_part(of_moving, part, target, progress);
  };
  try {
    if (!still_) build_still();
  } catch (const IsOneWhole&) {
    is_whole_ = true;
    return build_container(request, target, progress);
  }
  try {
    try {
      build_moving();
    } catch (const BasisDiffers&) {
      still_.reset();  // before the next one takes its space
      build_still();
      build_moving();
    }
  } catch (const IsOneWhole&) {
    return build_container(request, target, progress);
  }
  report.seconds.insert(report.seconds.begin(), seconds.begin(), seconds.end());
  return report;
}

}  // namespace ptc
