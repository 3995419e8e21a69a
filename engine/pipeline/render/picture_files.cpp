#include "engine/pipeline/render/picture_files.h"

#include <algorithm>
#include <cmath>

#include "engine/io/text/text.h"

namespace ptc {
namespace {

constexpr std::uint64_t kPixelsAtOnce = std::uint64_t{1} << 16;

/// Returns how many rows are handed on at once.
unsigned rows_at_once(unsigned width) {
  return static_cast<unsigned>(std::max<std::uint64_t>(1, kPixelsAtOnce / width));
}

bool is_exr(const PictureTarget& target) {
  return lower_extension(target.path) == ".exr";
}

}  // namespace

PictureFiles::PictureFiles(std::span<const PictureTarget> targets, unsigned width, unsigned height,
                           const std::vector<ExrLayerType>& layers, float exposure)
    : targets_(targets), exposure_(exposure), exrs_(targets.size()), pngs_(targets.size()) {
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (is_exr(targets[i])) {
      exrs_[i] = std::make_unique<ExrWriter>(targets[i].path, width, height, layers);
    } else {
      pngs_[i] = std::make_unique<PngWriter>(targets[i].path, width, height);
    }
  }
}

void PictureFiles::write(const Film& film) {
  const std::vector<Film::Layer> layers = film.layers();
  std::vector<std::span<const float>> values(layers.size());
  for (unsigned row = 0; row < film.height(); row += rows_at_once(film.width())) {
    const unsigned rows = std::min(film.height() - row, rows_at_once(film.width()));
    for (std::size_t i = 0; i < layers.size(); ++i) {
      const std::size_t each = std::size_t{film.width()} * layers[i].type.components();
      values[i] = layers[i].values.subspan(row * each, rows * each);
    }
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      if (exrs_[i]) {
        exrs_[i]->write(rows, values);
        continue;
      }
      const std::string& layer = targets_[i].layer;
      std::vector<glm::vec3> pixels = film.shown(layer, row, rows);
      const bool is_light = layer != "occlusion" && layer != "albedo";
      const float gain = is_light ? std::exp2(exposure_) : 1;
      for (glm::vec3& pixel : pixels) pixel *= gain;
      pngs_[i]->write(pixels);
    }
  }
}

void PictureFiles::publish() {
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    if (exrs_[i]) {
      exrs_[i]->publish();
    } else {
      pngs_[i]->publish();
    }
  }
}

std::uint64_t PictureFiles::bytes(std::span<const PictureTarget> targets, unsigned width,
                                  std::span<const ExrLayerType> layers) {
  constexpr std::uint64_t kPngBytes = 300 << 10, kPngPixelBytes = 15;
  std::uint64_t bytes = rows_at_once(width) * std::uint64_t{width} * sizeof(glm::vec3);
  for (const PictureTarget& target : targets) {
    bytes += is_exr(target) ? ExrWriter::bytes(width, rows_at_once(width), layers)
                            : kPngBytes + kPngPixelBytes * width;
  }
  return bytes;
}

}  // namespace ptc
