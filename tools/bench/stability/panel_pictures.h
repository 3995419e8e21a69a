// Pictures of scenes of panels by render_picture(), beside the light that the panels truly give.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/scene/camera.h"
#include "engine/scene/ray_scene.h"
#include "tools/bench/scenes/work_file.h"
#include "tools/bench/stability/lab.h"
#include "tools/bench/stability/panels.h"

namespace ptc::bench {

/// What a picture would show without any error.
struct TruePicture {
  std::vector<glm::vec3> light;  ///< as brightness(), of a white sky where nothing is seen
  /// Distance of the nearest wall over a sample of the pixel, distance_to_walls(), spacings.
  std::vector<double> clearance;
  /// The panel that all samples of a pixel see; -1 where they see several, or the sky.
  std::vector<int> panel;
  std::vector<glm::dvec3> place;  ///< that the last sample of the pixel sees, scene units
};

/// A scene of panels as the programs build and render it: its surfels are those of a mesh that
/// emits what the panels shine, and its camera sees the same mesh in white.
class PanelPictures {
 public:
  /// @param panels   parallelograms
  /// @param spacing  of the surfels, scene units
  /// @param sky      radiance of the sky, W / (m^2 sr)
  PanelPictures(const Lab& lab, std::vector<Panel> panels, double spacing, const glm::vec3& sky);

  /// Renders a picture with the settings that ptcrender has by default.
  [[nodiscard]] std::vector<glm::vec3> render(const Camera& camera) const;
  /// Computes the same picture from light_of_panels() at the same samples.
  [[nodiscard]] TruePicture truth(const Camera& camera) const;
  /// The container of the surfels.
  [[nodiscard]] const std::filesystem::path& scene() const noexcept { return scene_.path(); }

 private:
  const Lab& lab_;
  std::vector<Panel> panels_;
  double spacing_;
  glm::vec3 sky_;
  std::shared_ptr<const Mesh> mesh_;
  RayScene rays_;
  WorkFile scene_;
};

/// Returns a mesh of two triangles for each panel, all of one white material.
[[nodiscard]] Mesh mesh_of(std::span<const Panel> panels);

/// Computes what a camera sees of panels, with four samples a pixel.
/// @param rays  of mesh_of() the panels
[[nodiscard]] TruePicture true_picture(const Lab& lab, const RayScene& rays,
                                       std::span<const Panel> panels, const Camera& camera,
                                       const glm::vec3& sky, double spacing);

}  // namespace ptc::bench
