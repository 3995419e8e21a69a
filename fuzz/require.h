// How a target says that its property is broken.
#pragma once

#include <cstdio>
#include <cstdlib>

namespace ptc::fuzz {

/// Aborts, naming the line, unless it holds.
inline void require(bool holds, int line = __builtin_LINE()) {
  if (holds) return;
  std::fprintf(stderr, "property broken at line %d of the target\n", line);
  std::abort();
}

}  // namespace ptc::fuzz
