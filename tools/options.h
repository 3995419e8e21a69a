// Options that several programs take.
#pragma once

#include <cstdint>
#include <optional>

#include <CLI/CLI.hpp>

#include "engine/ptc.h"

namespace ptc {

/// --points
CLI::Option* add_points(CLI::App& app, std::uint64_t& count);
/// --profile raw|exact|fast|compact
CLI::Option* add_profile(CLI::App& app, Profile& profile);
/// --page-size, a power of two from 4K to 1M
CLI::Option* add_page_size(CLI::App& app, std::uint8_t& page_shift);
/// --io pread|mmap|direct|io_uring
CLI::Option* add_back_end(CLI::App& app, BackEnd& back_end);

/// --bounces
CLI::Option* add_bounces(CLI::App& app, unsigned& bounces);

/// --solid-angle, --parallax, --inflation, --resolution, --sides, --lift
void add_gather_options(CLI::App& app, GatherOptions& gather, float& lift);

/// --error, which stands for all expert settings of the gather that trade time for error
void add_error_option(CLI::App& app, std::optional<double>& error);

/// --estimate
void add_estimate_option(CLI::App& app, bool& estimate);

/// --tolerate-damage
void add_tolerate_damage(CLI::App& app, bool& tolerate);

/// --check and --check-rays
void add_check_options(CLI::App& app, CheckRequest& check);

}  // namespace ptc
