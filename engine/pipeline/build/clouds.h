// The clouds among the inputs of a build, measured in a first pass over them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/progress.h"
#include "engine/io/cloud/points.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/scan/scan.h"

namespace ptc {

inline constexpr std::size_t kSurfelBlock = 1 << 14;  ///< surfels read from a source at once
inline constexpr std::size_t kSampleKeys = 1 << 16;   ///< positions that the sort's splitters need

/// Where the bounds of clouds come from. Those that a file says of itself save a pass over it; a
/// build that begins again because they were wrong takes those of the points.
enum class BoundsFrom { files, points };

/// The clouds of a request, checked and measured in a first pass.
struct Clouds {
  struct Cloud {
    std::filesystem::path path;
    std::optional<Placement> place;  ///< none: the points stay where they are
    std::uint64_t points = 0;
    std::vector<Channel> channels;                ///< in the order of its rows
    std::vector<bool> taken;                      ///< as for AttributePlan::add_input()
    std::size_t input = AttributePlan::kNoInput;  ///< its number in the plan of the channels
    std::uint32_t first_scanner = kNoScanner;     ///< the number of the first of its scanners
    /// Where the number of its scanner lies in the row of a point, and its bytes; 0 bytes when all
    /// points are of the first.
    std::size_t scanner_offset = 0, scanner_bytes = 0;
    std::optional<Bounds> said;  ///< the box of PointSource::extent(), if the points were not read
  };
  std::vector<Cloud> files;
  Bounds bounds;                   ///< of all points, scene units
  std::vector<glm::dvec3> sample;  ///< positions of an even share of the points, scene units
  std::uint64_t sample_step = 1;   ///< of how many points one is in the sample
  std::uint64_t points = 0;        ///< in all files
  /// How the points are completed, without the resources; empty when all have normals and radii.
  std::optional<ScanOptions> scan;
  bool unlit = false;                ///< one of the files gives no radiance
  bool has_container = false;        ///< one of the files is a container
  bool has_lit_container = false;    ///< one of the files is a container whose points have light
  bool lights_differ = false;        ///< the files record different lights; the first ones count
  bool coloured = false;             ///< one of the files gives colours
  bool emits = false;                ///< a point emits light
  std::vector<glm::dvec3> scanners;  ///< of all files, scene units
  /// Facts about the files under the keys of spec/points.md#texts, by join_texts(). Of the records
  /// of a LAS file there are as many as a container keeps.
  std::map<std::string, std::string> text;
  std::map<std::string, std::string> named_by;  ///< by key of `text`: the file that it is of
  std::string las_records;  ///< all records of the LAS file, once shorten_records() has run

  /// Adds a cloud to the others, in a place. Reads it to its end, unless all that is asked stands
  /// in front of its points.
  /// @param alone  whether all points of the build are of this cloud, whose values need no watch
  /// @throws DataError when the file breaks its format; RequestError, FormatError as
  ///         open_point_input()
  void measure(const std::filesystem::path& path, const std::optional<Placement>& place,
               const Selection& selection, BoundsFrom from, bool alone, Progress& progress);

  /// Moves the records of a LAS file to `las_records`, and shortens them in `text` to what a
  /// container keeps.
  /// @param progress  gets a note about each kind of records that is left out
  void shorten_records(Progress& progress);

 private:
  void read_points(PointFile& file, bool alone, Cloud& cloud, Progress& progress);
  void note_scan(const PointFileInfo& info, Cloud& cloud);
};

}  // namespace ptc
