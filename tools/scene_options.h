// Options that say what lights a scene and where it is seen from.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "engine/scene/camera.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// --sun, --point, --sky and what belongs to them.
class LightArguments {
 public:
  void declare(CLI::App& app);
  /// --sky and --sky-scale alone.
  void declare_sky(CLI::App& app);

  /// True when any light was named.
  [[nodiscard]] bool given() const noexcept;
  [[nodiscard]] bool sky_given() const noexcept { return !sky_.empty(); }
  /// The lights; reads the sky's map. @throws DataError when the map is no picture
  [[nodiscard]] LightRig rig() const;
  [[nodiscard]] Sky sky() const;

 private:
  void set_suns(const std::vector<std::string>& values);
  void set_points(const std::vector<std::string>& values);

  std::vector<Sun> suns_;
  std::vector<PointLight> points_;
  glm::vec3 sun_colour_{1};
  double sun_degrees_ = 0.533;
  std::string sky_;
  std::optional<glm::vec3> sky_radiance_;  ///< empty: `sky_` is a picture
  float sky_scale_ = 1;
};

/// --sun-rays, --sky-rays, --area-rays
void add_light_sampling(CLI::App& app, LightSampling& sampling);

/// --camera, --fov and --size.
class CameraArguments {
 public:
  using Size = std::array<unsigned, 2>;  ///< width and height, pixels

  /// @param purpose  how --camera is described
  void declare(CLI::App& app, const std::string& purpose);
  /// What the options said; empty without --camera.
  [[nodiscard]] std::optional<Camera> camera() const;
  [[nodiscard]] const std::optional<Size>& size() const noexcept { return size_; }

 private:
  void set_place(const std::string& text);
  void set_size(const std::string& text);

  Camera camera_;
  bool given_ = false;
  std::optional<Size> size_;
};

}  // namespace ptc
