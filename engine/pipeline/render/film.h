// The layers of a picture while it is rendered, and their files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/pipeline/quality/estimate.h"
#include "engine/pipeline/render/primary.h"
#include "engine/shade/shading.h"

namespace ptc {

/// A picture file and what it shows.
struct PictureTarget {
  std::filesystem::path path;  ///< .exr: all layers; .png: one
  std::string layer =
      "beauty";  ///< of a .png: beauty, direct, indirect, occlusion (white: open), albedo
};

/// Weighted means over the samples of every pixel, layer by layer, row 0 at the top.
class Film {
 public:
  Film(unsigned width, unsigned height, bool estimates);

  /// Bytes of memory that a pixel takes.
  [[nodiscard]] static std::uint64_t pixel_bytes(bool estimates) noexcept;

  /// Adds a sample that meets a surface.
  void add(std::size_t pixel, const PrimaryHit& hit, const Shading& shading, float weight);
  /// Adds the estimated error of such a sample.
  void add(std::size_t pixel, const ErrorEstimate& estimate, float weight);
  /// Adds a sample that meets nothing but the sky.
  void add_sky(std::size_t pixel, const glm::vec3& radiance, float weight) {
    beauty_[pixel] += weight * radiance;
  }

  /// Completes the layers of estimates; nothing can be added afterwards.
  void finish();

  /// Writes one file after another, each whole or not at all.
  /// @param exposure  stops, for a .png of light
  /// @throws std::system_error
  void write(std::span<const PictureTarget> targets, float exposure) const;

 private:
  void write_exr(const std::filesystem::path& target) const;
  void write_png(const PictureTarget& target, float exposure) const;

  unsigned width_, height_;
  std::vector<glm::vec3> beauty_, direct_, indirect_, bent_normal_, albedo_;
  std::vector<float> occlusion_, alpha_;
  std::vector<float> occlusion_error_, irradiance_error_;  ///< squared until finish(); may be empty
};

}  // namespace ptc
