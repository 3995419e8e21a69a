// All that a user of the library calls: a scene to a container, a container to shaded points, to
// pictures and to other files.
#pragma once

#include "engine/pipeline/build/build_container.h"  // IWYU pragma: export
#include "engine/pipeline/convert/convert.h"        // IWYU pragma: export
#include "engine/pipeline/render/render_picture.h"  // IWYU pragma: export
#include "engine/pipeline/shade/shade_container.h"  // IWYU pragma: export
