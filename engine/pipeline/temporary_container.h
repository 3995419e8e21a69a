// A container that exists for the length of one run.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>

#include "engine/store/reader.h"

namespace ptc {

/// Returns a path for a temporary container, another one for each call, process and machine:
/// temporary_name() with the ending .ptcx.
[[nodiscard]] std::filesystem::path temporary_container_path(
    const std::filesystem::path& directory);

/// Writes a container, opens it and removes its name. Its space is freed when the reader is
/// destroyed, or when the process ends, however it ends.
/// @param directory  where the file lies
/// @param write      writes the container to the path that it is given, or throws and leaves
///                   nothing there
/// @throws FormatError, std::system_error, and whatever `write` throws
[[nodiscard]] std::unique_ptr<ContainerReader> make_temporary_container(
    const std::filesystem::path& directory,
    const std::function<void(const std::filesystem::path&)>& write);

}  // namespace ptc
