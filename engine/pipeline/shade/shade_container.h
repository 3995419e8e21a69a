// Shades points: the entry point of the library that gathers the light of a container's surfels.
//
//   scene.ptcx --------- surfels that occlude and emit ---.
//                                                         +--> shade_container() --> target
//   scene, other.ptcx or cloud --- receivers -------------'              .ptcx, .las, .ply ...
//
//   ptc::ShadeRequest request;
//   request.scene = "dragon.ptcx";
//   request.error = 0.05;  // chooses the cheapest settings that meet a relative error of 5 %
//   ptc::Progress silent;
//   const ptc::LightingReport report = ptc::shade_container(request, "shaded.ptcx", silent);
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "engine/base/progress.h"
#include "engine/pipeline/light/lighting.h"
#include "engine/scene/light/lights.h"

namespace ptc {

/// Points to shade. LightingRequest has the scene, the quality and the resources.
struct ShadeRequest : LightingRequest {
  /// Cloud or container whose points are shaded; empty: the points of the scene itself. A cloud is
  /// sorted into a temporary container first, so that its points leave in Z-order.
  std::filesystem::path receivers;
  /// Number of points to shade, evenly spread over all in their order; 0: all points. Fewer than
  /// all need a .ply as target.
  std::uint64_t count = 0;
  /// Writes a file of points in the order of the input, which the scene must know. A scene of
  /// clouds is always written in their order.
  bool original_order = false;
  /// The channel that viewers shall show as colour in a file of points; empty: the albedo
  /// (PointWriteInfo::colour_from).
  std::string colour_from;
  /// Keeps the light of each group of lights apart, in a channel for each: `count` and `sky` keep
  /// their defaults then, as do `error`, `estimate`, `glossy`, `shadows`, `check` and
  /// `tolerate_damage`.
  bool light_groups = false;
  /// Place from which mirrors are looked at, scene units; empty: that of the camera of a picture of
  /// the scene.
  std::optional<glm::dvec3> eye;
  /// Sky that lights the receivers; empty: the sky that the scene was built with.
  std::optional<Sky> sky;
};

/// Shades every receiver and writes the results to `target`, whose ending chooses the format.
///
///   channel            components
///   occlusion          1   cosine-weighted share of the hemisphere that is covered, 0 to 1
///   bent_normal        3   unit mean of the uncovered directions; the normal when none is
///   irradiance         3   from surfaces, W / m^2; to receivers of a file from suns and lamps, too
///   sky                3   irradiance from the uncovered sky, W / m^2
///   indirect           3   albedo / pi * (irradiance + sky): the radiance that leaves
///   occlusion_error    1   estimated error, only with LightingRequest::estimate
///   irradiance_error   1   estimated error, W / m^2, only with LightingRequest::estimate
///   reflection         3   only with LightingRequest::glossy, W / (m^2 sr)
///   reflection_occlusion 1  only with LightingRequest::glossy, 0 to 1
///   shadow_NAME        1   only with LightingRequest::shadows: share of a group's light that is
///                          hidden, 0 to 1
///   light_NAME         3   only with `light_groups`: all radiance of a point that is due to a
///                          group, W / (m^2 sr)
///
/// A .ptcx is a copy of the receivers' container with these channels, stored as halves; channels of
/// an earlier shading are replaced. A file of points, such as a .las or .ply, has the points with
/// all their channels and these. With `tolerate_damage` the scene's own points can only go to a
/// file of points.
///
/// A scene of clouds and meshes is built first, into a temporary container.
/// @param progress  gets the stages, and notes about the scene's record
/// @return          what the run did, cost and, if asked for, how exact it was
/// @throws RequestError when the request contradicts itself or a setting is out of range;
///         LimitError when the memory cap is too small: the text names the least that works;
///         DataError, FormatError for damaged input, and for a container whose pages have no room
///         for the record of the shading; std::system_error. A run that throws leaves
///         the target as it was, unless it throws in the check, which comes last
/// Memory: at most RunOptions::memory_bytes.
LightingReport shade_container(const ShadeRequest& request, const std::filesystem::path& target,
                               Progress& progress);

}  // namespace ptc
