// The commit that the program was built from; its definition is written with each build.
#pragma once

namespace ptc::bench {

/// As git describe has it, with "-dirty" at its end where files were changed; empty where it is not
/// known.
extern const char* const kBuiltCommit;

}  // namespace ptc::bench
