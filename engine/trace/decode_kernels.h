// The decoding of what rays meet, compiled for every instruction set.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/trace/decoded_tree.h"
#include "engine/trace/trace_boxes.h"
#include "format/node_page.h"

namespace ptc {

/// Decodes the children of a group.
void decode_boxes(const GroupView& group, const TraceRules& rules, TraceGroup& into);

/// Decodes points of a page into a leaf whose anchor is set.
/// @param payload  of the page; up to 64 bytes past its end may be read
/// @param count    number of points on the page
/// @param first    index of the first point on the page
/// @param number   how many points; with those of `from` at most kTraceDiscs
/// @param from     number of the first point in its leaf
void decode_discs(const std::byte* payload, std::uint32_t count, std::uint32_t first,
                  unsigned number, unsigned from, const TraceRules& rules, TraceLeaf& into);

}  // namespace ptc
