// The layers of rows of a picture while these are rendered.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/io/image/image.h"
#include "engine/pipeline/quality/estimate.h"
#include "engine/pipeline/render/primary.h"
#include "engine/pipeline/render/surface_ids.h"
#include "engine/shade/shading.h"

namespace ptc {

/// The layers that a .png can show (spec/guide/render.md#layers).
inline constexpr std::array<std::string_view, 11> kPictureLayers{
    "beauty",     "direct", "indirect", "occlusion", "albedo",     "reflection",
    "irradiance", "depth",  "normal",   "object_id", "material_id"};

/// Depth where no surface is seen, scene units: beyond all surfaces, yet finite, so that filters
/// of pictures stay numbers.
inline constexpr float kNoDepth = 1e10F;

/// Layers that a picture has only when they are asked for.
struct FilmExtras {
  bool estimates = false;            ///< occlusion_error and irradiance_error
  bool glossy = false;               ///< reflection and reflection_occlusion
  bool irradiance = false;           ///< irradiance of lamps, sky and surfaces together
  bool surfaces = false;             ///< depth, position and normal
  bool ids = false;                  ///< object_id and material_id
  std::vector<std::string> shadows;  ///< names of layers of shadows
};

/// Where a sample meets a surface.
struct SurfaceSample {
  float depth = 0;        ///< from the camera along its view, scene units
  glm::vec3 position{0};  ///< scene units
  glm::vec3 normal{0};    ///< unit
};

/// The layers of some rows of a picture: weighted means over the samples of every pixel, but for
/// depth, position, normal and numbers, of which there is no mean.
/// Memory: pixel_bytes() for each pixel.
class Film {
 public:
  /// Makes black rows.
  /// @param width, height  in pixels
  Film(unsigned width, unsigned height, const FilmExtras& extras);

  [[nodiscard]] unsigned width() const noexcept { return width_; }    ///< pixels
  [[nodiscard]] unsigned height() const noexcept { return height_; }  ///< pixels

  /// Returns the bytes of memory that a pixel takes.
  [[nodiscard]] static std::uint64_t pixel_bytes(const FilmExtras& extras) noexcept;
  /// The bytes of memory that a pixel takes for each group of lights.
  static constexpr std::uint64_t kGroupBytes = sizeof(glm::vec3);

  /// Adds a sample that meets a surface.
  /// @param pixel   y * width + x, with y = 0 for the first of the rows
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
  /// Adds the place of a sample that meets a surface. The nearest one of a pixel stays; of several
  /// whose depth differs by a millionth at most, the first.
  /// @pre the film has surfaces
  void add(std::size_t pixel, const SurfaceSample& surface);
  /// Sets the numbers of the object and the material of a pixel.
  /// @pre the film has them
  void set_ids(std::size_t pixel, const SurfaceId& id);
  /// Adds a sample that meets nothing but the sky.
  /// @param radiance  W / (m^2 sr)
  void add_sky(std::size_t pixel, const glm::vec3& radiance, float weight) {
    beauty_[pixel] += weight * radiance;
  }

  /// Adds rows of what one group of lights brings. Their beauty becomes a layer, light adds up, and
  /// what all groups have in common is kept.
  /// @param layer  name of the group's layer
  /// @param first  row of this film where the first row of `group` lies
  /// @pre same width, and the same extras: surfaces and ids at most
  void add_group(const std::string& layer, const Film& group, unsigned first);

  /// Completes the layers of estimates: mean squares become root mean squares. Pixels without a
  /// surface get their depth. Nothing can be added afterwards.
  void finish();

  /// A layer of an .exr and its values.
  struct Layer {
    ExrLayerType type;
    std::span<const float> values;  ///< height x width x components
  };
  /// Returns all layers, in the order of the file.
  [[nodiscard]] std::vector<Layer> layers() const;
  /// Says whether the film has depth, position and normal.
  [[nodiscard]] bool has_surfaces() const noexcept { return !depth_.empty(); }
  /// Says whether the film has a layer of irradiance.
  [[nodiscard]] bool has_irradiance() const noexcept { return !irradiance_.empty(); }
  /// Returns the values of a layer of a .png, one of kPictureLayers, in full. Irradiance is shown
  /// as the radiance of a white surface; depth is returned as it is.
  /// @param row, rows  the rows of this film that are wanted
  [[nodiscard]] std::vector<glm::vec3> shown(std::string_view layer, unsigned row,
                                             unsigned rows) const;

 private:
  unsigned width_, height_;
  std::vector<glm::vec3> beauty_, direct_, indirect_, bent_normal_, albedo_;
  std::vector<float> occlusion_, alpha_;
  std::vector<std::pair<std::string, std::vector<glm::vec3>>> groups_;  ///< layers by name
  /// Mean squares until finish(), root mean squares afterwards; empty without estimates.
  std::vector<float> occlusion_error_, irradiance_error_;
  std::vector<glm::vec3> reflection_;                                ///< empty without reflections
  std::vector<std::pair<std::string, std::vector<float>>> shadows_;  ///< layers by name
  std::vector<float> reflection_occlusion_;                          ///< empty without reflections
  std::vector<glm::vec3> irradiance_;  ///< W / m^2; empty unless it is asked for
  std::vector<float> depth_;           ///< this and the next two: empty without surfaces
  std::vector<glm::vec3> position_, normal_;
  std::vector<float> object_id_, material_id_;  ///< empty without ids
};

}  // namespace ptc
