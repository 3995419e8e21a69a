#include "tools/bench/report/sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace ptc::bench {
namespace {

constexpr unsigned kGap = 4;    // pixels between pictures that belong together
constexpr unsigned kSpace = 6;  // pixels between others, before they are zoomed

Image blank_sheet(unsigned width, unsigned height, float grey) {
  Image sheet{width, height, {}};
  sheet.pixels.assign(std::size_t{width} * height, glm::vec3(grey));
  return sheet;
}

}  // namespace

Image flip_map(const std::vector<float>& errors, unsigned width, unsigned height) {
  Image image{width, height, {}};
  for (const float error : errors) {
    const float t = 3 * std::min(error / kFlipWhite, 1.0F);
    glm::vec3 colour(0);
    for (int c = 0; c < 3; ++c)
      colour[c] = std::pow(std::clamp(t - static_cast<float>(c), 0.0F, 1.0F), 2.2F);
    image.pixels.push_back(colour);
  }
  return image;
}

Image side_by_side(const std::vector<Image>& images) {
  const unsigned width = images.front().width, height = images.front().height;
  const auto count = static_cast<unsigned>(images.size());
  Image sheet = blank_sheet(count * width + (count - 1) * kGap, height, 1);
  for (unsigned i = 0; i < count; ++i) {
    for (unsigned y = 0; y < height; ++y) {
      const auto row = images[i].pixels.begin() + std::ptrdiff_t{y} * width;
      std::copy(row, row + width,
                sheet.pixels.begin() + std::ptrdiff_t{y} * sheet.width + i * (width + kGap));
    }
  }
  return sheet;
}

Image in_columns(const std::vector<Image>& images, unsigned columns, unsigned zoom) {
  // Find the places: a column is full when it has its share of the height
  unsigned total = 0;
  for (const Image& image : images) total += image.height + kSpace;
  const unsigned share = (total + columns - 1) / columns;
  std::vector<std::array<unsigned, 2>> places;
  unsigned x = 0, y = 0, width = 1, height = 1;
  for (const Image& image : images) {
    if (y >= share) {
      x = width + kSpace;
      y = 0;
    }
    places.push_back({x, y});
    y += image.height + kSpace;
    width = std::max(width, x + image.width);
    height = std::max(height, y - kSpace);
  }
  // Copy the pictures
  Image sheet = blank_sheet(width * zoom, height * zoom, 0.2F);
  for (std::size_t k = 0; k < images.size(); ++k) {
    const Image& image = images[k];
    for (unsigned v = 0; v < image.height * zoom; ++v) {
      for (unsigned u = 0; u < image.width * zoom; ++u) {
        const std::size_t at =
            std::size_t{places[k][1] * zoom + v} * sheet.width + places[k][0] * zoom + u;
        sheet.pixels[at] = image.pixels[std::size_t{v / zoom} * image.width + u / zoom];
      }
    }
  }
  return sheet;
}

}  // namespace ptc::bench
