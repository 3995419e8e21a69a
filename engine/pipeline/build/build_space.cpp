#include "engine/pipeline/build/build_space.h"

#include <cerrno>
#include <system_error>

#include <fmt/format.h>

#include "engine/io/file/disk_space.h"
#include "engine/io/file/file.h"

namespace ptc {
namespace {

/// Bytes that a point takes in a container.
struct PointBytes {
  double least;  ///< less than a point took in any scene that was measured, nodes not counted
  double usual;  ///< bytes of a point in the city, its share of the nodes included
};

PointBytes point_bytes(Profile profile) noexcept {
  switch (profile) {
    case Profile::raw:
      return {34, 46};
    case Profile::exact:
      return {10, 18};
    case Profile::fast:
      return {6, 17};
    case Profile::compact:
      return {5, 13};
  }
  return {};
}

}  // namespace

BuildSpace require_build_space(std::uint64_t points, std::uint64_t temp_bytes, Profile profile,
                               std::span<const std::filesystem::path> temp_dirs,
                               const std::filesystem::path& target) {
  if (points == 0) return {};
  const PointBytes bytes = point_bytes(profile);
  const std::filesystem::path directory = directory_of(target);
  const auto all = [points](double each) {
    return static_cast<std::uint64_t>(each * static_cast<double>(points));
  };
  const BuildSpace space{temp_bytes, free_bytes(temp_dirs), all(bytes.usual),
                         free_bytes({&directory, 1})};
  if (all(bytes.least) > space.output_free_bytes) {
    throw std::system_error(ENOSPC, std::generic_category(),
                            fmt::format("some {} points take about {} in {}, which has {} free",
                                        points, amount_text(space.output_bytes), directory.string(),
                                        amount_text(space.output_free_bytes)));
  }
  return space;
}

std::string space_text(const BuildSpace& space, std::span<const std::filesystem::path> temp_dirs,
                       const std::filesystem::path& target) {
  return fmt::format("{} of temporary files in {}, {} free; about {} for {}, {} free",
                     amount_text(space.temp_bytes), names_text(temp_dirs),
                     amount_text(space.temp_free_bytes), amount_text(space.output_bytes),
                     target.string(), amount_text(space.output_free_bytes));
}

}  // namespace ptc
