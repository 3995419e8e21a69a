#include "tools/bench/stability/panel_pictures.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/render/render_picture.h"
#include "tools/bench/shapes/meshes.h"

namespace ptc::bench {
namespace {

constexpr unsigned kSamplesAlong = 2;  // samples along the side of a pixel, as RenderRequest has it

/// Returns a mesh that emits what the panels shine, and reflects nothing.
std::shared_ptr<const Mesh> shining_mesh(std::span<const Panel> panels) {
  auto mesh = std::make_shared<Mesh>(mesh_of(panels));
  mesh->materials.clear();
  for (std::size_t i = 0; i < panels.size(); ++i) {
    mesh->materials.push_back({.albedo = glm::vec3(0), .emission = panels[i].radiance});
    mesh->material_of[2 * i] = mesh->material_of[2 * i + 1] = static_cast<std::uint16_t>(i);
  }
  return mesh;
}

}  // namespace

Mesh mesh_of(std::span<const Panel> panels) {
  Mesh mesh = empty_mesh();
  mesh.materials[0].albedo = glm::vec3(1);
  for (const Panel& panel : panels) {
    const auto& c = panel.corners;
    add_quad(mesh, glm::vec3(c[0]), glm::vec3(c[1] - c[0]), glm::vec3(c[3] - c[0]));
  }
  return mesh;
}

PanelPictures::PanelPictures(const Lab& lab, std::vector<Panel> panels, double spacing,
                             const glm::vec3& sky)
    : lab_(lab),
      panels_(std::move(panels)),
      spacing_(spacing),
      sky_(sky),
      mesh_(std::make_shared<const Mesh>(mesh_of(panels_))),
      rays_(*mesh_),
      scene_(lab.work, ".pictures.ptcx") {
  BuildRequest request{.mesh = shining_mesh(panels_), .lights = LightRig{}};
  request.sampling.spacing = spacing;
  request.sampling.lights = {.sun_rays = 1, .area_rays = 1, .sky_rays = 1};  // nothing reflects
  request.run.threads = lab.executor.threads();
  Progress silent;
  build_container(request, scene_.path(), silent);
}

std::vector<glm::vec3> PanelPictures::render(const Camera& camera) const {
  const WorkFile file(lab_.work, ".picture.exr");
  RenderRequest request;
  request.scene = scene_.path();
  request.mesh = mesh_;
  request.camera = camera;
  request.lights = LightRig{.sky = {.radiance = sky_}};
  request.run.threads = lab_.executor.threads();
  const std::array targets{PictureTarget{.path = file.path()}};
  Progress silent;
  render_picture(request, targets, silent);
  return read_image(file.path()).pixels;
}

TruePicture PanelPictures::truth(const Camera& camera) const {
  return true_picture(lab_, rays_, panels_, camera, sky_, spacing_);
}

TruePicture true_picture(const Lab& lab, const RayScene& rays, std::span<const Panel> panels,
                         const Camera& camera, const glm::vec3& sky, double spacing) {
  const std::size_t pixels = std::size_t{camera.width} * camera.height;
  TruePicture picture{.light = std::vector(pixels, glm::vec3(0)),
                      .clearance = std::vector(pixels, std::numeric_limits<double>::infinity()),
                      .panel = std::vector(pixels, -1),
                      .place = std::vector(pixels, glm::dvec3(0))};
  lab.executor.for_each(pixels, [&](std::size_t pixel, unsigned) {
    for (unsigned sample = 0; sample < kSamplesAlong * kSamplesAlong; ++sample) {
      const auto at = [&](std::size_t index, unsigned shift) {
        return static_cast<float>(index) + (static_cast<float>(shift) + 0.5F) / kSamplesAlong;
      };
      const glm::vec3 direction =
          camera.direction(at(pixel % camera.width, sample % kSamplesAlong),
                           at(pixel / camera.width, sample / kSamplesAlong));
      const auto hit =
          rays.closest(camera.position, direction, 0, std::numeric_limits<double>::infinity());
      const int seen = hit ? static_cast<int>(hit->triangle / 2) : -1;
      picture.panel[pixel] = sample == 0 || picture.panel[pixel] == seen ? seen : -1;
      if (!hit) {
        picture.light[pixel] += sky;
        continue;
      }
      picture.place[pixel] = hit->position;
      const Receiver receiver{hit->position, hit->geometric_normal};
      picture.light[pixel] += brightness(light_of_panels(receiver, panels, sky));
      picture.clearance[pixel] =
          std::min(picture.clearance[pixel], distance_to_walls(receiver, panels) / spacing);
    }
    picture.light[pixel] /= static_cast<float>(kSamplesAlong * kSamplesAlong);
  });
  return picture;
}

}  // namespace ptc::bench
