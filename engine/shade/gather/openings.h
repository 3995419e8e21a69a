// The sky through small openings, by rays in the direction pixels around them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/cache/page_cache.h"
#include "engine/shade/gather/direction_buffer.h"
#include "engine/shade/gather/scene_view.h"
#include "engine/shade/shading.h"

namespace ptc {

/// Tells exactly which directions surfaces cover.
/// Threads: one thread at a time.
class Visibility {
 public:
  virtual ~Visibility() = default;
  /// Finds what is covered.
  /// @param directions  unit, above the receiver's horizon; neighbours in the list look alike ways
  /// @param covered     as many as directions: 1 where something covers, else 0
  /// @throws FormatError when a page is damaged
  virtual void find(const Receiver& receiver, std::span<const glm::vec3> directions,
                    std::span<std::uint8_t> covered) = 0;
};

/// Makes a Visibility for a thread. It may take a reader of the cache.
using VisibilityMaker =
    std::function<std::unique_ptr<Visibility>(const SceneView& view, PageCache& cache)>;

/// Finds the sky that receivers see through small openings (spec/shading.md#openings).
///
/// Most pixels of a window lie at its border, which the discs of clusters move. So rays decide
/// about each pixel that is drawn as open, and about those around each that proves to be open:
///
///     . . . . . . . . . .        . . x x x x x . . .        .  not looked at
///     . . . . . . . . . .        . x x o o o x x . .        d  drawn as open
///     . . . . d d . . . .  --->  . x o o o o o x . .        o  a ray finds it open
///     . . . d d d . . . .        . x o o o o o x . .        x  a ray finds it covered
///     . d . . . . . . . .        . x x x x x x x . .
///
/// A receiver also begins with what was open to the one before, since what is close to it, such as
/// a wall beside it, may hide all of the opening where it is drawn.
///
/// Threads: one thread at a time.
/// Memory: 7 bytes for each pixel of a cube, 12 for each that is looked at, 21 for each ray.
class Openings {
 public:
  /// @param visibility  not null
  explicit Openings(std::unique_ptr<Visibility> visibility) : visibility_(std::move(visibility)) {}

  /// Forgets what was open to the receiver before: the next one lies elsewhere.
  void forget() noexcept { last_.clear(); }
  /// Replaces occlusion, bent normal and sky of a receiver to which little is open.
  /// @param grid     with a sky
  /// @param drawn    what covers the receiver's hemisphere
  /// @param shading  of DirectionBuffer::resolve()
  /// @return         number of rays
  /// @throws FormatError when a page is damaged
  std::size_t mend(const DirectionGrid& grid, const DirectionBuffer& drawn,
                   const Receiver& receiver, Shading& shading);

 private:
  class Hemisphere;
  /// Where a pixel lies.
  struct Place {
    std::uint16_t along;      ///< place along a curve on which neighbours lie close together
    std::uint8_t face, x, y;  ///< face, column and row
  };
  /// What is known of a pixel.
  enum State : std::uint8_t { kUnseen, kCovered, kBorder, kOpen };
  struct Ray {
    std::uint32_t pixel;
    float weight;  ///< solid angle times cosine, sr
  };
  /// Sums over open rays.
  struct Sums {
    float open = 0;        ///< of weights, sr
    glm::vec3 sky{0};      ///< of weights times radiance
    glm::vec3 towards{0};  ///< of weights times directions
  };

  void place_pixels(std::uint32_t side);
  float begin(const Hemisphere& above, std::span<const float> nearness);
  void visit(const Hemisphere& above, std::uint32_t pixel);
  void look(const Hemisphere& above, std::uint32_t first, std::uint32_t end, Sums& sums);
  bool grow(const Hemisphere& above, Sums& sums);
  void refine(const Hemisphere& above, Sums& sums);
  void clear() noexcept;

  std::unique_ptr<Visibility> visibility_;
  std::vector<Place> places_;        ///< by pixel
  std::vector<State> state_;         ///< by pixel; all kUnseen between calls
  std::vector<std::uint32_t> seen_;  ///< pixels that are not kUnseen
  std::vector<std::uint32_t> wave_;  ///< pixels to look at
  std::vector<std::uint32_t> last_;  ///< pixels that were open to the receiver before
  std::size_t sent_ = 0;             ///< rays of the current receiver
  std::vector<Ray> rays_;
  std::vector<glm::vec3> directions_;  ///< of rays, unit
  std::vector<std::uint8_t> covered_;  ///< by ray
};

}  // namespace ptc
