// The files of a picture while rows of it are written.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/io/file/spool.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/render/display.h"
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
  /// @param exposure   stops by which a .png of light is brightened; occlusion and albedo stay.
  ///                   Empty: chosen by the beauty of the whole picture, for all layers alike
  /// @param directory  of the temporary files of pictures whose exposure is chosen
  /// @throws std::system_error
  PictureFiles(std::span<const PictureTarget> targets, unsigned width, unsigned height,
               const std::vector<ExrLayerType>& layers, std::optional<float> exposure,
               const std::filesystem::path& directory);

  /// Writes the next rows, from the top of the picture down.
  /// @param film  has the layers
  /// @throws std::system_error
  void write(const Film& film);

  /// Publishes the files one after another. @pre all rows are written
  /// @return the exposure that was chosen, stops; nothing where none was needed
  /// @throws std::system_error
  std::optional<float> publish();

  /// Returns the memory that writing takes for each .exr and each .png.
  [[nodiscard]] static std::uint64_t bytes(std::span<const PictureTarget> targets, unsigned width,
                                           std::span<const ExrLayerType> layers);

 private:
  /// Shows the light of a whole picture.
  void show(Spool<glm::vec3>& light, const Display& display, PngWriter& png) const;

  std::span<const PictureTarget> targets_;
  unsigned width_;
  std::optional<float> exposure_;
  ExposureMeter meter_;  ///< of the beauty, if the exposure is chosen
  /// For each target, its light until the exposure is known; null where that is not awaited.
  std::vector<std::unique_ptr<Spool<glm::vec3>>> waiting_;
  std::vector<std::unique_ptr<ExrWriter>> exrs_;  ///< for each target; null for a .png
  std::vector<std::unique_ptr<PngWriter>> pngs_;  ///< for each target; null for an .exr
};

}  // namespace ptc
