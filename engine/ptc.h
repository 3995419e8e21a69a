// The library by one header: a scene to a container, a container to shaded points, to pictures and
// to other files; containers themselves; their verification; points of a program's own.
#pragma once

#include "engine/io/cloud/record.h"                         // IWYU pragma: export
#include "engine/octree/build_pages.h"                      // IWYU pragma: export
#include "engine/parallel/thread_pool.h"                    // IWYU pragma: export
#include "engine/pipeline/build/build_container.h"          // IWYU pragma: export
#include "engine/pipeline/convert/convert.h"                // IWYU pragma: export
#include "engine/pipeline/convert/point_files.h"            // IWYU pragma: export
#include "engine/pipeline/light/light_container.h"          // IWYU pragma: export
#include "engine/pipeline/point_input.h"                    // IWYU pragma: export
#include "engine/pipeline/quality/simplification_choice.h"  // IWYU pragma: export
#include "engine/pipeline/quality/surfel_choice.h"          // IWYU pragma: export
#include "engine/pipeline/render/render_picture.h"          // IWYU pragma: export
#include "engine/pipeline/shade/shade_container.h"          // IWYU pragma: export
#include "engine/sort/external_sort.h"                      // IWYU pragma: export
#include "engine/sort/point_streams.h"                      // IWYU pragma: export
#include "engine/store/container_points.h"                  // IWYU pragma: export
#include "engine/store/point_scan.h"                        // IWYU pragma: export
#include "engine/store/reader.h"                            // IWYU pragma: export
#include "engine/store/writer.h"                            // IWYU pragma: export
#include "engine/verify/salvage.h"                          // IWYU pragma: export
#include "engine/verify/verify.h"                           // IWYU pragma: export
