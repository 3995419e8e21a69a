# The layers that each layer may include, in one place: ptc_add_layer() links a layer by this table,
# and tests/layers.py checks every #include "..." of the tree against it.
set(PTC_LAYERS_format "")
set(PTC_LAYERS_engine/base "format")
set(PTC_LAYERS_engine/parallel "engine/base")
set(PTC_LAYERS_engine/io/file "format;engine/base")
set(PTC_LAYERS_engine/io "format;engine/base;engine/io/file")
set(PTC_LAYERS_engine/scene "format;engine/base;engine/io/file;engine/io;engine/sort")
set(PTC_LAYERS_engine/sort "format;engine/base;engine/io/file")
set(PTC_LAYERS_engine/scan "format;engine/base;engine/io/file;engine/io;engine/sort")
set(PTC_LAYERS_engine/store "format;engine/base;engine/io/file")
set(PTC_LAYERS_engine/octree "format;engine/base;engine/io/file;engine/io;engine/sort;engine/store")
set(PTC_LAYERS_engine/verify "format;engine/base;engine/parallel;engine/io/file;engine/io;engine/sort;engine/store;engine/octree")
set(PTC_LAYERS_engine/cache "format;engine/base;engine/io/file;engine/store")
set(PTC_LAYERS_engine/shade "format;engine/base;engine/io/file;engine/io;engine/store;engine/cache")
set(PTC_LAYERS_engine/trace "${PTC_LAYERS_engine/shade};engine/shade")
set(PTC_LAYERS_engine/pipeline
  "format;engine/base;engine/parallel;engine/io/file;engine/io;engine/scene;engine/sort;engine/scan;engine/store;engine/octree;engine/cache;engine/shade;engine/trace")
set(PTC_LAYERS_engine "${PTC_LAYERS_engine/pipeline};engine/pipeline;engine/verify")
set(PTC_LAYERS_tools/bench/chart "format;engine/base;engine/io/file;engine/io")
set(PTC_LAYERS_tools/bench/shapes "format;engine/base;engine/parallel;engine/io/file;engine/io;engine/sort;engine/store;engine/octree")
set(PTC_LAYERS_tools "${PTC_LAYERS_engine/pipeline};engine/verify;engine/pipeline;engine;tools/bench/chart")
set(PTC_LAYERS_tools/bench/report "format;engine/base;engine/io/file;engine/io;tools/bench/chart")
set(PTC_LAYERS_tools/bench/scenes "${PTC_LAYERS_engine/pipeline};engine/pipeline;engine")
set(PTC_LAYERS_tools/bench/references "${PTC_LAYERS_tools/bench/scenes};tools/bench/chart;tools/bench/scenes")
set(PTC_LAYERS_tools/bench/stability "${PTC_LAYERS_tools/bench/references};tools/bench/references;tools/bench/shapes")
set(PTC_LAYERS_tools/bench/hunt "${PTC_LAYERS_tools/bench/stability};tools/bench/stability")
set(PTC_LAYERS_tools/bench/experiments
  "${PTC_LAYERS_tools};tools;tools/bench/report;tools/bench/scenes;tools/bench/references;tools/bench/shapes;tools/bench/stability;tools/bench/hunt")
set(PTC_LAYERS_tools/bench "${PTC_LAYERS_tools/bench/experiments};tools/bench/experiments")

add_library(ptc_options INTERFACE)
target_compile_features(ptc_options INTERFACE cxx_std_20)
# No contraction: a fused multiply-add in one build and not in another would change the bytes. No code reads errno or
# traps of arithmetic, which would keep the compiler from vectorising loops, and no program replaces a function of the
# shared libraries, which would keep it from inlining them.
# GCC 12 warns of overlapping copies in sums of strings that cannot overlap (its bug 105651): -Wno-restrict.
target_compile_options(ptc_options INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion
  -Wsign-conversion -Wno-missing-field-initializers $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict> -ffp-contract=off -fno-math-errno -fno-trapping-math -fno-semantic-interposition
  $<$<BOOL:${PTC_WERROR}>:-Werror>)
if(PTC_FUZZ)  # instrumented code reports to libFuzzer which branches it took
  target_compile_options(ptc_options INTERFACE -fsanitize=fuzzer-no-link)
endif()
if(PTC_SANITIZE)
  target_compile_options(ptc_options INTERFACE -fsanitize=${PTC_SANITIZE} -fno-omit-frame-pointer)
  target_link_options(ptc_options INTERFACE -fsanitize=${PTC_SANITIZE})
endif()

# ptc_compile_together(<target> <number>) compiles files in groups of that number: most of the time of each went to
# headers and templates that all of them need. Only for Release: the other presets compile each file alone, and find
# what one includes too little. Sources that include themselves once for each instruction set stay alone. Names of
# unnamed namespaces have to differ within a target, because a new source moves all groups behind it.
function(ptc_compile_together target number)
  if(CMAKE_BUILD_TYPE STREQUAL "Release")
    get_target_property(sources ${target} SOURCES)
    foreach(source IN LISTS sources)
      set(many)
      if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${source})
        file(STRINGS ${source} many REGEX "HWY_TARGET_INCLUDE")
      endif()
      if(many)
        set_source_files_properties(${source} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
      endif()
    endforeach()
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${number})
  endif()
endfunction()

# ptc_add_layer(<path> SOURCES <files> HEADERS <files> [PUBLIC <libs>] [PRIVATE <libs>])
# makes the static library ptc_<name> with the alias ptc::<name>; its headers are included as "<path>/x.h".
function(ptc_add_layer path)
  cmake_parse_arguments(ARG "" "" "SOURCES;HEADERS;PUBLIC;PRIVATE" ${ARGN})
  get_filename_component(name ${path} NAME)
  add_library(ptc_${name} STATIC ${ARG_SOURCES})
  add_library(ptc::${name} ALIAS ptc_${name})
  target_sources(ptc_${name} PUBLIC FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR}
    FILES ${ARG_HEADERS})
  # A source begins with the header of its name, which is thereby compiled alone (tests/layers.py) wherever sources are
  # not compiled together; the check compiles the others.
  set(alone ${ARG_HEADERS})
  foreach(source IN LISTS ARG_SOURCES)
    string(REGEX REPLACE "\\.cpp$" ".h" header ${source})
    list(REMOVE_ITEM alone ${header})
  endforeach()
  if(alone)
    target_sources(ptc_${name} PUBLIC FILE_SET alone TYPE HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${alone})
    set_target_properties(ptc_${name} PROPERTIES VERIFY_INTERFACE_HEADER_SETS ON INTERFACE_HEADER_SETS_TO_VERIFY alone)
  endif()
  target_link_libraries(ptc_${name} PUBLIC ptc_options ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  if(NOT name STREQUAL "format")  # constants of its files have the same names
    ptc_compile_together(ptc_${name} 8)
  endif()
  foreach(layer IN LISTS PTC_LAYERS_${path})
    get_filename_component(dependency ${layer} NAME)
    target_link_libraries(ptc_${name} PUBLIC ptc::${dependency})
  endforeach()
endfunction()

# What most tests and programs read of the standard library and of GLM. Layers of the engine read nothing beforehand:
# each of their headers has to compile alone.
set(PTC_READ_OFTEN <algorithm> <atomic> <condition_variable> <filesystem> <functional> <future> <map> <memory> <mutex>
  <optional> <random> <span> <sstream> <string> <unordered_map> <vector> <glm/glm.hpp>)

# ptc_read_once(<target> <arguments>) takes the arguments of target_precompile_headers(). A compiler cache takes no
# precompiled headers.
function(ptc_read_once target)
  if(ARGN AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
    target_precompile_headers(${target} ${ARGN})
  endif()
endfunction()

# For code whose speed is of no account: to optimise it took a third of the time of a build. Under -O1, GCC 12 sees
# strings overflow that do not.
set(PTC_QUICK_OPTIONS $<$<CONFIG:Release>:-O1$<SEMICOLON>-Wno-array-bounds$<SEMICOLON>-Wno-stringop-overflow$<SEMICOLON>-Wno-stringop-overread>)

# ptc_compile_quickly(<target> <arguments>) does so with a target and takes the arguments of ptc_read_once(): to read
# headers of other projects took as much again.
function(ptc_compile_quickly target)
  target_compile_options(${target} PRIVATE "${PTC_QUICK_OPTIONS}")
  ptc_read_once(${target} ${ARGN})
endfunction()

# ptc_add_tests(<name> SOURCES <files> LINK <libs>) makes the executable test_<name> and registers each of its
# TEST_CASEs with ctest. Those of the format come first and read Catch2 for all.
function(ptc_add_tests name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(test_${name} ${ARG_SOURCES})
  target_include_directories(test_${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_definitions(test_${name} PRIVATE PTC_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_link_libraries(test_${name} PRIVATE ptc_options Catch2::Catch2WithMain ${ARG_LINK})
  if(name STREQUAL "format")
    ptc_compile_quickly(test_format PRIVATE ${PTC_READ_OFTEN} <catch2/catch.hpp>)
  else()
    ptc_compile_quickly(test_${name} REUSE_FROM test_format)
  endif()
  if(name MATCHES "^(bench|integration|scene|shade|trace)$")  # others gain nothing by it
    ptc_compile_together(test_${name} 4)
  endif()
  catch_discover_tests(test_${name} TEST_PREFIX "${name}: " PROPERTIES TIMEOUT 300)
endfunction()
