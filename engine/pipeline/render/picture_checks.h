// Internal to render_picture(): what is checked before a picture is rendered.
#pragma once

#include <span>
#include <string>

#include "engine/pipeline/render/render_picture.h"

namespace ptc {

/// Returns the side of the grid on which the samples of a pixel lie.
/// @throws RequestError when `samples` is no square number
[[nodiscard]] unsigned side_of(unsigned samples);

/// Checks what can be checked before any file is read.
/// @throws RequestError
void check_request(const RenderRequest& request, std::span<const PictureTarget> targets);

/// Checks that every picture has a file of its own, which is none that the run reads.
/// @param sky_picture  the file of the sky; may be empty
/// @throws RequestError
void check_names(const RenderRequest& request, std::span<const PictureTarget> targets,
                 const std::string& sky_picture);

}  // namespace ptc
