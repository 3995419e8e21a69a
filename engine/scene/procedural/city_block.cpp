// One block of the city, built from dice that the block's place seeds: the same place always gets
// the same block, whatever was built before.
//
// Seen from above, lengths in metres:
//
//     +---------------------------+  16
//     |  street (ground, asphalt) |
//     |   +-------------------+   |  13.8     pavement: a slab over the highest ground below it
//     |   |  +-------------+  |   |  12.6     lot: a park, one building, or two with an alley
//     |   |  |     lot     |  |   |
//     |   |  +-------------+  |   |  3.4
//     |   |       trees       |   |
//     |   +-------------------+   |  2.2
//     +---------------------------+  0
//
// Everything is made of flat facets: boxes, without a bottom where they stand on something, and
// icosahedra for leaves. The ground is a sum of waves of the world's x and z, so that blocks join.
#include "engine/scene/procedural/city_block.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include "engine/base/low_discrepancy.h"

namespace ptc {
namespace {

enum Colour : std::uint8_t {
  kAsphalt,
  kGrass,
  kPavement,
  kTrunk,
  kLeaves,
  kDarkLeaves,
  kLedge,
  kRoofBox,
  kAwning,
  kShutter,
  kFirstWall  // this colour and all after it are for walls
};

// Reflectance of each colour, red, green and blue.
constexpr std::array<glm::vec3, kCityColours> kAlbedo = {{
    {0.12f, 0.12f, 0.13f},
    {0.18f, 0.34f, 0.10f},
    {0.42f, 0.40f, 0.37f},
    {0.30f, 0.20f, 0.12f},
    {0.16f, 0.42f, 0.12f},
    {0.10f, 0.30f, 0.10f},
    {0.70f, 0.69f, 0.64f},
    {0.55f, 0.56f, 0.58f},
    {0.60f, 0.20f, 0.16f},
    {0.18f, 0.28f, 0.52f},
    {0.74f, 0.66f, 0.52f},
    {0.62f, 0.36f, 0.26f},
    {0.78f, 0.76f, 0.72f},
    {0.50f, 0.52f, 0.46f},
    {0.72f, 0.52f, 0.36f},
    {0.40f, 0.44f, 0.54f},
}};

constexpr float kBlock = static_cast<float>(kBlockMetres);
constexpr float kKerb = 2.2f;    // metres from the block's border to the pavement
constexpr float kLot = 3.4f;     // metres from the block's border to the buildings
constexpr int kGroundCells = 8;  // squares of ground along a side of the block
static_assert(2 * kGroundCells * kGroundCells == kGroundTriangles);

// A stream of random choices that a place seeds.
class Dice {
 public:
  explicit Dice(const BlockPlace& place)
      : state_(splitmix64(splitmix64(static_cast<std::uint64_t>(place.column)) ^
                          static_cast<std::uint64_t>(place.row))) {}

  float between(float low, float high) {
    return low + (high - low) * to_unit(static_cast<std::uint32_t>(next() >> 32));
  }
  bool chance(float share) { return between(0, 1) < share; }
  int whole(int low, int high) {
    return low + static_cast<int>(next() % static_cast<std::uint64_t>(high - low + 1));
  }

 private:
  std::uint64_t next() { return state_ = splitmix64(state_); }
  std::uint64_t state_;
};

// Returns the height of the ground at a place of the world, metres.
float ground_height(double x, double z) {
  return static_cast<float>(1.8 * std::sin(x / 97) * std::cos(z / 83) +
                            0.2 * std::sin(x / 17 + 1) * std::sin(z / 19));
}

// Collects the facets of one block.
class Builder {
 public:
  explicit Builder(const BlockPlace& place) : corner_(block_corner(place)), dice_(place) {}

  std::vector<Facet> build() {
    ground();
    const float top = pavement();
    if (dice_.chance(0.15f)) {
      park(top);
    } else {
      buildings(top);
    }
    for (int i = 0; i < 3; ++i) {
      tree({dice_.between(kKerb, kBlock - kKerb), top, 0.5f * (kKerb + kLot)},
           dice_.between(0.5f, 0.8f));
    }
    return std::move(facets_);
  }

 private:
  // Returns the height of the ground at a place of the block.
  [[nodiscard]] float height(float x, float z) const {
    return ground_height(corner_.x + static_cast<double>(x), corner_.z + static_cast<double>(z));
  }

  void triangle(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c, std::uint8_t colour) {
    facets_.push_back({a, b - a, c - a, colour, true});
  }

  // Adds a box whose faces look outwards. Its bottom is left out where it stands on something.
  void box(const glm::vec3& low, const glm::vec3& high, std::uint8_t colour, bool has_bottom) {
    const glm::vec3 x(high.x - low.x, 0, 0);
    const glm::vec3 y(0, high.y - low.y, 0);
    const glm::vec3 z(0, 0, high.z - low.z);
    facets_.push_back({low + x, y, z, colour, false});
    facets_.push_back({low, z, y, colour, false});
    facets_.push_back({low + y, z, x, colour, false});
    facets_.push_back({low + z, x, y, colour, false});
    facets_.push_back({low, y, x, colour, false});
    if (has_bottom) facets_.push_back({low, x, z, colour, false});
  }

  void ground() {
    constexpr float kCell = kBlock / kGroundCells;
    const auto at = [&](int i, int j) {
      const float x = kCell * static_cast<float>(i);
      const float z = kCell * static_cast<float>(j);
      return glm::vec3(x, height(x, z), z);
    };
    for (int j = 0; j < kGroundCells; ++j) {
      for (int i = 0; i < kGroundCells; ++i) {
        triangle(at(i, j), at(i, j + 1), at(i + 1, j + 1), kAsphalt);
        triangle(at(i, j), at(i + 1, j + 1), at(i + 1, j), kAsphalt);
      }
    }
  }

  // Adds a slab that the ground does not pierce. @return  the height of its top
  float pavement() {
    const float end = kBlock - kKerb;
    const auto [low, high] =
        std::minmax({height(kKerb, kKerb), height(kKerb, end), height(end, kKerb), height(end, end),
                     height(0.5f * kBlock, 0.5f * kBlock)});
    box({kKerb, low - 0.3f, kKerb}, {end, high + 0.15f, end}, kPavement, false);
    return high + 0.15f;
  }

  void park(float top) {
    const float end = kBlock - kLot;
    box({kLot, top - 0.05f, kLot}, {end, top + 0.1f, end}, kGrass, false);
    const int trees = dice_.whole(5, 9);
    for (int i = 0; i < trees; ++i) {
      const float x = dice_.between(kLot + 1, end - 1);
      const float z = dice_.between(kLot + 1, end - 1);
      tree({x, top + 0.1f, z}, dice_.between(0.8f, 1.5f));
    }
  }

  void buildings(float top) {
    const float end = kBlock - kLot;
    if (!dice_.chance(0.4f)) return building({kLot, top, kLot}, {end, top, end});
    const float gap = dice_.between(kLot + 3, end - 4);
    building({kLot, top, kLot}, {gap, top, end});
    building({gap + 0.8f, top, kLot}, {end, top, end});
  }

  // Adds a building on the rectangle between two corners at the height of the pavement.
  void building(const glm::vec3& low, const glm::vec3& base_high) {
    // Choose its height and colour, and raise the walls.
    const float storey = dice_.between(2.9f, 3.5f);
    const int storeys = dice_.whole(2, 6) + (dice_.chance(0.2f) ? dice_.whole(2, 7) : 0);
    const glm::vec3 high(base_high.x, low.y + storey * static_cast<float>(storeys), base_high.z);
    const auto wall = static_cast<std::uint8_t>(dice_.whole(kFirstWall, kCityColours - 1));
    box(low - glm::vec3(0, 0.1f, 0), high, wall, false);
    // Put a ledge and awnings on each storey.
    for (int i = 1; i <= storeys; ++i) {
      const float y = low.y + storey * static_cast<float>(i);
      const bool is_roof = i == storeys;  // the roof lies above the top of the walls, not in it
      const glm::vec3 out(is_roof ? 0.45f : 0.3f, is_roof ? 0.06f : 0, is_roof ? 0.45f : 0.3f);
      box(glm::vec3(low.x, y - 0.2f, low.z) - out, glm::vec3(high.x, y, high.z) + out, kLedge,
          true);
      front(low, high, y - storey, storey);
    }
    // Put boxes on the roof.
    const int boxes = dice_.whole(2, 5);
    for (int i = 0; i < boxes; ++i) {
      const glm::vec3 size(dice_.between(0.6f, 1.6f), dice_.between(0.5f, 2),
                           dice_.between(0.6f, 1.6f));
      const glm::vec3 at(dice_.between(low.x, high.x - size.x), high.y,
                         dice_.between(low.z, high.z - size.z));
      box(at, at + size, kRoofBox, false);
    }
  }

  // Adds awnings over the windows of one storey, on the two sides that look along x.
  void front(const glm::vec3& low, const glm::vec3& high, float floor, float storey) {
    const std::uint8_t colour = dice_.chance(0.5f) ? kAwning : kShutter;
    const int windows = static_cast<int>((high.z - low.z) / 2.6f);
    for (int i = 0; i < windows; ++i) {
      const float z = low.z + 0.7f + 2.6f * static_cast<float>(i);
      const float y = floor + 0.72f * storey;
      if (dice_.chance(0.6f)) {
        box({high.x, y, z}, {high.x + 0.7f, y + 0.08f, z + 1.3f}, colour, true);
      }
      if (dice_.chance(0.6f)) box({low.x - 0.7f, y, z}, {low.x, y + 0.08f, z + 1.3f}, colour, true);
    }
  }

  void tree(const glm::vec3& foot, float size) {
    const float trunk = 2.2f * size + 1;
    const float half = 0.09f + 0.06f * size;
    box(foot - glm::vec3(half, 0.1f, half), foot + glm::vec3(half, trunk, half), kTrunk, false);
    const int clumps = dice_.whole(7, 12);
    for (int i = 0; i < clumps; ++i) {
      const glm::vec3 shift(dice_.between(-1, 1), dice_.between(-0.6f, 1), dice_.between(-1, 1));
      clump(foot + glm::vec3(0, trunk + 0.4f * size, 0) + 1.1f * size * shift,
            size * dice_.between(0.35f, 0.7f), dice_.chance(0.4f) ? kDarkLeaves : kLeaves);
    }
  }

  // Adds an icosahedron: two poles, and two rings of five corners turned against each other.
  void clump(const glm::vec3& centre, float radius, std::uint8_t colour) {
    constexpr float kRise = 0.4472136f;  // height of a ring over the middle: 1 / sqrt(5)
    constexpr float kRing = 0.8944272f;  // radius of a ring: 2 / sqrt(5)
    constexpr float kTurn = 1.2566371f;  // a fifth of a turn, radians
    // Place the corners of both rings.
    const float start = dice_.between(0, kTurn);
    std::array<glm::vec3, 5> upper, lower;
    for (std::size_t i = 0; i < 5; ++i) {
      const float a = start + kTurn * static_cast<float>(i);
      const float b = a + 0.5f * kTurn;
      upper[i] = centre + radius * glm::vec3(kRing * std::sin(a), kRise, kRing * std::cos(a));
      lower[i] = centre + radius * glm::vec3(kRing * std::sin(b), -kRise, kRing * std::cos(b));
    }
    // Join them with each other and with the poles.
    const glm::vec3 top = centre + glm::vec3(0, radius, 0);
    const glm::vec3 bottom = centre - glm::vec3(0, radius, 0);
    for (std::size_t i = 0; i < 5; ++i) {
      const std::size_t next = (i + 1) % 5;
      triangle(top, upper[i], upper[next], colour);
      triangle(upper[i], lower[i], upper[next], colour);
      triangle(lower[i], lower[next], upper[next], colour);
      triangle(bottom, lower[next], lower[i], colour);
    }
  }

  glm::dvec3 corner_;
  Dice dice_;
  std::vector<Facet> facets_;
};

}  // namespace

BlockPlace block_place(std::uint64_t index) {
  if (index == 0) return {};
  // Find the ring: ring r holds the blocks from (2r - 1)^2 to (2r + 1)^2 - 1, on four sides of 2r
  // blocks each.
  auto ring = static_cast<std::int64_t>((std::sqrt(static_cast<double>(index)) + 1) / 2);
  const auto begin_of = [](std::int64_t r) {
    return static_cast<std::uint64_t>((2 * r - 1) * (2 * r - 1));
  };
  while (begin_of(ring) > index) --ring;
  while (begin_of(ring + 1) <= index) ++ring;
  // Find the side, and the step along it.
  const auto along = static_cast<std::int64_t>(index - begin_of(ring));
  const std::int64_t side = along / (2 * ring);
  const std::int64_t step = along % (2 * ring);
  switch (side) {
    case 0:
      return {ring, step - ring + 1};
    case 1:
      return {ring - 1 - step, ring};
    case 2:
      return {-ring, ring - 1 - step};
    default:
      return {step - ring + 1, -ring};
  }
}

glm::dvec3 block_corner(const BlockPlace& place) {
  return {kBlockMetres * (static_cast<double>(place.column) - 0.5), 0,
          kBlockMetres * (static_cast<double>(place.row) - 0.5)};
}

std::vector<Facet> build_block(const BlockPlace& place) {
  return Builder(place).build();
}

glm::vec3 city_albedo(std::uint32_t colour) {
  return kAlbedo[colour];
}

}  // namespace ptc
