// The files of a picture while rows of it are written.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/io/file/spool.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/render/display.h"
#include "engine/pipeline/render/film.h"

namespace ptc {

/// A picture file, or a mesh with the light of its vertices, and the layer that it shows.
struct PictureTarget {
  std::filesystem::path path;  ///< an .exr or .ply gets all layers, a .png or .glb one of them
  /// Layer of a .png or .glb, and of the colours of a .ply: one of kPictureLayers. In a .glb, whose
  /// colours are multiplied by those of materials, the beauty is the irradiance.
  std::string layer = "beauty";
};

/// Says whether a layer is light, whose exposure matters.
[[nodiscard]] bool is_light(std::string_view layer) noexcept;

/// Shows depth: the nearest surface is white, the farthest dark, and nothing is black.
class DepthRange {
 public:
  /// Looks at some of the pixels of a picture, whose depth is in all channels.
  void add(std::span<const glm::vec3> pixels) noexcept;
  /// Turns depth into grey. @pre all pixels were added
  void show(std::span<glm::vec3> pixels) const noexcept;

 private:
  float nearest_ = kNoDepth, farthest_ = 0;
};

/// Writes the files of a picture row by row. Each is published whole or not at all.
class PictureFiles {
 public:
  /// Creates temporary files.
  /// @param targets   must outlive this
  /// @param window    that the files hold; a .png is that large
  /// @param layers    of each .exr
  /// @param text      in the header of each .exr
  /// @param display    how a .png of light is shown; other layers stay as they are. Empty: it is
  ///                   chosen by the beauty of the whole picture, for all layers alike
  /// @param directory  of the temporary files of pictures whose display is chosen
  /// @throws std::system_error
  PictureFiles(std::span<const PictureTarget> targets, const ImageWindow& window,
               const std::vector<ExrLayerType>& layers, const ExrText& text,
               std::optional<Display> display, const std::filesystem::path& directory);

  /// Writes the next rows, from the top of the picture down.
  /// @param film  has the layers
  /// @throws std::system_error
  void write(const Film& film);

  /// Publishes the files one after another. @pre all rows are written
  /// @return the display that was chosen; nothing where none was needed
  /// @throws std::system_error
  std::optional<Display> publish();

  /// Returns the memory that writing takes for each .exr and each .png.
  [[nodiscard]] static std::uint64_t bytes(std::span<const PictureTarget> targets, unsigned width,
                                           std::span<const ExrLayerType> layers);

 private:
  /// Writes a whole picture whose rows are shown when all of them are known.
  void write_all(Spool<glm::vec3>& waiting, PngWriter& png,
                 const std::function<void(std::span<glm::vec3> row)>& show) const;

  std::span<const PictureTarget> targets_;
  unsigned width_;
  std::optional<Display> display_;
  ExposureMeter meter_;  ///< of the beauty, if the display is chosen
  DepthRange depths_;
  /// For each target, its light until the display is known, or its depth until the farthest is
  /// known; null where neither is awaited.
  std::vector<std::unique_ptr<Spool<glm::vec3>>> waiting_;
  std::vector<std::unique_ptr<ExrWriter>> exrs_;  ///< for each target; null for a .png
  std::vector<std::unique_ptr<PngWriter>> pngs_;  ///< for each target; null for an .exr
};

}  // namespace ptc
