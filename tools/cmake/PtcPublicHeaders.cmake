# Copies the headers of the library to <OUT>/ptc, where others include them as <ptc/...>: run as
#
#   cmake -DSOURCE=<root> -DOUT=<directory> -DROOTS=<headers, separated by ','> -P PtcPublicHeaders.cmake
#
# "engine/store/reader.h" becomes <ptc/store/reader.h>, "format/codec.h" becomes <ptc/format/codec.h>.
# Headers that the roots include come along.
cmake_minimum_required(VERSION 3.25)
string(REPLACE "," ";" waiting "${ROOTS}")
set(seen)
while(waiting)
  list(POP_FRONT waiting header)
  if(header IN_LIST seen)
    continue()
  endif()
  list(APPEND seen ${header})
  file(READ ${SOURCE}/${header} text)
  string(REGEX MATCHALL "#include \"[^\"]+\"" includes "${text}")
  foreach(include IN LISTS includes)
    string(REGEX REPLACE "#include \"([^\"]+)\"" "\\1" path "${include}")
    list(APPEND waiting ${path})
  endforeach()
  string(REGEX REPLACE "#include \"engine/([^\"]+)\"" "#include \"ptc/\\1\"" text "${text}")
  string(REGEX REPLACE "#include \"format/([^\"]+)\"" "#include \"ptc/format/\\1\"" text "${text}")
  string(REGEX REPLACE "^engine/" "" target ${header})
  file(WRITE ${OUT}/new/ptc/${target} "${text}")
endwhile()
# Only what changed is written, so that nothing else is compiled again.
file(GLOB_RECURSE fresh RELATIVE ${OUT}/new ${OUT}/new/*)
file(GLOB_RECURSE stale RELATIVE ${OUT} ${OUT}/ptc/*)
foreach(header IN LISTS fresh)
  configure_file(${OUT}/new/${header} ${OUT}/${header} COPYONLY)
endforeach()
if(stale AND fresh)
  list(REMOVE_ITEM stale ${fresh})
endif()
foreach(header IN LISTS stale)
  file(REMOVE ${OUT}/${header})
endforeach()
file(REMOVE_RECURSE ${OUT}/new)
