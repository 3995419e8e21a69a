// The geometry of a latitude-longitude map, and directions drawn by its brightness.
//
// Drawing inverts the cumulated weight of the pixels: first the row, then the pixel in the row,
// then a place around the pixel, as far as its light spreads when the map is interpolated.
//
//     weight of a pixel = brightness x sine of its row's polar angle (its solid angle)
//
//     rows_      |--0--|----1----|-2-|--3--|   the second coordinate of the square times the total
//     blocks_    |-0-|------1------|2|         the first coordinate, among the blocks of that row
//     pixels     |0|-1-|--2--|                 the rest of it, among the pixels of that block,
//                                              whose shares are summed up anew
//     tent          /\                         the rest of each, spread over two pixels' widths
//                  /  \                        as bilinear interpolation spreads the pixel
//              -1   0   1  pixels
//
// So the density at a place is the bilinear blend of the weights around it, over their sum;
// density() computes it for any direction, as the balance heuristic needs (lights.cpp).
#include "engine/scene/light/sky_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "engine/scene/texture.h"

namespace ptc {
namespace {

constexpr unsigned kWidestBlock = Texture::kTileWidth;  // which lies in one tile on the disk
constexpr std::uint64_t kMostBlocks = 1 << 20;          // if they need not be wider

bool has_map(const Sky& sky) {
  return sky.map && sky.map->size() > 0;
}

// Turns a uniform number into an offset from a pixel's centre, in pixels. Its density is the weight
// that bilinear interpolation gives to the pixel: it falls from 1 at the centre to 0 at the
// neighbours' centres.
double tent(double unit) {
  return unit < 0.5 ? std::sqrt(2 * unit) - 1 : 1 - std::sqrt(2 - 2 * unit);
}

// Finds the interval that holds a value; one without width counts as hit in its middle.
template <typename Iterator>
SkyDensity::Found find_share(Iterator first, Iterator last, double value) {
  const auto at = std::min(std::upper_bound(first, last, value), last - 1);
  const double begin = at == first ? 0 : static_cast<double>(*(at - 1));
  const double width = static_cast<double>(*at) - begin;
  return {static_cast<std::size_t>(at - first),
          width > 0 ? std::clamp((value - begin) / width, 0.0, 1.0) : 0.5};
}

}  // namespace

SkyOrientation::SkyOrientation(const glm::vec3& up) : y_(glm::normalize(glm::dvec3(up))) {
  // Apply the smallest rotation that takes +y to u to +x and +z: v -> v + k x v + k x (k x v) /
  // (1 + u.y), with k = y x u; for u = -y take half a turn about x.
  if (y_.y < -1 + 1e-12) {
    x_ = {1, 0, 0};
    z_ = {0, 0, -1};
    return;
  }
  const double a = 1 / (1 + y_.y);
  x_ = {1 - a * y_.x * y_.x, -y_.x, -a * y_.x * y_.z};
  z_ = {-a * y_.x * y_.z, -y_.z, 1 - a * y_.z * y_.z};
}

glm::dvec2 SkyOrientation::place_of(const glm::vec3& direction) const {
  const glm::dvec3 d(direction);
  const double turn = 0.5 - std::atan2(glm::dot(d, x_), glm::dot(d, z_)) / (2 * kPiDouble);
  const double rise = std::acos(std::clamp(glm::dot(d, y_), -1.0, 1.0)) / kPiDouble;
  return {turn < 1 ? turn : 0, rise};
}

glm::vec3 SkyOrientation::direction_at(const glm::dvec2& place) const {
  const double longitude = (0.5 - place.x) * 2 * kPiDouble;
  const double polar = place.y * kPiDouble;
  const double flat = std::sin(polar);
  return glm::vec3(flat * std::sin(longitude) * x_ + std::cos(polar) * y_ +
                   flat * std::cos(longitude) * z_);
}

glm::vec3 Sky::at(const glm::vec3& direction) const {
  if (!has_map(*this)) return radiance;
  const glm::dvec2 place = SkyOrientation(up).place_of(direction);
  return radiance * sample_panorama(*map, place.x * map->width(), place.y * map->height());
}

SkyDensity::SkyDensity(const Sky& sky)
    : orientation_(sky.up),
      map_(sky.map),
      width_(map_->width()),
      height_(map_->height()),
      block_(block_of(*map_)),
      blocks_of_row_((width_ + block_ - 1) / block_) {
  rows_.reserve(height_);
  blocks_.reserve(std::size_t{blocks_of_row_} * height_);
  double total = 0;
  std::vector<double> sums(blocks_of_row_);
  map_->visit_rows([&](std::span<const glm::vec3> row) {
    const double sine = sines_.emplace_back(
        std::sin(kPiDouble * (static_cast<double>(sines_.size()) + 0.5) / height_));
    double sum = 0;
    for (unsigned column = 0; column < width_; ++column) {
      sums[column / block_] = sum += brightness(row[column]) * sine;
    }
    for (const double part : sums) blocks_.push_back(static_cast<float>(sum > 0 ? part / sum : 0));
    rows_.push_back(total += sum);
  });
}

unsigned SkyDensity::block_of(const Texture& map) noexcept {
  unsigned block = 1;
  while (block < kWidestBlock && map.size() / block > kMostBlocks) block *= 2;
  return block;
}

std::uint64_t SkyDensity::bytes(const Sky& sky) noexcept {
  if (!has_map(sky)) return 0;
  const unsigned block = block_of(*sky.map);
  const std::uint64_t blocks = (sky.map->width() + block - 1) / block;
  return sky.map->height() * (blocks * sizeof(float) + 2 * sizeof(double));
}

double SkyDensity::weight(unsigned column, unsigned row) const {
  return brightness(map_->at(column, row)) * sines_[row];
}

// Interpolates the weights as the map is interpolated, and divides by their sum. That is a density
// over the places of the map, whose unit square covers 2 pi times pi radians; the sine of the polar
// angle makes it a density over solid angle.
float SkyDensity::density_at(const glm::dvec2& place) const {
  // Find the four pixels around the place: columns wrap around, rows end.
  const double x = place.x * width_ - 0.5;
  const double y = place.y * height_ - 0.5;
  const double share_x = x - std::floor(x);
  const double share_y = y - std::floor(y);
  const auto column = static_cast<unsigned>(std::floor(x) + width_) % width_;
  const unsigned next = (column + 1) % width_;
  const double most = height_ - 1.0;
  const auto upper = static_cast<unsigned>(std::clamp(std::floor(y), 0.0, most));
  const auto lower = static_cast<unsigned>(std::clamp(std::floor(y) + 1, 0.0, most));
  // Blend their weights.
  const double value =
      (1 - share_y) * ((1 - share_x) * weight(column, upper) + share_x * weight(next, upper)) +
      share_y * ((1 - share_x) * weight(column, lower) + share_x * weight(next, lower));
  const double sine = std::max(std::sin(kPiDouble * place.y), 1e-9);
  return static_cast<float>(value / rows_.back() * width_ * height_ /
                            (2 * kPiDouble * kPiDouble * sine));
}

SkyDensity::Found SkyDensity::find_in_block(unsigned begin, unsigned row, double share) const {
  if (block_ == 1) return {0, share};
  std::array<glm::vec3, kWidestBlock> pixels;
  const std::size_t count = std::min(block_, width_ - begin);
  map_->read(begin, row, std::span(pixels).first(count));
  std::array<double, kWidestBlock> sums{};
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) sums[i] = sum += brightness(pixels[i]);
  return find_share(sums.begin(), sums.begin() + static_cast<std::ptrdiff_t>(count), share * sum);
}

SkyDensity::Sample SkyDensity::sample(const glm::vec2& square) const {
  const Found row =
      find_share(rows_.begin(), rows_.end(), static_cast<double>(square.y) * rows_.back());
  const auto first = blocks_.begin() + static_cast<std::ptrdiff_t>(row.index * blocks_of_row_);
  const Found block = find_share(first, first + blocks_of_row_, static_cast<double>(square.x));
  const auto begin = static_cast<unsigned>(block.index) * block_;
  const Found column = find_in_block(begin, static_cast<unsigned>(row.index), block.within);
  const double x = begin + static_cast<double>(column.index) + 0.5 + tent(column.within);
  const double y = static_cast<double>(row.index) + 0.5 + tent(row.within);
  // Bring the place back onto the map: columns wrap around, and beyond the first and the last row
  // the map goes on as it is there.
  const double turn = x / width_ - std::floor(x / width_);
  const double rise = std::abs(y) / height_;
  const glm::dvec2 place(turn < 1 ? turn : 0, rise > 1 ? 2 - rise : rise);
  return {orientation_.direction_at(place), density_at(place)};
}

float SkyDensity::density(const glm::vec3& direction) const {
  return density_at(orientation_.place_of(direction));
}

std::function<glm::vec3(const glm::vec3&)> sky_function(const Sky& sky) {
  if (sky.radiance == glm::vec3(0)) return {};
  return [sky](const glm::vec3& direction) { return sky.at(direction); };
}

Sky smooth_sky(const Sky& sky, unsigned width) {
  if (!has_map(sky) || (sky.map->width() <= width && sky.map->height() <= width / 2)) return sky;
  const unsigned height = std::min(width / 2, sky.map->height());
  width = std::min(width, sky.map->width());
  const double columns = static_cast<double>(width) / sky.map->width();
  const double rows = static_cast<double>(height) / sky.map->height();
  std::vector<glm::dvec3> sums(std::size_t{width} * height), line(width);
  unsigned from = 0;  // row of the map
  sky.map->visit_rows([&](std::span<const glm::vec3> pixels) {
    // A pixel reaches into one or two new columns, and as many rows
    std::ranges::fill(line, glm::dvec3(0));
    for (std::size_t x = 0; x < pixels.size(); ++x) {
      const double begin = static_cast<double>(x) * columns, end = begin + columns;
      const auto first = static_cast<unsigned>(begin), next = std::min(first + 1, width - 1);
      const double beyond = std::max(0.0, end - (first + 1.0));
      line[first] += (columns - beyond) * glm::dvec3(pixels[x]);
      line[next] += beyond * glm::dvec3(pixels[x]);
    }
    const double top = from++ * rows, bottom = top + rows;
    for (auto y = static_cast<unsigned>(top); y < height && y < bottom; ++y) {
      // The share of the row's solid angle
      const double share = std::cos(std::max<double>(top, y) * kPiDouble / height) -
                           std::cos(std::min<double>(bottom, y + 1.0) * kPiDouble / height);
      for (unsigned x = 0; x < width; ++x) sums[std::size_t{y} * width + x] += share * line[x];
    }
  });
  Image image{.width = width, .height = height};
  image.pixels.reserve(sums.size());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const double y = static_cast<double>(i / width);
    const double whole = std::cos(y * kPiDouble / height) - std::cos((y + 1) * kPiDouble / height);
    image.pixels.emplace_back(sums[i] / whole);
  }
  Sky smooth = sky;
  smooth.map = std::make_shared<const Texture>(std::move(image));
  return smooth;
}

}  // namespace ptc
