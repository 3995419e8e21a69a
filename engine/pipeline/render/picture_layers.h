// Internal to render_picture(): which layers the files of a picture have.
#pragma once

#include <span>
#include <vector>

#include "engine/io/image/image.h"
#include "engine/pipeline/render/film.h"
#include "engine/pipeline/render/render_picture.h"

namespace ptc {

/// Says whether targets show the numbers of objects and materials, if what is seen has any.
[[nodiscard]] bool has_ids(const RenderRequest& request, std::span<const PictureTarget> targets);

/// Refuses a layer of numbers where surfels are seen, which have none.
/// @param sees_mesh  whether a mesh is seen
/// @throws RequestError
void require_ids(std::span<const PictureTarget> targets, bool sees_mesh);

/// Returns the layers of a picture that not every picture has.
/// @param ids  whether has_ids(), and a mesh is seen
[[nodiscard]] FilmExtras extras_of(const RenderRequest& request,
                                   std::span<const PictureTarget> targets, bool ids);

/// Returns what an .exr says of the layers of films.
[[nodiscard]] std::vector<ExrLayerType> layer_types(const Film& film);

}  // namespace ptc
