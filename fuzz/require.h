// The check by which a fuzz target reports that its property is broken.
#pragma once

#include <cstdio>
#include <cstdlib>

namespace ptc::fuzz {

/// Aborts unless `holds` is true, and names the line of the caller.
inline void require(bool holds, int line = __builtin_LINE()) {
  if (holds) return;
  std::fprintf(stderr, "property broken at line %d of the target\n", line);
  std::abort();
}

}  // namespace ptc::fuzz
