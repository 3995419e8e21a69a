#include "engine/pipeline/light/built_scene.h"

#include <utility>

#include "engine/pipeline/convert/convert.h"
#include "engine/pipeline/temporary_container.h"

namespace ptc {

std::vector<std::filesystem::path> scene_files(const LightingRequest& request) {
  std::vector<std::filesystem::path> files{request.scene};
  files.insert(files.end(), request.joined.begin(), request.joined.end());
  return files;
}

bool is_container_alone(const LightingRequest& request) {
  return request.joined.empty() && is_container(request.scene);
}

BuiltScene::BuiltScene(const LightingRequest& request, BuildRequest build,
                       const std::filesystem::path& target, Progress& progress, MovingScene* moving)
    : path_(temporary_container_path(roomiest_temp_dir(request.run, target))), name_(path_) {
  build.inputs = scene_files(request);
  build.input_names = request.scene_names;
  build.sampling = request.sampling;
  build.up = request.up;
  build.run = request.run;
  BuildReport report =
      moving ? moving->build(build, path_, progress) : build_container(build, path_, progress);
  seconds_ = std::move(report.seconds);
  las_records_ = std::move(report.las_records);
}

void BuiltScene::add_stages(StageSeconds& seconds) const {
  seconds.insert(seconds.begin(), seconds_.begin(), seconds_.end());
}

}  // namespace ptc
