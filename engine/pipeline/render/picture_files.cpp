#include "engine/pipeline/render/picture_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/io/image/srgb.h"
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

/// Says whether a target shows light.
bool shows_light(const PictureTarget& target) {
  return !is_exr(target) && is_light(target.layer);
}

bool shows_depth(const PictureTarget& target) {
  return !is_exr(target) && target.layer == "depth";
}

}  // namespace

void DepthRange::add(std::span<const glm::vec3> pixels) noexcept {
  for (const glm::vec3& pixel : pixels) {
    if (pixel.x == kNoDepth) continue;
    nearest_ = std::min(nearest_, pixel.x);
    farthest_ = std::max(farthest_, pixel.x);
  }
}

void DepthRange::show(std::span<glm::vec3> pixels) const noexcept {
  constexpr float kFarthestGrey = 0.1F;
  const float range = std::max(farthest_ - nearest_, std::numeric_limits<float>::min());
  for (glm::vec3& pixel : pixels) {
    const float share = (pixel.x - nearest_) / range;
    const double grey = pixel.x == kNoDepth ? 0 : 1 - (1 - kFarthestGrey) * share;
    pixel = glm::vec3(static_cast<float>(srgb_to_linear(grey)));  // as even steps in the file
  }
}

bool is_light(std::string_view layer) noexcept {
  constexpr std::array<std::string_view, 5> kLight{"beauty", "direct", "indirect", "reflection",
                                                   "irradiance"};
  return std::ranges::find(kLight, layer) != kLight.end();
}

PictureFiles::PictureFiles(std::span<const PictureTarget> targets, const ImageWindow& window,
                           const std::vector<ExrLayerType>& layers, const ExrText& text,
                           std::optional<Display> display, const std::filesystem::path& directory)
    : targets_(targets),
      width_(window.width),
      display_(display),
      waiting_(targets.size()),
      exrs_(targets.size()),
      pngs_(targets.size()) {
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (is_exr(targets[i])) {
      exrs_[i] = std::make_unique<ExrWriter>(targets[i].path, window, layers, text);
      continue;
    }
    pngs_[i] = std::make_unique<PngWriter>(targets[i].path, window.width, window.height);
    if (!shows_depth(targets[i]) && (display_ || !shows_light(targets[i]))) continue;
    waiting_[i] = std::make_unique<Spool<glm::vec3>>();
    waiting_[i]->spill(directory);
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
      std::vector<glm::vec3> pixels = film.shown(targets_[i].layer, row, rows);
      if (waiting_[i]) {
        if (shows_depth(targets_[i])) depths_.add(pixels);
        waiting_[i]->append(pixels);
        continue;
      }
      if (shows_light(targets_[i])) display_->show(pixels);
      pngs_[i]->write(pixels);
    }
    if (!display_ && std::ranges::any_of(targets_, shows_light))
      meter_.add(film.shown(film.has_irradiance() ? "irradiance" : "beauty", row, rows));
  }
}

std::optional<Display> PictureFiles::publish() {
  std::optional<Display> chosen;
  const Display display = meter_.display();
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    if (exrs_[i]) {
      exrs_[i]->publish();
      continue;
    }
    if (waiting_[i] && shows_depth(targets_[i])) {
      write_all(*waiting_[i], *pngs_[i], [&](std::span<glm::vec3> row) { depths_.show(row); });
    } else if (waiting_[i]) {
      write_all(*waiting_[i], *pngs_[i], [&](std::span<glm::vec3> row) { display.show(row); });
      chosen = display;
    }
    pngs_[i]->publish();
  }
  return chosen;
}

void PictureFiles::write_all(Spool<glm::vec3>& waiting, PngWriter& png,
                             const std::function<void(std::span<glm::vec3> row)>& show) const {
  waiting.end();
  SpoolReader<glm::vec3> reader(waiting, 0);
  std::vector<glm::vec3> row(width_);
  for (std::uint64_t at = 0; at < waiting.size(); at += width_) {
    for (unsigned x = 0; x < width_; ++x) row[x] = reader[at + x];
    show(row);
    png.write(row);
  }
}

std::uint64_t PictureFiles::bytes(std::span<const PictureTarget> targets, unsigned width,
                                  std::span<const ExrLayerType> layers) {
  constexpr std::uint64_t kPngBytes = 900 << 10, kPngPixelBytes = 27;
  std::uint64_t bytes = rows_at_once(width) * std::uint64_t{width} * sizeof(glm::vec3);
  for (const PictureTarget& target : targets) {
    bytes += is_exr(target) ? ExrWriter::bytes(width, rows_at_once(width), layers)
                            : kPngBytes + kPngPixelBytes * width;
  }
  return bytes;
}

}  // namespace ptc
