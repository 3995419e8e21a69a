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
/// Endings of clouds that can be read, for shells to propose.
[[nodiscard]] std::vector<std::string> cloud_endings();
/// Endings of meshes and clouds that can be read, for shells to propose.
[[nodiscard]] std::vector<std::string> input_endings();
/// Endings of files of points that can be written, containers not among them.
[[nodiscard]] std::vector<std::string> point_output_endings();

/// Declares --up, the axis of clouds that points up: x, y or z; empty when it is not given.
CLI::Option* add_up(CLI::App& app, std::string& axis);

/// Notes which of these options were given, though the input leaves them without effect.
/// @param because  the rest of the note: "--points has no effect, because no input is a mesh"
void note_unused(const CLI::App& app, const std::vector<std::string>& options,
                 const std::string& because, Progress& progress);

/// Declares --points COUNT, from 1.
CLI::Option* add_points(CLI::App& app, std::uint64_t& count);
/// Declares --original-order.
CLI::Option* add_original_order(CLI::App& app, bool& original_order,
                                const std::string& description);
/// Declares --colour-from CHANNEL.
CLI::Option* add_colour_from(CLI::App& app, std::string& channel);

/// Declares --bbox, --class, --every and --channels, which choose points and channels of clouds and
/// containers.
void add_selection(CLI::App& app, Selection& selection);
/// Declares --level N, which takes clusters of a container in place of its points.
CLI::Option* add_level(CLI::App& app, Selection& selection);

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

/// Declares --sphere, --cone, --distance and --falloff.
void add_surroundings(CLI::App& app, Surroundings& around);

/// Declares --shadow NAME, repeatable.
/// @param where  what receives the shadow: a channel or a layer
void add_shadows(CLI::App& app, std::vector<std::string>& shadows, const std::string& where);

/// Declares --glossy ROUGHNESS and --glossy-rays N.
/// @param where  what receives the reflection: a channel or a layer
void add_glossy(CLI::App& app, GlossyRequest& glossy, const std::string& where);

/// A name for settings that suit a kind of scene.
enum class Preset { none, scan, interior, film };
/// Declares --preset scan|interior|film.
void add_preset(CLI::App& app, Preset& preset);
/// Sets what a preset stands for, except where an option says otherwise. @pre the app is parsed
void apply_preset(const CLI::App& app, Preset preset, LightingRequest& request);

/// Declares an option that takes a percentage or a number above 0 and at most 1.
/// @param name   as "--error"; must outlive the app
/// @param share  is set by the option
CLI::Option* add_share(CLI::App& app, const char* name, std::optional<double>& share,
                       const std::string& help);

/// Declares --tolerance SHARE, what a container may be off by for fewer bytes.
CLI::Option* add_tolerance(CLI::App& app, std::optional<double>& tolerance);

/// Declares --error SHARE, which stands for the settings of the gather that trade time for error
/// and excludes them. @pre add_gather_options() was called
void add_error_option(CLI::App& app, std::optional<double>& error);

/// Declares --estimate.
void add_estimate_option(CLI::App& app, bool& estimate);

/// Declares --tolerate-damage.
void add_tolerate_damage(CLI::App& app, bool& tolerate);
/// Adds --light-groups.
/// @param where  what each group gets: a channel or a layer
void add_light_groups(CLI::App& app, bool& groups, const std::string& where);

/// Declares --check N and --check-rays N.
void add_check_options(CLI::App& app, CheckRequest& check);

/// Declares what decides how exact a run is, and what is told of it: the options of the gather,
/// --error, --check, --estimate and --tolerate-damage.
void add_quality_options(CLI::App& app, LightingRequest& request);

}  // namespace ptc
