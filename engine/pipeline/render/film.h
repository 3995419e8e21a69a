// The layers of a picture while it is rendered, and the files they are written to.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/pipeline/quality/estimate.h"
#include "engine/pipeline/render/primary.h"
#include "engine/shade/shading.h"

namespace ptc {

/// The layers that a .png can show; `occlusion` is white where nothing covers.
inline constexpr std::array<std::string_view, 6> kPictureLayers{
    "beauty", "direct", "indirect", "occlusion", "albedo", "reflection"};

/// A picture file and the layer that it shows.
struct PictureTarget {
  std::filesystem::path path;  ///< an .exr gets all layers, a .png one of them
  /// Layer of a .png, one of kPictureLayers.
  std::string layer = "beauty";
};

/// Layers that a picture has only when they are asked for.
struct FilmExtras {
  bool estimates = false;            ///< occlusion_error and irradiance_error
  bool glossy = false;               ///< reflection and reflection_occlusion
  std::vector<std::string> shadows;  ///< names of layers of shadows
};

/// The layers of a picture: weighted means over the samples of every pixel, row 0 at the top.
/// Memory: pixel_bytes() for each pixel.
class Film {
 public:
  /// Makes a black picture.
  /// @param width, height  in pixels
  Film(unsigned width, unsigned height, const FilmExtras& extras);

  [[nodiscard]] unsigned width() const noexcept { return width_; }    ///< pixels
  [[nodiscard]] unsigned height() const noexcept { return height_; }  ///< pixels

  /// Returns the bytes of memory that a pixel takes.
  [[nodiscard]] static std::uint64_t pixel_bytes(const FilmExtras& extras) noexcept;
  /// The bytes of memory that a pixel takes for each group of lights.
  static constexpr std::uint64_t kGroupBytes = sizeof(glm::vec3);

  /// Adds a sample that meets a surface.
  /// @param pixel   y * width + x
  /// @param weight  share of the sample in its pixel; the samples of a pixel add up to 1
  void add(std::size_t pixel, const PrimaryHit& hit, const Shading& shading, float weight);
  /// Adds the estimated error of a sample that meets a surface.
  /// @pre the film has estimates
  void add(std::size_t pixel, const ErrorEstimate& estimate, float weight);
  /// Adds the reflection of a sample that meets a surface.
  /// @pre the film has reflections
  void add(std::size_t pixel, const Reflection& reflection, float weight);
  /// Adds the shadows of a sample that meets a surface, one for each layer of shadows.
  void add(std::size_t pixel, std::span<const float> shadows, float weight);
  /// Adds a sample that meets nothing but the sky.
  /// @param radiance  W / (m^2 sr)
  void add_sky(std::size_t pixel, const glm::vec3& radiance, float weight) {
    beauty_[pixel] += weight * radiance;
  }

  /// Adds a picture of what one group of lights brings. Its beauty becomes a layer, light adds up,
  /// and what all groups have in common is kept.
  /// @param layer  name of the group's layer
  /// @pre same size, no extras
  void add_group(const std::string& layer, const Film& group);

  /// Completes the layers of estimates: mean squares become root mean squares. Nothing can be added
  /// afterwards.
  void finish();

  /// Writes the files one after another, each whole or not at all.
  /// @param exposure  stops by which a .png of light is brightened; occlusion and albedo stay
  /// @throws std::system_error
  void write(std::span<const PictureTarget> targets, float exposure) const;

 private:
  void write_exr(const std::filesystem::path& target) const;
  void write_png(const PictureTarget& target, float exposure) const;

  unsigned width_, height_;
  std::vector<glm::vec3> beauty_, direct_, indirect_, bent_normal_, albedo_;
  std::vector<float> occlusion_, alpha_;
  std::vector<std::pair<std::string, std::vector<glm::vec3>>> groups_;  ///< layers by name
  /// Mean squares until finish(), root mean squares afterwards; empty without estimates.
  std::vector<float> occlusion_error_, irradiance_error_;
  std::vector<glm::vec3> reflection_;                                ///< empty without reflections
  std::vector<std::pair<std::string, std::vector<float>>> shadows_;  ///< layers by name
  std::vector<float> reflection_occlusion_;                          ///< empty without reflections
};

}  // namespace ptc
