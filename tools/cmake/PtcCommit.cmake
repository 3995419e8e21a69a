# Writes the commit of a source tree as a C++ file, which is touched only when the commit changes:
#   cmake -DSOURCE=<tree> -DTARGET=<file.cpp> -P PtcCommit.cmake
set(commit "")
find_package(Git QUIET)
if(GIT_FOUND)
  execute_process(COMMAND ${GIT_EXECUTABLE} -C ${SOURCE} describe --always --dirty --abbrev=12
    OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
file(CONFIGURE OUTPUT ${TARGET} @ONLY CONTENT [[
#include "tools/bench/report/commit.h"

namespace ptc::bench {

const char* const kBuiltCommit = "@commit@";

}  // namespace ptc::bench
]])
