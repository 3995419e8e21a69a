// A container that lives as long as one run.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>

#include "engine/store/reader.h"

namespace ptc {

/// Writes a container, opens it and removes its name at once: however the run ends from then on,
/// nothing is left on the disk.
/// @param write  writes the container to the path that it is given, or throws and leaves nothing
[[nodiscard]] std::unique_ptr<ContainerReader> make_temporary_container(
    const std::filesystem::path& directory,
    const std::function<void(const std::filesystem::path&)>& write);

}  // namespace ptc
