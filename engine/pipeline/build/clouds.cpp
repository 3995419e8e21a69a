#include "engine/pipeline/build/clouds.h"

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "engine/io/cloud/las_vlrs.h"
#include "engine/io/file/url.h"
#include "engine/pipeline/build/placed_points.h"
#include "engine/pipeline/build/unknown_values.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/pipeline/scene_record.h"

namespace ptc {
namespace {

// Bytes of the records of a LAS file, which share the meta page with all that a container records.
constexpr std::size_t kMaxContainerRecords = std::size_t{1} << 14;

/// Drops every second position of a sample that is twice as large as the sort needs.
/// @param step  of how many points one is in the sample; doubles with it, so that the points of all
///              files have the same share
void thin(std::vector<glm::dvec3>& sample, std::uint64_t& step) {
  if (sample.size() < 2 * kSampleKeys) return;
  for (std::size_t i = 0; i < sample.size() / 2; ++i) sample[i] = sample[2 * i];
  sample.resize(sample.size() / 2);
  step *= 2;
}

}  // namespace

void Clouds::measure(const std::filesystem::path& path, const std::optional<Placement>& place,
                     const Selection& selection, BoundsFrom from, bool alone, Progress& progress) {
  PointFile file = open_placed_points(path, selection, place);
  // Note what the file says of all its points, once
  const std::string name = file_name(path);
  if (from == BoundsFrom::files) {
    for (const std::string& note : file.info.notes) progress.note(name + ": " + note);
  }
  if (const auto lights = file.info.text.find(kLightsKey); lights != file.info.text.end()) {
    const auto first = text.find(kLightsKey);
    lights_differ |= first != text.end() && first->second != lights->second;
  }
  join_texts(text, named_by, file.info.text, name, progress);
  unlit |= !file.info.has_radiance;
  const bool contained = is_container(path);
  has_container |= contained;
  coloured |= file.info.has_albedo;
  Cloud& cloud = files.emplace_back(Cloud{.path = path, .place = place});
  note_scan(file.info, cloud);
  cloud.channels = std::move(file.info.channels);
  // Take what it says of their place, or read them
  const bool place_suffices = from == BoundsFrom::files && alone && file.info.count &&
                              !file.info.has_normals && !file.info.has_radius &&
                              !file.info.has_emission;
  if (auto told = place_suffices ? file.source->extent() : std::nullopt) {
    cloud.said = told->bounds;
    cloud.points = *file.info.count;
    bounds.add(told->bounds);
    sample = std::move(told->sample);
  } else {
    read_points(file, alone, cloud, progress);
  }
  points += cloud.points;
  has_lit_container |= contained && file.info.has_radiance && cloud.points > 0;
}

void Clouds::shorten_records(Progress& progress) {
  const auto records = text.find(kLasRecordsKey);
  if (records == text.end()) return;
  ShortVlrs shorter = shorten_vlrs(records->second, kMaxContainerRecords,
                                   "a container keeps only 16 KiB of records");
  const std::string& name = named_by.at(kLasRecordsKey);
  for (const std::string& note : shorter.notes) progress.note(name + ": " + note);
  las_records = std::exchange(records->second, std::move(shorter.text));
  if (records->second.empty()) text.erase(records);
}

/// Reads the points of a cloud and notes what they need.
void Clouds::read_points(PointFile& file, bool alone, Cloud& cloud, Progress& progress) {
  ValueWatch watch(alone ? std::span<const Channel>() : cloud.channels);
  bool lacks_normals = false, lacks_radii = true;
  std::vector<Surfel> block(kSurfelBlock);
  while (const std::size_t count = file.source->next(block)) {
    for (std::size_t i = 0; i < count; ++i) {
      bounds.add(block[i].position);
      lacks_normals |= block[i].normal == glm::vec3(0);
      lacks_radii = lacks_radii && block[i].radius == 0;
    }
    emits |= std::any_of(block.begin(), block.begin() + static_cast<std::ptrdiff_t>(count),
                         [](const Surfel& s) { return s.emission != glm::vec3(0); });
    for (std::size_t i = 0; i < count; ++i) {
      if ((cloud.points + i) % sample_step == 0) sample.push_back(block[i].position);
    }
    thin(sample, sample_step);
    watch.add(file.source->attributes());
    cloud.points += count;
    progress.advance(count);
  }
  cloud.taken = watch.taken();
  if ((lacks_normals || (lacks_radii && cloud.points > 0)) && !scan) scan.emplace().radii = false;
  if (scan && cloud.points > 0)
    scan->radii |= lacks_radii;  // formats that must have radii have zeros
  if (const std::uint64_t lost = file.source->left_out()) {
    progress.note(
        fmt::format("{}: {} records name no place and are left out", file_name(cloud.path), lost));
  }
}

/// Notes what of the points of a cloud must be estimated, and where its scanners stood.
void Clouds::note_scan(const PointFileInfo& info, Cloud& cloud) {
  if (!info.has_normals || !info.has_radius) {
    if (!scan) scan.emplace().radii = false;
    scan->radii |= !info.has_radius;
  }
  if (info.scanners.empty()) return;
  cloud.first_scanner = static_cast<std::uint32_t>(scanners.size());
  scanners.insert(scanners.end(), info.scanners.begin(), info.scanners.end());
  if (const auto found = find_in_row(info.channels, "scan")) {
    cloud.scanner_offset = found->offset;
    cloud.scanner_bytes = std::min(found->channel->component_bytes(), sizeof(std::uint32_t));
  }
}

}  // namespace ptc
