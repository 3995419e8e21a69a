// The commit that the program was built from; its definition is written with each build.
#pragma once

namespace ptc::bench {

/// The commit as git describe names it, with "-dirty" at its end where files were changed; empty
/// where the build did not know it.
extern const char* const kBuiltCommit;

}  // namespace ptc::bench
