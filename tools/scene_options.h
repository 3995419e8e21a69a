// Options for the lights of a scene and for the camera that looks at it.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>

#include "engine/base/progress.h"
#include "engine/pipeline/render/picture_files.h"
#include "engine/pipeline/render/shots.h"
#include "engine/scene/camera.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// The values of --sun, --point, --spot, --sky and the options that modify them.
class LightArguments {
 public:
  /// Declares the options of suns, point lights, spot lights and the sky, and of their groups. This
  /// object must outlive the parsing, and `app` this object.
  void declare(CLI::App& app);
  /// Declares --sky and --sky-scale alone.
  void declare_sky(CLI::App& app);

  /// True when any light, or a group, was given.
  [[nodiscard]] bool given() const noexcept;
  /// True when --sky was given.
  [[nodiscard]] bool sky_given() const noexcept { return !sky_.empty(); }
  /// The lights that were given. The picture of the sky is read into `store`.
  /// @param up  the axis that points up
  /// @throws as TextureStore::read()
  [[nodiscard]] LightRig rig(const glm::vec3& up, TextureStore& store) const;
  /// The sky that was given, black without one. Reads its picture as rig() does.
  [[nodiscard]] Sky sky(TextureStore& store) const;

 private:
  void set_suns(const std::vector<std::string>& values);
  void set_points(const std::vector<std::string>& values);
  void set_spots(const std::vector<std::string>& values);
  void set_groups(const std::vector<std::string>& values);
  /// Gives each light the last group that was named before it.
  void assign_groups(LightRig& rig) const;

  const CLI::App* app_ = nullptr;
  struct SunPlace {
    double azimuth, elevation;  ///< degrees
    float irradiance;           ///< W/m^2
  };
  std::vector<SunPlace> suns_;
  std::vector<PointLight> points_;
  std::vector<SpotLight> spots_;
  std::vector<std::string> groups_;  ///< one for each --light-group
  glm::vec3 sun_colour_{1};
  double sun_degrees_ = 0.533;
  std::string sky_;
  std::optional<glm::vec3> sky_radiance_;  ///< empty: `sky_` is a picture
  float sky_scale_ = 1;
};

/// Returns the direction that points up in the first of these files that says so, a container or a
/// cloud; +y when none does.
/// @param axis  x, y or z, which wins; may be empty
/// @throws DataError, FormatError, std::system_error when a file cannot be read
[[nodiscard]] glm::vec3 up_of_files(const std::vector<std::filesystem::path>& files,
                                    const std::string& axis = {});

/// Notes that the y axis is taken as up because no file of a scene says which one is, naming the
/// first cloud among them. Containers and meshes need no note: y is up unless they say otherwise.
/// @param axis  as for up_of_files(); there is no note where it is given
/// @throws as up_of_files()
void note_unknown_up(const std::vector<std::filesystem::path>& files, const std::string& axis,
                     Progress& progress);

/// Declares --sun-rays and --area-rays.
void add_shadow_rays(CLI::App& app, LightSampling& sampling);
/// Declares --sun-rays, --area-rays and --sky-rays.
void add_light_sampling(CLI::App& app, LightSampling& sampling);

/// Declares --layer, which takes the name of a layer and of a file.
/// @param names    of the layers; must outlive the parsing
/// @param endings  that the name of the file may have
CLI::Option* add_layers(CLI::App& app, std::vector<PictureTarget>& layers,
                        std::span<const std::string_view> names,
                        const std::vector<std::string>& endings = {".png"});
/// Declares --exposure. @param exposure  stays empty unless it is given
CLI::Option* add_exposure(CLI::App& app, std::optional<float>& exposure);
/// Declares --one-sided.
CLI::Option* add_one_sided(CLI::App& app, bool& one_sided);
/// Declares --samples, of a pixel or texel.
CLI::Option* add_samples(CLI::App& app, unsigned& samples);
/// Declares --size. @param size  width and height, pixels; stays empty unless it is given
/// @param square  a single number is taken for both
/// @param usual   the default that help shows
CLI::Option* add_size(CLI::App& app, std::optional<std::array<unsigned, 2>>& size, bool square,
                      const std::string& purpose, const std::string& usual);

/// The values of --camera, --fov and --size.
class CameraArguments {
 public:
  using Size = std::array<unsigned, 2>;  ///< width and height, pixels

  /// Declares the options. This object must outlive the parsing.
  /// @param purpose  description of --camera
  void declare(CLI::App& app, const std::string& purpose);
  /// The camera that was given; empty without --camera.
  [[nodiscard]] std::optional<Camera> camera() const;
  /// The size that was given; empty without --size.
  [[nodiscard]] const std::optional<Size>& size() const noexcept { return size_; }

 private:
  void set_place(const std::string& text);

  Camera camera_;
  bool given_ = false;
  std::optional<Size> size_;
};

/// The values of --frames, --fps and --turntable.
class SequenceArguments {
 public:
  /// Declares the options. This object must outlive the parsing.
  void declare(CLI::App& app);
  /// The sequence that was given; empty for one picture.
  [[nodiscard]] std::optional<SequenceRequest> sequence() const;

 private:
  std::optional<FrameRange> frames_;
  SequenceRequest request_;
};

}  // namespace ptc
