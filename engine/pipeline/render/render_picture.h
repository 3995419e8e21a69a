// Renders pictures: the entry point of the library that lights what a camera sees.
//
//   mesh, or the surfels --- primary visibility ---> receivers ---.
//                                                                 +--> layers --> .exr and .png
//   scene.ptcx ------------- surfels that occlude and emit -------'
//
//   ptc::RenderRequest request;
//   request.scene = "dragon.ptcx";
//   request.meshes = {"dragon.obj"};
//   ptc::Progress silent;
//   const ptc::PictureTarget targets[] = {{.path = "dragon.exr"}, {.path = "dragon.png"}};
//   const ptc::LightingReport report = ptc::render_picture(request, targets, silent);
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/io/mesh/mesh.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/pipeline/render/picture_files.h"
#include "engine/pipeline/render/shots.h"
#include "engine/pipeline/render/texture_view.h"
#include "engine/scene/camera.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// A picture to render. LightingRequest has the scene, the quality and the resources.
///
/// The camera sees `meshes` and `mesh` together or, without triangles there, the surfels of the
/// scene; also where the triangles do not fit under the memory cap. Either way the surfels light
/// what it sees. Of a scene of meshes alone, for which a container is built for the run, the camera
/// sees the meshes.
struct RenderRequest : LightingRequest {
  /// Mesh files that the camera sees; clouds among them are skipped.
  std::vector<std::filesystem::path> meshes;
  /// A mesh in memory, seen together with those of `meshes`; null: none.
  std::shared_ptr<const Mesh> mesh;
  bool backdrop = false;   ///< sets the meshes on a ground in front of a red wall
  bool one_sided = false;  ///< only fronts reflect in mesh formats that know no sides
  /// Camera of the picture; empty: the first one of `camera_files` or, without that, the one that
  /// the scene was built with or, without that, the first one of the mesh files or, without that,
  /// one that sees everything. A backdrop may then leave the picture; what stands on it does not.
  std::optional<Camera> camera;
  /// Mesh and scene files whose cameras may be taken.
  std::vector<std::filesystem::path> camera_files;
  /// Name of the camera of `camera_files` or of the mesh files that is taken; empty: as `camera`
  /// says.
  std::string camera_name;
  /// Renders the frames of a sequence in place of one picture. In the name of each target a mark
  /// stands for the number of the frame (frame_name()). The exposure of the first one serves all.
  std::optional<SequenceRequest> sequence;
  /// Width and height of the picture in pixels; empty: those of the camera.
  std::optional<std::array<unsigned, 2>> size;
  /// The part of the picture that is rendered: its first column and row, and those behind the last,
  /// from the upper left corner; empty: all. An .exr keeps its place, a .png is that small.
  std::optional<std::array<unsigned, 4>> crop;
  unsigned samples = 4;  ///< samples of each pixel, a square number
  /// Lights of the meshes and of the sky; empty: those that the scene was built with.
  std::optional<LightRig> lights;
  /// Shadow rays of each sample at a mesh. Its emitters are asked where they lit the surfels, too;
  /// else the gather brings their light, and no ray is cast at them.
  LightSampling light_sampling{.sun_rays = 4, .area_rays = 16, .sky_rays = 0};
  /// Bakes a texture of the meshes, which must have texture coordinates, in place of a picture:
  /// each texel is what its place on the surface looks like along the normal. `camera` is empty
  /// then, `size` is 1024 x 1024 when it is empty, and `light_groups` is refused. Names of targets
  /// may hold kTileMark: they stand for a file for each tile of the texture coordinates.
  std::optional<TextureTarget> texture;
  /// Bakes the vertices of the meshes in place of a picture: each is what the surface around it
  /// looks like along its normal. Targets are .ply and .glb (VertexFiles); `size` is empty.
  /// `texture`, a sequence and `light_groups` are refused.
  bool vertices = false;
  /// Keeps the light of each group of lights apart, in a layer for each of an .exr. The scene is
  /// lit and rendered once for each; `error`, `estimate`, `glossy`, `shadows`, `check` and
  /// `tolerate_damage` keep their defaults then.
  bool light_groups = false;
  /// Stops by which a .png of light is brightened; empty: chosen so that the picture is well seen
  /// (spec/shading.md#display).
  std::optional<float> exposure;

  /// Says whether a mesh is baked in place of a picture.
  [[nodiscard]] bool bakes() const noexcept { return texture || vertices; }
};

/// Renders a picture and writes it to one or more files.
///
///   layer              components
///   (RGB)              3   beauty = direct + indirect; pixels that meet nothing show the sky
///   direct             3   emission + albedo / pi * (irradiance from lights + sky)
///   indirect           3   albedo / pi * irradiance from surfaces
///   occlusion          1   cosine-weighted share of the hemisphere that is covered, 0 to 1
///   bent_normal        3   mean of the uncovered directions
///   albedo             3   reflected share of the light, 0 to 1
///   A                  1   share of the samples that meet a surface
///   Z                  1   depth along the view, scene units; kNoDepth where no surface is seen
///   P                  3   position of the surface, scene units
///   N                  3   shading normal, unit, turned towards the camera
///   object_id          1   number of the object (SurfaceIds); 0 where no surface is seen
///   material_id        1   number of the material
///   occlusion_error    1   only with LightingRequest::estimate
///   irradiance_error   1   only with LightingRequest::estimate, W / m^2
///   reflection         3   only with LightingRequest::glossy, W / (m^2 sr)
///   reflection_occlusion 1  only with LightingRequest::glossy, 0 to 1
///   irradiance         3   only of what is baked: from lights, sky and surfaces, W / m^2
///   shadow_NAME        1   only with LightingRequest::shadows: share of a group's light that is
///                          hidden, 0 to 1; 0 where no surface is seen
///   light_NAME         3   only with `light_groups`: the beauty that is due to a group; the sum of
///                          all is the beauty
///
/// An .exr gets all layers, a .png one of them, and a .ply or .glb of vertices what VertexFiles
/// says. Each layer is the mean over the samples of a pixel, except that `A` of a texture leaves
/// out its margin, and that the layers of estimates are root mean squares, which are upper bounds
/// on the error of that mean. Z, P and N are those of the nearest sample; the numbers are those of
/// most samples that meet a surface (IdVotes). What is baked has no Z, P and N, surfels and
/// vertices have no numbers. Each file is published whole or not at all.
/// @param targets   one or more files, all from one rendering, or for each frame of a sequence
/// @param progress  gets the stages, and notes about the meshes and the scene's record
/// @return          what the run did, cost and, if asked for, how exact it was
/// @throws RequestError when the request contradicts itself or a setting is out of range;
///         LimitError when the memory cap is too small: the text names the least that works;
///         DataError, FormatError for damaged input; std::system_error
/// Memory: at most RunOptions::memory_bytes.
LightingReport render_picture(const RenderRequest& request, std::span<const PictureTarget> targets,
                              Progress& progress);

}  // namespace ptc
