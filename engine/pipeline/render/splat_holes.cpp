//     .  .  .  .  .        o  a sample that sees nothing, or something farther
//     .  .  \  |  /        .  samples of the surface
//     .  .  - o  -
//     .  .  /  |  \        Each of eight directions is followed to the first sample of the surface;
//     .  .  .  .  .        it must come within the reach of that sample's disc.
#include "engine/pipeline/render/splat_holes.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "format/scalar.h"

namespace ptc {
namespace {

constexpr int kMaxReach = 64;    // samples; wider gaps are not closed
constexpr unsigned kBlock = 16;  // samples along the side of a block
constexpr int kPasses = 3;       // holes beside holes take more than one
static_assert(kHoleReach == kPasses * kMaxReach);
constexpr float kReach = 4;    // radii of the disc: points at random leave such gaps
constexpr float kInFront = 3;  // radii by which a surface is nearer than what shows through it
constexpr float kInFrontOfBack = 1;    // the same where the back of a disc shows
constexpr float kBand = 12;            // radii by which depths of one surface differ around a hole
constexpr std::size_t kLeastHits = 7;  // of eight directions
constexpr std::size_t kLeastOfBack = 5;  // the same where the back of a disc is seen
constexpr std::size_t kLeastNear = 3;    // the same of hits that are near
constexpr float kNear = 1.5F;            // radii of the disc up to which a hit is near
constexpr std::array<std::array<int, 2>, 8> kDirections{
    {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};

/// Looks for the surface around one sample.
class HoleTest {
 public:
  /// @param rims  also close samples at the rim of a surface, where the back of a disc shows
  HoleTest(const SplatPicture& picture, bool rims)
      : picture_(picture),
        rims_(rims),
        columns_((picture.width + kBlock - 1) / kBlock),
        rows_((picture.height + kBlock - 1) / kBlock) {
    // Find the greatest reach in each block, and then among the blocks that are near enough to
    // matter
    std::vector<float> own(std::size_t{columns_} * rows_);
    for (unsigned y = 0; y < picture.height; ++y) {
      for (unsigned x = 0; x < picture.width; ++x) {
        const SplatSample& sample = at(static_cast<int>(x), static_cast<int>(y));
        if (sample.empty()) continue;
        float& greatest = own[std::size_t{y / kBlock} * columns_ + x / kBlock];
        greatest = std::max(greatest, std::min<float>(kMaxReach, reach_of(sample)));
      }
    }
    reach_.resize(own.size());
    for (unsigned row = 0; row < rows_; ++row) {
      for (unsigned column = 0; column < columns_; ++column)
        reach_[std::size_t{row} * columns_ + column] = reach_around(own, row, column);
    }
  }

  /// Returns what closes the hole that a sample is in; an empty sample where it is in none.
  [[nodiscard]] SplatSample closing(int x, int y) const {
    // Look for the surface in all directions
    const SplatSample& seen = at(x, y);
    const float reach = reach_[static_cast<std::size_t>(y) / kBlock * columns_ +
                               static_cast<std::size_t>(x) / kBlock];
    if (reach == 0) return {};
    const bool back = !seen.empty() && seen.payload.back;
    const std::size_t least = !back ? kLeastHits : rims_ ? kLeastNear : kLeastOfBack;
    const float in_front = back ? kInFrontOfBack : kInFront;
    std::array<Hit, kDirections.size()> hits;
    std::size_t count = 0, near = 0;
    for (std::size_t i = 0; i < kDirections.size(); ++i) {
      if (const Hit hit = look(x, y, kDirections[i], seen.depth, in_front, reach); hit.sample) {
        std::size_t k = count++;  // hits stay in the order of their depths
        for (; k > 0 && hits[k - 1].sample->depth > hit.sample->depth; --k) hits[k] = hits[k - 1];
        hits[k] = hit;
        if (hit.distance <= reach_of(*hit.sample, kNear)) ++near;
      }
      if (i + 1 - count > kDirections.size() - least) return {};
    }
    if (back && near < kLeastNear && count < kLeastOfBack) return {};
    // Leave out hits far behind the middle one: they see through a hole themselves
    const auto found = std::span(hits).first(count);
    const SplatSample& middle = *found[count / 2].sample;
    const float band = kBand * radius_of(middle);
    float nearness = 0, weights = 0, nearest = std::numeric_limits<float>::infinity();
    SplatSample closed;
    for (const Hit& hit : found) {
      if (std::abs(hit.sample->depth - middle.depth) > band) continue;
      weights += 1 / hit.distance;
      nearness += 1 / (hit.distance * hit.sample->depth);
      if (hit.distance >= nearest) continue;
      nearest = hit.distance;
      closed.payload = hit.sample->payload;
    }
    closed.depth = weights / nearness;
    return closed;
  }

 private:
  [[nodiscard]] const SplatSample& at(int x, int y) const {
    return picture_
        .samples[static_cast<std::size_t>(y) * picture_.width + static_cast<std::size_t>(x)];
  }

  /// A sample of the surface in one direction.
  struct Hit {
    const SplatSample* sample = nullptr;  ///< null: there is none within its reach
    float distance = 0;                   ///< samples
  };

  [[nodiscard]] float radius_of(const SplatSample& sample) const {
    return picture_.scale.radius(decode_ufloat16(sample.payload.radius));
  }

  /// Returns the distance within which a sample counts, samples; at least that of the next ones.
  /// @param radii  the same in radii of its disc
  [[nodiscard]] float reach_of(const SplatSample& sample, float radii = kReach) const {
    const float radius = std::min(radius_of(sample), picture_.widest);
    return std::max(1.5F, radii * radius * picture_.focal / sample.depth);
  }

  /// Returns the greatest reach of the samples whose reach may lead into a block.
  [[nodiscard]] float reach_around(const std::vector<float>& own, unsigned row,
                                   unsigned column) const {
    constexpr unsigned kAround = kMaxReach / kBlock;
    float greatest = 0;
    for (unsigned r = row < kAround ? 0 : row - kAround; r < std::min(rows_, row + kAround + 1);
         ++r) {
      for (unsigned c = column < kAround ? 0 : column - kAround;
           c < std::min(columns_, column + kAround + 1); ++c) {
        const unsigned apart =
            std::max(r < row ? row - r : r - row, c < column ? column - c : c - column);
        const float reach = own[std::size_t{r} * columns_ + c];
        if (reach > static_cast<float>(apart == 0 ? 0 : (apart - 1) * kBlock))
          greatest = std::max(greatest, reach);
      }
    }
    return greatest;
  }

  /// Follows a direction to the first sample that is in front of `depth`.
  /// @param in_front  radii of its disc by which it must be in front
  /// @param reach     greatest distance to look at, samples
  [[nodiscard]] Hit look(int x, int y, const std::array<int, 2>& direction, float depth,
                         float in_front, float reach) const {
    const float step = direction[0] != 0 && direction[1] != 0 ? 1.4142135F : 1;
    for (int k = 1; static_cast<float>(k) <= reach; ++k) {
      const int sx = x + k * direction[0], sy = y + k * direction[1];
      if (sx < 0 || sy < 0 || sx >= static_cast<int>(picture_.width) ||
          sy >= static_cast<int>(picture_.height))
        break;
      const SplatSample& sample = at(sx, sy);
      if (sample.depth >= depth) continue;
      if (!(sample.depth + in_front * radius_of(sample) < depth)) continue;
      const float distance = step * static_cast<float>(k);
      return {distance > reach_of(sample) ? nullptr : &sample, distance};
    }
    return {};
  }

  const SplatPicture& picture_;
  bool rims_;
  unsigned columns_, rows_;   ///< of blocks
  std::vector<float> reach_;  ///< by block: greatest reach of samples in it or near it
};

}  // namespace

std::size_t close_holes(const SplatPicture& picture, const Executor& executor) {
  std::size_t all = 0;
  for (int pass = 0; pass < kPasses; ++pass) {
    // Find the holes of all rows before any is closed, so that the order does not matter
    const HoleTest test(picture, pass == 0);  // a rim that has grown is none
    std::vector<std::vector<std::pair<unsigned, SplatSample>>> closed(picture.height);
    executor.for_each(picture.height, [&](std::size_t y, unsigned) {
      for (unsigned x = 0; x < picture.width; ++x) {
        const SplatSample sample = test.closing(static_cast<int>(x), static_cast<int>(y));
        if (!sample.empty()) closed[y].emplace_back(x, sample);
      }
    });
    // Close them
    const std::size_t before = all;
    for (std::size_t y = 0; y < closed.size(); ++y) {
      for (const auto& [x, sample] : closed[y]) picture.samples[y * picture.width + x] = sample;
      all += closed[y].size();
    }
    if (all == before) break;
  }
  return all;
}

}  // namespace ptc
