// The record of a scene on the meta page of its container: its keys, and typed access to its
// values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include <glm/vec3.hpp>

#include "engine/base/progress.h"
#include "engine/pipeline/run.h"
#include "engine/scene/light/lights.h"
#include "engine/store/reader.h"

namespace ptc {

inline constexpr const char* kLightsKey = "lights";      ///< to_json() of the LightRig
inline constexpr const char* kEmittersKey = "emitters";  ///< "baked": emitters lit the surfels
/// "gathered": the radiance of the surfels leaves out the light of the sky.
inline constexpr const char* kSkyLightKey = "sky_light";
inline constexpr const char* kCameraKey = "camera";      ///< to_json() of the Camera
inline constexpr const char* kSpacingKey = "spacing";    ///< between surfels on meshes, scene units
inline constexpr const char* kInputsKey = "inputs";      ///< file names, separated by spaces
inline constexpr const char* kRoundingKey = "rounding";  ///< rounding_text() of the points
inline constexpr const char* kUpKey = "up";              ///< x, y or z; y when it is absent
inline constexpr const char* kAlbedoKey = "albedo";      ///< kAssumed when no input has colours
inline constexpr const char* kAssumed = "assumed";
inline constexpr const char* kCrsKey = "crs";                  ///< of positions, as WKT or EPSG:n
inline constexpr const char* kViewpointKey = "pcd.viewpoint";  ///< of the one PCD of all inputs
inline constexpr const char* kUnitKey = "metres_per_unit";     ///< a decimal number

/// Adds texts to those of other points. What is there already stays; unit and reference system are
/// taken from one file, never from two.
/// @param text      of the points so far
/// @param named_by  by key of `text`: whose it is, for a note; the scene's where it is missing
/// @param added     those that are added, by `other`
/// @param progress  gets a note where positions mean something else in both
void join_texts(std::map<std::string, std::string>& text,
                std::map<std::string, std::string>& named_by,
                const std::map<std::string, std::string>& added, const std::string& other,
                Progress& progress);

/// Says whether the colours of points, by the texts of their container, come from an input.
[[nodiscard]] bool has_colours(const std::map<std::string, std::string>& text);

/// Returns the unit vector along the axis that points up, by the texts of a container or of a file
/// of points: +y when they do not name it.
[[nodiscard]] glm::vec3 up_of(const std::map<std::string, std::string>& text);

/// Returns the lights that a container was built with, without the picture of their sky; no lights
/// when the container records none.
/// @throws DataError when the record is no light rig
[[nodiscard]] LightRig recorded_rig(const ContainerReader& container);

/// Returns the lights that a container was built with, and loads the picture of their sky; no
/// lights when the container records none.
/// @param run       into whose texture_cap() the picture is read
/// @param target    as for roomiest_temp_dir()
/// @param progress  gets a note when the picture is no longer the one that was recorded
/// @throws DataError when the record is no light rig, or names a picture that does not exist or is
///         damaged; std::system_error
[[nodiscard]] LightRig recorded_lights(const ContainerReader& container, const RunOptions& run,
                                       const std::filesystem::path& target, Progress& progress);

/// Returns the text that records a rig. The path of its sky picture is made absolute.
/// @throws RequestError when the sky has a picture and no path
[[nodiscard]] std::string lights_record(LightRig rig);

/// Checks that pages of 2^page_shift bytes exist in the format.
/// @throws RequestError when page_shift is not 12 to 20
void check_page_shift(std::uint8_t page_shift);

/// Checks that a meta page has room for the texts and channels of a record.
/// @param page_shift   logarithm to the base 2 of the bytes of a page
/// @param point_bytes  FileHeader::point_bytes
/// @param reserve     bytes that texts which are not yet in the record may add to it
/// @throws RequestError when page_shift is not 12 to 20, or they take more than a page
void check_meta(const Meta& meta, std::uint8_t page_shift, std::uint8_t point_bytes,
                std::size_t reserve = 0);

/// Returns true when emissive triangles lit the surfels, so that the radiance of the surfels around
/// an emitter includes the light that it gave them.
[[nodiscard]] bool lit_by_emitters(const ContainerReader& container);

/// Says whether the points of a container have room for what they emit.
[[nodiscard]] bool may_emit(const ContainerReader& container);

/// Returns true when the radiance of the surfels leaves out the light of the sky, so that a picture
/// of them adds what the gather finds of it.
[[nodiscard]] bool sky_is_gathered(const ContainerReader& container);

/// Returns the distance between neighbouring surfels in scene units: the recorded one or, without a
/// record, the square root of area over points; 0 for a container without points.
[[nodiscard]] double surfel_spacing(const ContainerReader& container);
/// Returns the radius of surfels that lie so far apart, scene units.
[[nodiscard]] float surfel_radius(const ContainerReader& container);

}  // namespace ptc
