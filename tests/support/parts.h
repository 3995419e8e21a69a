// Scenes of parts for tests: a container that is cut into several files.
#pragma once

#include <filesystem>

#include "engine/store/reader.h"

namespace ptc::test {

/// Cuts a container without channels into parts of about as many points each, and writes the scene
/// of these parts, which has the same tree.
/// @param target  the scene; the parts lie in the folder "parts" next to it
/// @param count   number of parts, at least 2 and at most as many as there are leaves
void write_parts(const ContainerReader& whole, unsigned count, const std::filesystem::path& target);

}  // namespace ptc::test
