#include "engine/shade/gather/openings.h"

#include <cmath>
#include <memory>
#include <vector>

#include <catch2/catch.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "engine/base/numbers.h"

using namespace ptc;

namespace {

/// A window in a wall at x = 1 around the axis; everything else is covered.
struct Window {
  float half_y = 0, half_z = 0;
  float shift = 0;  ///< of its middle along y

  [[nodiscard]] bool contains(const glm::vec3& d) const {
    return d.x > 0 && std::abs(d.y / d.x - shift) < half_y && std::abs(d.z / d.x) < half_z;
  }
  /// Returns the integral of the cosine to a normal over the window, sr.
  [[nodiscard]] float weight(const glm::vec3& normal) const {
    constexpr int kSteps = 400;
    double sum = 0;
    for (int i = 0; i < kSteps * kSteps; ++i) {
      const auto place = [&](int k, float half) {
        return static_cast<double>(half) * ((k + 0.5) * 2 / kSteps - 1);
      };
      const double y = place(i % kSteps, half_y) + static_cast<double>(shift),
                   z = place(i / kSteps, half_z), length2 = 1 + y * y + z * z;
      const double height = static_cast<double>(normal.x) + y * static_cast<double>(normal.y) +
                            z * static_cast<double>(normal.z);
      sum += std::max(0.0, height) / (length2 * length2);
    }
    return static_cast<float>(sum * 4 * static_cast<double>(half_y * half_z) / (kSteps * kSteps));
  }
};

class WindowVisibility final : public Visibility {
 public:
  explicit WindowVisibility(const Window& window) : window_(window) {}
  void find(const Receiver& receiver, std::span<const glm::vec3> directions,
            std::span<std::uint8_t> covered) override {
    for (std::size_t i = 0; i < directions.size(); ++i) {
      CHECK(glm::length(directions[i]) == Approx(1));
      CHECK(glm::dot(directions[i], receiver.normal) >= -1e-6F);
      covered[i] = std::uint8_t{!window_.contains(directions[i])};
    }
  }

 private:
  Window window_;
};

/// Draws discs that face the viewpoint in all directions but some.
template <class Open>
void draw_around(const DirectionGrid& grid, DirectionBuffer& buffer, const Open& is_open) {
  constexpr int kDiscs = 40000;
  DiscQueue queue;
  buffer.clear();
  for (int i = 0; i < kDiscs; ++i) {
    const float z = 1 - 2 * (static_cast<float>(i) + 0.5F) / kDiscs,
                angle = 2.3999632F * static_cast<float>(i), r = std::sqrt(1 - z * z);
    const glm::vec3 to(r * std::cos(angle), r * std::sin(angle), z);
    if (is_open(to)) continue;
    queue.push(to, -to, 0.03F, 0);
    if (!queue.full() && i + 1 < kDiscs) continue;
    buffer.draw(grid, queue, Sides::both);
    queue.size = 0;
  }
  buffer.draw(grid, queue, Sides::both);
}

glm::vec3 white(const glm::vec3&) {
  return glm::vec3(1);
}

}  // namespace

TEST_CASE("openings: the sky through a window is that of the window, wherever it is drawn",
          "[shade][openings]") {
  const unsigned resolution = GENERATE(32U, 64U);
  const DirectionGrid grid(resolution, white);
  DirectionBuffer buffer(resolution);
  // The window that is drawn is narrower, and lies beside the one that is there
  const Window window{.half_y = 0.2F, .half_z = 0.15F};
  const Window drawn{.half_y = 0.15F, .half_z = 0.12F, .shift = 0.06F};
  draw_around(grid, buffer, [&](const glm::vec3& d) { return drawn.contains(d); });
  Openings openings(std::make_unique<WindowVisibility>(window));
  double ours = 0, exact = 0, square = 0, before = 0;
  for (int i = 0; i < 200; ++i) {
    const glm::vec3 normal = glm::normalize(
        glm::vec3(0.2F, std::cos(static_cast<float>(i)), std::sin(static_cast<float>(i))) +
        glm::vec3(static_cast<float>(i) / 200, 0, 0));
    const Receiver receiver{.position = glm::dvec3(0.001 * i), .normal = normal};
    Shading shading = buffer.resolve(grid, normal);
    before += static_cast<double>(shading.sky.g);
    openings.forget();
    CHECK(openings.mend(grid, buffer, receiver, shading) > 0);
    const auto truth = static_cast<double>(window.weight(normal));
    const double error = static_cast<double>(shading.sky.g) - truth;
    ours += static_cast<double>(shading.sky.g);
    exact += truth;
    square += error * error;
    CHECK(static_cast<double>(1 - shading.occlusion) * kPiDouble ==
          Approx(static_cast<double>(shading.sky.g)).margin(1e-5));
    CHECK(glm::dot(shading.bent_normal, glm::vec3(1, 0, 0)) > 0.97F);
  }
  CHECK(before < 0.8 * exact);
  CHECK(ours == Approx(exact).epsilon(0.01));
  CHECK(std::sqrt(square / 200) < 0.06 * exact / 200);
}

TEST_CASE(
    "openings: what was open to the receiver before is looked at again, until it is forgotten",
    "[shade][openings]") {
  const DirectionGrid grid(32, white);
  DirectionBuffer open(32), covered(32);
  const Window window{.half_y = 0.2F, .half_z = 0.15F};
  draw_around(grid, open, [&](const glm::vec3& d) { return window.contains(d); });
  draw_around(grid, covered, [](const glm::vec3&) { return false; });
  Openings openings(std::make_unique<WindowVisibility>(window));
  const Receiver receiver{.normal = {1, 0, 0}};
  const auto sky = [&](const DirectionBuffer& drawn) {
    Shading shading = drawn.resolve(grid, receiver.normal);
    openings.mend(grid, drawn, receiver, shading);
    return shading.sky.g;
  };
  REQUIRE(covered.resolve(grid, receiver.normal).sky.g == 0);
  CHECK(sky(covered) == 0);
  CHECK(sky(open) == Approx(window.weight(receiver.normal)).epsilon(0.2));
  CHECK(sky(covered) == Approx(window.weight(receiver.normal)).epsilon(0.2));
  openings.forget();
  CHECK(sky(covered) == 0);
}

TEST_CASE("openings: chinks and wide skies stay as they are drawn", "[shade][openings]") {
  const DirectionGrid grid(32, white);
  DirectionBuffer buffer(32);
  const bool wide = GENERATE(false, true);
  if (wide) {
    draw_around(grid, buffer, [](const glm::vec3& d) { return d.x > 0.8F; });
  } else {
    draw_around(grid, buffer, [](const glm::vec3& d) {
      return std::abs(std::remainder(d.y, 0.3F)) < 0.04F &&
             std::abs(std::remainder(d.z, 0.3F)) < 0.04F;
    });
  }
  const Receiver receiver{.normal = {1, 0, 0}};
  const Shading drawn = buffer.resolve(grid, receiver.normal);
  REQUIRE(drawn.sky.g > 0);
  Openings openings(std::make_unique<WindowVisibility>(Window{}));
  Shading shading = drawn;
  CHECK(openings.mend(grid, buffer, receiver, shading) == 0);
  CHECK(shading.sky == drawn.sky);
  CHECK(shading.occlusion == drawn.occlusion);
}
