// The arguments of ptcrender, which a plan of a farm has, too.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <vector>

#include "engine/base/progress.h"
#include "engine/pipeline/render/render_picture.h"
#include "tools/common.h"
#include "tools/inputs.h"
#include "tools/options.h"
#include "tools/scene_options.h"

namespace ptc {

/// The scene, the outputs and the options of pictures.
class RenderArguments {
 public:
  /// Declares all of them. This object must outlive the parsing, and `command` this object.
  void declare(Command& command);

  /// The sequence that was given; empty for one picture.
  [[nodiscard]] std::optional<SequenceRequest> sequence() const { return sequence_.sequence(); }
  /// The pictures that will be written: outputs, and then single layers.
  [[nodiscard]] std::vector<std::filesystem::path> targets() const;
  /// Says whether an exposure was given.
  [[nodiscard]] bool has_exposure() const { return request_.exposure.has_value(); }
  /// Says whether groups of lights are kept apart.
  [[nodiscard]] bool has_light_groups() const { return request_.light_groups; }
  /// The number of scenes that were given.
  [[nodiscard]] std::size_t scenes() const { return scene_.names().size(); }
  /// Returns what is asked of the light.
  [[nodiscard]] const LightingRequest& lighting(Command& command);
  /// Takes the light of all bounces but the last from LightingRequest::bounced.
  void use_bounces(const std::filesystem::path& bounced) { request_.bounced = bounced; }
  /// Returns about how long a picture takes, seconds of one core.
  [[nodiscard]] double expected_seconds() const;

  /// Renders the pictures and reports them.
  /// @param run  the resources
  [[nodiscard]] Outcome render(Command& command, const RunOptions& run, Progress& progress);

 private:
  void declare_scene(Command& command);
  void declare_picture(Command& command);
  void declare_lights(CLI::App& app);

  RenderRequest request_;
  SceneArguments scene_;
  std::vector<std::filesystem::path> outputs_;
  std::vector<PictureTarget> layers_;
  LightArguments lights_;
  CameraArguments camera_;
  SequenceArguments sequence_;
  Preset preset_ = Preset::none;
};

}  // namespace ptc
