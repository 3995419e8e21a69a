// Options that several programs take, checked while they are parsed.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include <CLI/CLI.hpp>

#include "engine/pipeline.h"
#include "engine/scene/camera.h"
#include "engine/scene/lights.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Numbers separated by commas, all finite. @throws CLI::ValidationError naming `option`
[[nodiscard]] std::vector<double> parse_numbers(const std::string& option, const std::string& text);

/// A whole number, also with k, M or G for powers of 1000: "250k", "1.5M".
/// @throws CLI::ValidationError naming `option`
[[nodiscard]] std::uint64_t parse_count(const std::string& option, const std::string& text);

/// Bytes, also with K, M, G or T for powers of 1024: "256M", "1.5G".
/// @throws CLI::ValidationError naming `option`
[[nodiscard]] std::uint64_t parse_size(const std::string& option, const std::string& text);

namespace detail {
/// Refuses what is no number from `least` to `most`.
[[nodiscard]] CLI::Validator in_range(double least, double most);
[[nodiscard]] CLI::Validator whole_in_range(std::uint64_t least, std::uint64_t most);
}  // namespace detail

/// A finite number from `least` to `most`; its default is shown in the help.
template <class T>
CLI::Option* add_number(CLI::App& app, const std::string& name, T& value, double least, double most,
                        const std::string& description) {
  static_assert(std::is_floating_point_v<T>);
  return app.add_option(name, value, description)
      ->type_name("NUMBER")
      ->check(detail::in_range(least, most))
      ->capture_default_str();
}

/// A whole number from `least` to `most`; its default is shown in the help.
template <class T>
CLI::Option* add_integer(CLI::App& app, const std::string& name, T& value, std::uint64_t least,
                         std::uint64_t most, const std::string& description) {
  static_assert(std::is_integral_v<T>);
  return app.add_option(name, value, description)
      ->type_name("N")
      ->check(detail::whole_in_range(least, most))
      ->capture_default_str();
}

/// An option that takes what parse_size() does.
CLI::Option* add_size(CLI::App& app, const std::string& name, std::uint64_t& bytes,
                      const std::string& description);
/// --points
CLI::Option* add_points(CLI::App& app, std::uint64_t& count);
/// --codec raw|zstd
CLI::Option* add_codec(CLI::App& app, Codec& codec);
/// --page-size, a power of two from 4K to 1M
CLI::Option* add_page_size(CLI::App& app, std::uint8_t& page_shift);
/// --io pread|mmap
CLI::Option* add_access(CLI::App& app, ContainerReader::Access& access);

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
  /// What lights a scene that brings no light of its own: a sun and a bluish sky.
  [[nodiscard]] static LightRig default_rig();

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

/// True when there are meshes among the inputs and none of their materials emits light.
/// @throws DataError, std::system_error
[[nodiscard]] bool meshes_are_dark(const BuildRequest& request);

/// --sun-rays, --sky-rays, --area-rays
void add_light_sampling(CLI::App& app, LightSampling& sampling);

/// --solid-angle, --parallax, --inflation, --resolution, --sides, --lift
void add_gather_options(CLI::App& app, GatherOptions& gather, float& lift);

/// --check and --check-rays
void add_check_options(CLI::App& app, CheckRequest& check);

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
