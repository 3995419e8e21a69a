#include "engine/shade/gather/openings.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "engine/base/low_discrepancy.h"
#include "engine/base/numbers.h"

namespace ptc {
namespace {

// Open share of the hemisphere up to which it is looked at closely, and from which on it is left as
// it is drawn; between them both are mixed
constexpr float kLittleOpen = 0.06F, kMuchOpen = 0.1F;
// Pixels to begin with up to which they are looked at, and from which on they are left as they are
// drawn; and the most that are looked at. All of them over those of the cube
constexpr float kFew = 160.0F / 6144, kMany = 256.0F / 6144, kMost = 768.0F / 6144;
// Squares of 2 x 2 pixels to begin with, over these pixels, up to which they are scattered, like
// chinks between discs and leaves, and from which on they are an opening: 0.44 for 3 x 3 pixels
constexpr float kScattered = 0.2F, kCompact = 0.4F;
// Rays that are wanted in and around what is open, and the most of a pixel
constexpr std::size_t kWantedRays = 128;
constexpr std::uint32_t kMostOfPixel = 4;

/// Returns a weight that falls smoothly from 1 to 0.
float fall(float from, float to, float x) {
  const float t = std::clamp((to - x) / (to - from), 0.0F, 1.0F);
  return t * t * (3 - 2 * t);
}

}  // namespace

// Numbers the pixels of each face along a Z-curve.
void Openings::place_pixels(std::uint32_t side) {
  if (places_.size() == std::size_t{6} * side * side) return;
  places_.clear();
  for (std::uint32_t i = 0; i < 6 * side * side; ++i) {
    const std::uint32_t face = i / (side * side), x = i % side, y = i / side % side;
    std::uint32_t along = face;
    for (std::uint32_t bit = std::bit_ceil(side) / 2; bit > 0; bit /= 2)
      along = along << 2 | ((y & bit) != 0 ? 2U : 0U) | ((x & bit) != 0 ? 1U : 0U);
    places_.push_back({.along = static_cast<std::uint16_t>(along),
                       .face = static_cast<std::uint8_t>(face),
                       .x = static_cast<std::uint8_t>(x),
                       .y = static_cast<std::uint8_t>(y)});
  }
  state_.assign(places_.size(), kUnseen);
}

/// The pixels of a cube, by face, row and column, as a receiver sees them.
class Openings::Hemisphere {
 public:
  /// @param places  of the pixels of the grid
  Hemisphere(const DirectionGrid& grid, const Receiver& receiver, std::span<const Place> places)
      : grid_(grid),
        receiver_(receiver),
        places_(places),
        to_world_(glm::transpose(grid.rotation())),
        normal_(grid.rotation() * receiver.normal),
        side_(grid.resolution()),
        step_(2 / static_cast<float>(side_)),
        seed_(grid.variant()) {
    for (int k = 0; k < 3; ++k)
      seed_ = splitmix64(seed_ ^ std::bit_cast<std::uint64_t>(receiver.position[k]));
  }

  [[nodiscard]] const DirectionGrid& grid() const { return grid_; }
  [[nodiscard]] const Receiver& receiver() const { return receiver_; }
  [[nodiscard]] const glm::mat3& to_world() const { return to_world_; }
  [[nodiscard]] std::uint32_t side() const { return side_; }
  /// Returns the points of a pixel, 0 to 1 along its edges.
  [[nodiscard]] SquarePoints points(std::uint32_t pixel) const {
    return SquarePoints(seed_ + pixel);
  }
  /// Returns (1, u, v) at a place of a pixel, in the axes of the cube. Beside the face it leads to
  /// other pixels.
  /// @param x, y  0 to 1 within the pixel
  [[nodiscard]] glm::vec3 direction(std::uint32_t pixel, float x, float y) const {
    const Place& place = places_[pixel];
    return CubeFace(place.face).direction(coordinate(place.x, x), coordinate(place.y, y));
  }
  /// Returns the height over the horizon of a direction, in its own length.
  [[nodiscard]] float height(const glm::vec3& d) const { return glm::dot(d, normal_); }
  /// Returns the height of the middle of a pixel.
  [[nodiscard]] float height(std::uint32_t pixel) const {
    return height(direction(pixel, 0.5F, 0.5F));
  }
  /// Says whether part of a pixel may lie above the horizon.
  /// @param middle  height of its middle
  [[nodiscard]] bool may_see(float middle) const { return middle > -step_; }
  /// Returns the weight of a pixel that has the density of one of its directions (1, u, v), sr:
  /// its area on the face times the cosine to the normal, over |(1, u, v)|^3.
  [[nodiscard]] float weight(const glm::vec3& d) const {
    const float length2 = glm::dot(d, d);
    return step_ * step_ * height(d) / (length2 * length2);
  }

  /// Calls body(pixel) for the pixels around one, also across the edges of the cube.
  template <class Body>
  void for_each_around(std::uint32_t pixel, const Body& body) const {
    const Place& place = places_[pixel];
    const bool inside = place.x > 0 && place.y > 0 && place.x + 1U < side_ && place.y + 1U < side_;
    for (std::uint32_t k = 0; k < 9; ++k) {
      if (k == 4) continue;
      if (inside) {
        body(pixel + (k / 3) * side_ + k % 3 - side_ - 1);
      } else {
        body(pixel_at(
            direction(pixel, static_cast<float>(k % 3) - 0.5F, static_cast<float>(k / 3) - 0.5F)));
      }
    }
  }
  /// Calls body(pixel) for each pixel that nothing covers and whose middle lies above the horizon.
  template <class Body>
  void for_each_open(std::span<const float> nearness, const Body& body) const {
    for (std::uint32_t face = 0; face < 6; ++face) {
      const CubeFace axes(static_cast<int>(face));
      for (std::uint32_t y = 0; y < side_; ++y) {
        const std::uint32_t first = (face * side_ + y) * side_;
        const float slope = normal_[axes.u], row = height(axes.direction(0, coordinate(y, 0.5F)));
        if (!(row + std::abs(slope) > 0)) continue;
        for (std::uint32_t x = 0; x < side_; ++x) {
          if (nearness[first + x] == 0 && row + slope * coordinate(x, 0.5F) > 0) body(first + x);
        }
      }
    }
  }

 private:
  /// Returns u or v at a place of a column or row.
  [[nodiscard]] float coordinate(std::uint32_t at, float within) const {
    return (static_cast<float>(at) + within) * step_ - 1;
  }
  /// Returns the pixel that a direction of any length leads to.
  [[nodiscard]] std::uint32_t pixel_at(const glm::vec3& d) const {
    const glm::vec3 size = glm::abs(d);
    const int w = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
    const int face = 2 * w + (d[w] < 0 ? 1 : 0);
    const CubeFace axes(face);
    const auto place = [&](int axis) {
      return std::min(side_ - 1, static_cast<std::uint32_t>((d[axis] / size[w] + 1) / step_));
    };
    return (static_cast<std::uint32_t>(face) * side_ + place(axes.v)) * side_ + place(axes.u);
  }

  const DirectionGrid& grid_;
  const Receiver& receiver_;
  std::span<const Place> places_;
  glm::mat3 to_world_;
  glm::vec3 normal_;
  std::uint32_t side_;
  float step_;  ///< edge of a pixel on a face
  std::uint64_t seed_;
};

void Openings::visit(const Hemisphere& above, std::uint32_t pixel) {
  if (state_[pixel] != kUnseen || !above.may_see(above.height(pixel))) return;
  state_[pixel] = kCovered;
  seen_.push_back(pixel);
}

// Visits what is drawn as open, and what was open to the receiver before. Returns how surely that
// is an opening, 0 to 1.
float Openings::begin(const Hemisphere& above, std::span<const float> nearness) {
  above.for_each_open(nearness, [&](std::uint32_t pixel) { visit(above, pixel); });
  for (const std::uint32_t pixel : last_) visit(above, pixel);
  const std::uint32_t side = above.side();
  const auto squares = std::ranges::count_if(seen_, [&](std::uint32_t i) {
    return places_[i].x + 1U < side && places_[i].y + 1U < side && state_[i + 1] != kUnseen &&
           state_[i + side] != kUnseen && state_[i + side + 1] != kUnseen;
  });
  const auto seen = static_cast<float>(seen_.size());
  return 1 - fall(kScattered * seen, kCompact * seen, static_cast<float>(squares));
}

// Sends the rays `first` to `end` of each pixel of the wave, and marks pixels that are open.
void Openings::look(const Hemisphere& above, std::uint32_t first, std::uint32_t end, Sums& sums) {
  // Neighbours share a list of boxes
  for (std::uint32_t& pixel : wave_) pixel |= std::uint32_t{places_[pixel].along} << 16;
  std::ranges::sort(wave_);
  rays_.clear();
  directions_.clear();
  for (std::uint32_t& pixel : wave_) {
    pixel &= 0xFFFF;
    const SquarePoints points = above.points(pixel);
    for (std::uint32_t k = first; k < end; ++k) {
      const glm::vec2 at = points.square(k);
      const glm::vec3 d = above.direction(pixel, at.x, at.y);
      const float weight = above.weight(d) / static_cast<float>(end - first);
      if (!(weight > 0)) continue;
      directions_.push_back(above.to_world() * glm::normalize(d));
      rays_.push_back({pixel, weight});
    }
  }
  covered_.assign(rays_.size(), 0);
  sent_ += rays_.size();
  visibility_->find(above.receiver(), directions_, covered_);
  for (std::size_t i = 0; i < rays_.size(); ++i) {
    if (covered_[i] != 0) continue;
    const auto& [pixel, weight] = rays_[i];
    state_[pixel] = kOpen;
    sums.open += weight;
    sums.sky += weight * above.grid().sky(pixel);
    sums.towards += weight * directions_[i];
  }
}

// Looks along one ray in each pixel that was visited, and goes on around those that are open. Says
// whether it found an end.
bool Openings::grow(const Hemisphere& above, Sums& sums) {
  const auto most = static_cast<std::size_t>(kMost * static_cast<float>(places_.size()));
  for (std::size_t done = 0; done < seen_.size();) {
    wave_.assign(seen_.begin() + static_cast<std::ptrdiff_t>(done), seen_.end());
    done = seen_.size();
    if (done > most) return false;
    look(above, 0, 1, sums);
    for (const std::uint32_t i : wave_) {
      if (state_[i] != kOpen) continue;
      above.for_each_around(i, [&](std::uint32_t pixel) { visit(above, pixel); });
    }
  }
  return true;
}

// Looks again, along more rays in each pixel in and around what is open, where these are few.
void Openings::refine(const Hemisphere& above, Sums& sums) {
  for (const std::uint32_t i : last_) {
    above.for_each_around(i, [&](std::uint32_t pixel) {
      if (state_[pixel] == kCovered) state_[pixel] = kBorder;
    });
  }
  wave_.clear();
  for (const std::uint32_t i : seen_) {
    if (state_[i] != kCovered) wave_.push_back(i);
  }
  if (wave_.empty()) return;
  const auto each =
      static_cast<std::uint32_t>(std::min<std::size_t>(kMostOfPixel, kWantedRays / wave_.size()));
  if (each < 2) return;
  sums = {};
  look(above, 1, 1 + each, sums);
}

void Openings::clear() noexcept {
  for (const std::uint32_t i : seen_) state_[i] = kUnseen;
  seen_.clear();
}

std::size_t Openings::mend(const DirectionGrid& grid, const DirectionBuffer& drawn,
                           const Receiver& receiver, Shading& shading) {
  float share = fall(kLittleOpen, kMuchOpen, 1 - shading.occlusion);
  if (!(share > 0)) return 0;
  place_pixels(grid.resolution());
  const Hemisphere above(grid, receiver, places_);
  share *= begin(above, drawn.nearness());
  const auto pixels = static_cast<float>(places_.size());
  share *= fall(kFew * pixels, kMany * pixels, static_cast<float>(seen_.size()));
  if (!(share > 0)) {
    clear();
    forget();
    return 0;
  }

  Sums sums;
  sent_ = 0;
  const bool ended = grow(above, sums);
  forget();
  if (ended) {
    std::ranges::copy_if(seen_, std::back_inserter(last_),
                         [&](std::uint32_t pixel) { return state_[pixel] == kOpen; });
    refine(above, sums);
    const auto mix = [&](const auto& from, const auto& to) { return from + share * (to - from); };
    shading.occlusion = mix(shading.occlusion, std::clamp(1 - sums.open / kPi, 0.0F, 1.0F));
    shading.sky = mix(shading.sky, sums.sky);
    if (const float length = glm::length(sums.towards); length > 0) {
      const glm::vec3 bent = mix(shading.bent_normal, sums.towards / length);
      if (const float size = glm::length(bent); size > 0) shading.bent_normal = bent / size;
    }
  }
  clear();
  return sent_;
}

}  // namespace ptc
