// Rows of seams: smooth pictures with eight times the contrast, and steps of their error across the
// borders of receiver cells and of tiles beside steps elsewhere.
//
//   +--------tile--------+--tile--+     the error of both pixels of a pair o o: where it changes
//   |    :        :     o|o   :   |     more across the borders of cells (:) or of tiles (|) than
//   |    :      o : o    |    :   |     it does elsewhere, a seam shows
//   +--------------------+--------+
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <glm/common.hpp>

#include "engine/pipeline/render/tile_renderer.h"
#include "engine/shade/gather/receiver_cell.h"
#include "engine/shade/gather/scene_view.h"
#include "tools/bench/chart/flip.h"
#include "tools/bench/stability/panel_pictures.h"
#include "tools/bench/stability/row.h"

namespace ptc::bench {
namespace {

constexpr double kSeamSpacing = 0.04;
constexpr float kContrast = 8;  // by which differences are multiplied to look for seams

/// Returns a camera of pictures wider than a tile, in a scene whose z points up.
Camera wide_camera(const glm::dvec3& position, const glm::dvec3& look_at, float fov) {
  return {.position = position,
          .look_at = look_at,
          .up = {0, 0, 1},
          .vertical_fov = fov,
          .width = 144,
          .height = 48};
}

/// Returns values so that differences from the mean of the true ones are eight times as large.
std::vector<glm::vec3> in_contrast(const std::vector<glm::vec3>& values,
                                   const std::vector<glm::vec3>& truth) {
  glm::dvec3 mean(0);
  for (const glm::vec3& value : truth)
    mean += glm::dvec3(value) / static_cast<double>(truth.size());
  std::vector<glm::vec3> shown;
  for (const glm::vec3& value : values) {
    shown.push_back(glm::clamp(0.5F + kContrast * (value - glm::vec3(mean)), 0.0F, 1.0F));
  }
  return shown;
}

/// A mean of some steps.
struct MeanStep {
  double sum = 0;
  std::size_t count = 0;

  void add(double step) {
    sum += step;
    ++count;
  }
  [[nodiscard]] double mean() const { return count > 0 ? sum / static_cast<double>(count) : 0; }
};

/// Steps of the error between neighbouring pixels that see one panel.
struct Seams {
  double largest = 0, square = 0;
  MeanStep across_cells, across_tiles, elsewhere;

  /// @param cells  whether a border of receiver cells lies between them
  void add(double step, bool cells, bool tiles) {
    largest = std::max(largest, step);
    square += step * step;
    if (cells) across_cells.add(step);
    if (tiles) across_tiles.add(step);
    if (!cells && !tiles) elsewhere.add(step);
  }
};

/// Says whether a large cell of some variant's receivers ends between two places.
bool parts_cells(const Frame& frame, const glm::dvec3& a, const glm::dvec3& b) {
  constexpr unsigned kVariants = 4;
  constexpr int kLevel = 4;  // of cells some 10 spacings wide, whose receivers are dozens
  for (unsigned variant = 0; variant < kVariants; ++variant) {
    const int level = variant == 0 ? kLevel : kLevel + 1;
    if (common_level(receiver_key(frame, a, variant), receiver_key(frame, b, variant)) < level)
      return true;
  }
  return false;
}

Outcome seams(const Lab& lab, const std::vector<Panel>& panels, const Camera& camera) {
  const PanelPictures pictures(lab, panels, kSeamSpacing, glm::vec3(1));
  const std::vector<glm::vec3> ours = pictures.render(camera);
  const TruePicture truth = pictures.truth(camera);
  const unsigned tile = TileRenderer::tile_of(camera.width, 2).width;
  const ContainerReader container(pictures.scene());
  const Frame frame = SceneView(container).frame();
  Seams found;
  const auto compare = [&](std::size_t a, std::size_t b) {
    if (truth.panel[a] < 0 || truth.panel[a] != truth.panel[b]) return;
    const glm::vec3 step = glm::abs((ours[a] - truth.light[a]) - (ours[b] - truth.light[b]));
    const bool tiles = b == a + 1 && b % camera.width % tile == 0;
    found.add(std::max({step.r, step.g, step.b}),
              parts_cells(frame, truth.place[a], truth.place[b]), tiles);
  };
  for (std::size_t i = 0; i < ours.size(); ++i) {
    if ((i + 1) % camera.width != 0) compare(i, i + 1);
    if (i + camera.width < ours.size()) compare(i, i + camera.width);
  }
  const std::size_t pairs =
      found.across_cells.count + found.across_tiles.count + found.elsewhere.count;
  Field field{camera.width, camera.height, in_contrast(ours, truth.light),
              in_contrast(truth.light, truth.light)};
  const double visible =
      mean_flip({field.width, field.height, field.ours}, {field.width, field.height, field.truth});
  const auto beyond = [&](const MeanStep& some) {
    return kContrast * std::max(0.0, some.mean() - found.elsewhere.mean());
  };
  return {.figures = {{"step of the error between pixels, largest", found.largest, 0.015},
                      {"the same, RMS, times eight",
                       kContrast * std::sqrt(found.square / static_cast<double>(pairs)), 0.01},
                      {"mean step across borders of cells beyond that elsewhere, times eight",
                       beyond(found.across_cells), 0.004},
                      {"the same across borders of tiles", beyond(found.across_tiles), 0.004},
                      {"FLIP with eight times the contrast, mean", visible, 0.054}},
          .field = std::move(field)};
}

Outcome seams_of_floor(const Lab& lab) {
  const Camera camera = wide_camera({0.03, -2.2, 1.1}, {0.01, 0.4, 0}, 0.5F);
  return seams(lab,
               {panel({-3, -3, 0}, {6, 0, 0}, {0, 6, 0}, glm::vec3(0.5F)),
                panel({-3, 3, 0}, {6, 0, 0}, {0, 0, 2}, {0.8F, 0.1F, 0.1F})},
               camera);
}

Outcome seams_of_room(const Lab& lab) {
  const Camera camera = wide_camera({0.03, -2.9, 1.02}, {0.01, 0, 1}, 0.7F);
  return seams(lab,
               {panel({-2, -1, 0}, {4, 0, 0}, {0, 2, 0}, glm::vec3(0.5F)),
                panel({-2, 1, 0}, {4, 0, 0}, {0, 0, 2}, glm::vec3(0.6F)),
                panel({-2, -1, 0}, {0, 2, 0}, {0, 0, 2}, {0.8F, 0.1F, 0.1F}),
                panel({2, 1, 0}, {0, -2, 0}, {0, 0, 2}, {0.1F, 0.8F, 0.1F}),
                panel({-2, 1, 2}, {4, 0, 0}, {0, -2, 0}, glm::vec3(0.7F))},
               camera);
}

constexpr std::array kSeamRows = std::to_array<Row>({
    {"29", "floor before a wall, contrast times eight", "seams", seams_of_floor},
    {"29", "room with one side open, contrast times eight", "seams", seams_of_room},
});

}  // namespace

std::span<const Row> rows_of_seams() {
  return kSeamRows;
}

}  // namespace ptc::bench
