// Small scenes and containers for tests.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "engine/base/surfel.h"
#include "tests/support/temporary_directory.h"
#include "tools/bench/shapes/surfels.h"

namespace ptc::test {

/// Returns all bytes of a file; none when the file does not exist.
[[nodiscard]] std::vector<char> bytes_of(const std::filesystem::path& path);

/// Returns the points of a container as surfels, in their order.
[[nodiscard]] std::vector<Surfel> points_of(const std::filesystem::path& path);

using bench::add_rectangle;
using bench::add_sphere;
using bench::random_surfels;
using bench::small_scene;
using bench::sort_scene;
using bench::SortedScene;
using bench::VectorStream;
using bench::write_scene;

/// Writes surfels with all of their numbers as a PLY. @param emits  whether emission is written
void write_ply(const std::filesystem::path& path, const std::vector<Surfel>& surfels, bool emits);

}  // namespace ptc::test
