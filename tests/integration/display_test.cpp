// How pictures choose their exposure, and what a .png then shows.
#include "engine/pipeline/render/display.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/io/image/image.h"
#include "engine/pipeline/render/picture_files.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;

namespace {

Display display_of(const std::vector<glm::vec3>& pixels) {
  ExposureMeter meter;
  meter.add(pixels);
  return meter.display();
}

std::vector<glm::vec3> shown(const Display& display, std::vector<glm::vec3> pixels) {
  display.show(pixels);
  return pixels;
}

// The light of a picture of 100 x 100 pixels: walls from 1 to 3, and black around them.
Film bright_film() {
  Film film(100, 100, {});
  for (std::size_t i = 1000; i < 10'000; ++i)
    film.add_sky(i, glm::vec3(1 + 2 * static_cast<float>(i) / 10'000), 1);
  film.finish();
  return film;
}

double share_of_white(const Image& image) {
  const auto white = std::ranges::count_if(image.pixels, [](const glm::vec3& p) {
    return std::max({p.x, p.y, p.z}) >= 1;
  });
  return static_cast<double>(white) / static_cast<double>(image.pixels.size());
}

}  // namespace

TEST_CASE("display: light of few stops is scaled, and nothing else, until it is bright",
          "[integration][display]") {
  for (const float level : {1e-6f, 0.02f, 1.0f, 5e4f}) {
    const Display display = display_of(std::vector<glm::vec3>(100, glm::vec3(level)));
    CHECK(display.white == 1);
    const float value = shown(display, {glm::vec3(level)})[0].x;
    CHECK(value > 0.85f);
    CHECK(value <= 0.901f);
    CHECK(shown(display, {glm::vec3(level / 2)})[0].x == Approx(value / 2));
  }
}

TEST_CASE("display: beside a lamp the room is still seen, and the lamp is just white",
          "[integration][display]") {
  std::vector<glm::vec3> pixels(9800, glm::vec3(0.1f, 0.05f, 0.05f));
  pixels.resize(10'000, glm::vec3(1000));
  const Display display = display_of(pixels);
  const auto seen = shown(display, {{0.1f, 0.05f, 0.05f}, {0.2f, 0.2f, 0.2f}, glm::vec3(1000)});
  CHECK(seen[0].x > 0.11f);
  CHECK(seen[0].x < 0.2f);
  CHECK(seen[1].x > seen[0].x);
  CHECK(seen[2].x > 0.95f);
  CHECK(seen[2].x <= 1.001f);
}

TEST_CASE("display: at most one pixel in two hundred is too bright, whatever the light",
          "[integration][display]") {
  std::uint32_t state = 1;
  for (const double stops : {0.5, 3.0, 12.0, 40.0}) {
    std::vector<glm::vec3> pixels;
    for (int i = 0; i < 20'000; ++i) {
      state = state * 1664525U + 1013904223U;
      const double level = std::exp2(stops * (state >> 8) / double{1 << 24});
      pixels.emplace_back(level, 0.5 * level, 0);
    }
    const auto seen = shown(display_of(pixels), pixels);
    const auto clipped = std::ranges::count_if(seen, [](const glm::vec3& p) { return p.x > 1; });
    CHECK(clipped <= 100);
    CHECK(std::ranges::max(seen, {}, &glm::vec3::x).x > 0.8f);
  }
}

TEST_CASE("display: a black picture stays black, and odd values do not count",
          "[integration][display]") {
  CHECK(display_of({}).gain == 1);
  CHECK(display_of({glm::vec3(0), glm::vec3(-1), glm::vec3(NAN), glm::vec3(INFINITY)}).gain == 1);
  const Display wide{.gain = 2, .white = 100};
  CHECK(shown(wide, {glm::vec3(INFINITY), glm::vec3(3e38f)})[0].x > 1);
  CHECK(shown(wide, {glm::vec3(3e38f)})[0].y > 1);
  CHECK(Display::at_exposure(1).gain == 2);
  CHECK(Display::at_exposure(-3).white == 1);
}

TEST_CASE("display: a .png is not flat white unless that is asked for", "[integration][display]") {
  const test::TemporaryDirectory scratch;
  const std::vector<PictureTarget> targets{{scratch.path() / "a.png", "beauty"}};
  const Film film = bright_film();
  std::vector<ExrLayerType> types;
  for (const Film::Layer& layer : film.layers()) types.push_back(layer.type);
  const auto write = [&](std::optional<Display> display) {
    PictureFiles files(targets, ImageWindow::whole(100, 100), types, {}, display, scratch.path());
    files.write(film);
    const std::optional<Display> chosen = files.publish();
    CHECK(chosen.has_value() == !display.has_value());
    return read_image(scratch.path() / "a.png");
  };
  CHECK(share_of_white(write(Display::at_exposure(0))) == Approx(0.9));
  const Image chosen = write({});
  CHECK(share_of_white(chosen) <= 0.01);
  CHECK(chosen.at(50, 99).x > 0.8f);
  CHECK(chosen.at(50, 5) == glm::vec3(0));
  CHECK(chosen.at(50, 50).x == Approx(2.0f / 3 * chosen.at(50, 99).x).epsilon(0.02));
  CHECK(scratch.listing() == "a.png");
}
