// The files of a picture while rows of it are written.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/io/image/image.h"
#include "engine/pipeline/render/film.h"

namespace ptc {

/// A picture file and the layer that it shows.
struct PictureTarget {
  std::filesystem::path path;  ///< an .exr gets all layers, a .png one of them
  /// Layer of a .png, one of kPictureLayers.
  std::string layer = "beauty";
};

/// Writes the files of a picture row by row. Each is published whole or not at all.
class PictureFiles {
 public:
  /// Creates temporary files.
  /// @param targets   must outlive this
  /// @param layers    of each .exr
  /// @param exposure  stops by which a .png of light is brightened; occlusion and albedo stay
  /// @throws std::system_error
  PictureFiles(std::span<const PictureTarget> targets, unsigned width, unsigned height,
               const std::vector<ExrLayerType>& layers, float exposure);

  /// Writes the next rows, from the top of the picture down.
  /// @param film  has the layers
  /// @throws std::system_error
  void write(const Film& film);

  /// Publishes the files one after another. @pre all rows are written
  /// @throws std::system_error
  void publish();

  /// Returns the memory that writing takes for each .exr and each .png.
  [[nodiscard]] static std::uint64_t bytes(std::span<const PictureTarget> targets, unsigned width,
                                           std::span<const ExrLayerType> layers);

 private:
  std::span<const PictureTarget> targets_;
  float exposure_;
  std::vector<std::unique_ptr<ExrWriter>> exrs_;  ///< for each target; null for a .png
  std::vector<std::unique_ptr<PngWriter>> pngs_;  ///< for each target; null for an .exr
};

}  // namespace ptc
