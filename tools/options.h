// Options that several programs take. Each function declares those in its comment and keeps a
// reference to the value, which parsing sets.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "engine/base/progress.h"
#include "engine/ptc.h"

namespace ptc {

/// Endings of meshes that can be read, for shells to propose.
[[nodiscard]] std::vector<std::string> mesh_endings();
/// Endings of meshes and clouds that can be read, for shells to propose.
[[nodiscard]] std::vector<std::string> input_endings();

/// Notes which of these options were given, though the input leaves them without effect.
/// @param because  the rest of the note: "--points has no effect, because no input is a mesh"
void note_unused(const CLI::App& app, const std::vector<std::string>& options,
                 const std::string& because, Progress& progress);

/// Declares --points COUNT, from 1.
CLI::Option* add_points(CLI::App& app, std::uint64_t& count);
/// Declares --profile raw|exact|fast|compact.
CLI::Option* add_profile(CLI::App& app, Profile& profile);
/// Declares --page-size SIZE, a power of two from 4K to 1M; `page_shift` is its logarithm.
CLI::Option* add_page_size(CLI::App& app, std::uint8_t& page_shift);
/// Declares --io pread|mmap|direct|io_uring.
CLI::Option* add_back_end(CLI::App& app, BackEnd& back_end);

/// Declares --bounces N, 0 to 1000.
CLI::Option* add_bounces(CLI::App& app, unsigned& bounces);

/// Declares --solid-angle, --parallax, --inflation, --resolution, --sides and --lift.
void add_gather_options(CLI::App& app, GatherOptions& gather, float& lift);

/// Declares --error SHARE, which stands for the settings of the gather that trade time for error
/// and excludes them. @pre add_gather_options() was called
void add_error_option(CLI::App& app, std::optional<double>& error);

/// Declares --estimate.
void add_estimate_option(CLI::App& app, bool& estimate);

/// Declares --tolerate-damage.
void add_tolerate_damage(CLI::App& app, bool& tolerate);

/// Declares --check N and --check-rays N.
void add_check_options(CLI::App& app, CheckRequest& check);

}  // namespace ptc
