# What others get: headers under ptc/, two libraries (shared and static), a CMake package, pkg-config files,
# the programs with their manual pages and completions, and Debian packages of all that.
#
#   libptc-store  reads and writes containers; needs zstd, LZ4 and xxHash
#   libptc        everything: build, shade, render, verify
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
find_program(PTC_GZIP gzip REQUIRED)

set(PTC_STORE_LAYERS format base file store)
set(PTC_LAYERS parallel io scene sort scan octree verify cache shade trace pipeline)
set(PTC_STORE_HEADERS engine/store/reader.h engine/store/writer.h engine/store/point_scan.h engine/store/container_points.h)
set(PTC_HEADERS ${PTC_STORE_HEADERS} engine/ptc.h)

# Before 1.0 each minor version may break what the one before it promised, as SameMinorVersion says below.
set(PTC_SOVERSION ${PROJECT_VERSION_MAJOR})
if(PROJECT_VERSION_MAJOR EQUAL 0)
  set(PTC_SOVERSION 0.${PROJECT_VERSION_MINOR})
endif()

# ptc_add_library(<name> EXPORT <target> LAYERS <layers> LINK <libs>) makes lib<name>.so and lib<name>.a of the
# objects of layers; others know them as ptc::<target> and ptc::<target>-static.
function(ptc_add_library name)
  cmake_parse_arguments(ARG "" "EXPORT" "LAYERS;LINK" ${ARGN})
  set(objects)
  foreach(layer IN LISTS ARG_LAYERS)
    list(APPEND objects $<TARGET_OBJECTS:ptc_${layer}>)
  endforeach()
  foreach(kind SHARED STATIC)
    string(TOLOWER ${kind} suffix)
    set(target ${name}_${suffix})
    add_library(${target} ${kind} ${objects})
    set_target_properties(${target} PROPERTIES OUTPUT_NAME ${name} VERSION ${PROJECT_VERSION}
      SOVERSION ${PTC_SOVERSION} LINKER_LANGUAGE CXX EXPORT_NAME ${ARG_EXPORT})
    target_compile_features(${target} INTERFACE cxx_std_20)
    target_include_directories(${target} INTERFACE $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/include>
      $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
    target_link_libraries(${target} PRIVATE ${ARG_LINK})
    if(kind STREQUAL SHARED)
      target_link_options(${target} PRIVATE LINKER:-z,defs)  # nothing is left for a program to find
    endif()
    add_dependencies(${target} ptc_headers)
  endforeach()
  set_target_properties(${name}_static PROPERTIES EXPORT_NAME ${ARG_EXPORT}-static)
endfunction()

list(JOIN PTC_HEADERS "," roots)
file(GLOB_RECURSE headers CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/engine/*.h ${PROJECT_SOURCE_DIR}/format/*.h)
add_custom_command(OUTPUT ${PROJECT_BINARY_DIR}/include/stamp
  COMMAND ${CMAKE_COMMAND} -DSOURCE=${PROJECT_SOURCE_DIR} -DOUT=${PROJECT_BINARY_DIR}/include -DROOTS=${roots}
    -P ${PROJECT_SOURCE_DIR}/tools/cmake/PtcPublicHeaders.cmake
  COMMAND ${CMAKE_COMMAND} -E touch ${PROJECT_BINARY_DIR}/include/stamp
  DEPENDS ${headers} ${PROJECT_SOURCE_DIR}/tools/cmake/PtcPublicHeaders.cmake
  COMMENT "Copying public headers to include/ptc" VERBATIM)
add_custom_target(ptc_headers ALL DEPENDS ${PROJECT_BINARY_DIR}/include/stamp)

ptc_add_library(ptc-store EXPORT store LAYERS ${PTC_STORE_LAYERS}
  LINK zstd::libzstd_shared PkgConfig::lz4 PkgConfig::xxhash Threads::Threads)
ptc_add_library(ptc EXPORT ptc LAYERS ${PTC_LAYERS}
  LINK TBB::tbb embree OpenEXR::OpenEXR pugixml::pugixml draco::draco meshoptimizer::meshoptimizer PkgConfig::lz4 ZLIB::ZLIB JPEG::JPEG PNG::PNG fmt::fmt PkgConfig::hwy PkgConfig::uring PkgConfig::stb Threads::Threads)
foreach(kind shared static)  # the headers of ptc::ptc include those of GLM
  target_link_libraries(ptc_${kind} PUBLIC ptc-store_${kind} INTERFACE glm::glm)
endforeach()
set_target_properties(ptc_shared PROPERTIES INSTALL_RPATH $ORIGIN)  # libptc-store lies next to libptc, under any prefix

install(TARGETS ptc_shared ptc-store_shared EXPORT ptcTargets
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT libptc NAMELINK_COMPONENT libptc-dev)
install(TARGETS ptc_static ptc-store_static EXPORT ptcStaticTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT libptc-dev)
install(DIRECTORY ${PROJECT_BINARY_DIR}/include/ptc DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT libptc-dev)

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/ptc)
install(EXPORT ptcTargets NAMESPACE ptc:: DESTINATION ${package} COMPONENT libptc-dev)
install(EXPORT ptcStaticTargets NAMESPACE ptc:: DESTINATION ${package} COMPONENT libptc-dev)
configure_package_config_file(${PROJECT_SOURCE_DIR}/tools/install/ptcConfig.cmake.in
  ${PROJECT_BINARY_DIR}/ptcConfig.cmake INSTALL_DESTINATION ${package})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/ptcConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/ptcConfig.cmake ${PROJECT_BINARY_DIR}/ptcConfigVersion.cmake
  DESTINATION ${package} COMPONENT libptc-dev)
# The names of libraries, not of their pkg-config packages: a program that links the shared library needs none of these.
pkg_check_modules(private REQUIRED QUIET OpenEXR draco fmt libhwy libpng liburing libjpeg pugixml stb zlib tbb)
list(APPEND private_LIBRARIES meshoptimizer)  # has no pkg-config package
list(TRANSFORM private_LIBRARIES PREPEND -l)
list(JOIN private_LIBRARIES " " PTC_PRIVATE_LIBS)
file(RELATIVE_PATH PTC_PREFIX_FROM_PC /prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig /prefix)
foreach(library ptc ptc-store)
  configure_file(${PROJECT_SOURCE_DIR}/tools/install/${library}.pc.in ${PROJECT_BINARY_DIR}/${library}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/${library}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT libptc-dev)
endforeach()

if(PTC_TOOLS)
  install(TARGETS ${PTC_PROGRAMS} RUNTIME COMPONENT ptcx-tools)
  # Debian's zsh looks into site-functions below /usr/local, but into vendor-completions below /usr. The prefix is known
  # when the files are installed or packed.
  install(CODE [[
    set(PTC_ZSH site-functions)
    if(CMAKE_INSTALL_PREFIX MATCHES "/usr$")
      set(PTC_ZSH vendor-completions)
    endif()]] COMPONENT ptcx-tools)
  foreach(program IN LISTS PTC_PROGRAMS)
    install(FILES ${PROJECT_BINARY_DIR}/share/zsh/site-functions/_${program}
      DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/\${PTC_ZSH} COMPONENT ptcx-tools)
    foreach(completion bash-completion/completions/${program} fish/vendor_completions.d/${program}.fish)
      get_filename_component(directory ${completion} DIRECTORY)
      install(FILES ${PROJECT_BINARY_DIR}/share/${completion} DESTINATION ${CMAKE_INSTALL_DATADIR}/${directory}
        COMPONENT ptcx-tools)
    endforeach()
    set(page ${PROJECT_BINARY_DIR}/share/man/man1/${program}.1)
    add_custom_command(OUTPUT ${PROJECT_BINARY_DIR}/${program}.1.gz
      COMMAND ${PTC_GZIP} -9nc ${page} > ${PROJECT_BINARY_DIR}/${program}.1.gz DEPENDS ptc_manuals ${page} VERBATIM)
    list(APPEND pages ${PROJECT_BINARY_DIR}/${program}.1.gz)
  endforeach()
  add_custom_target(ptc_man_pages ALL DEPENDS ${pages})
  install(FILES ${pages} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT ptcx-tools)
  install(FILES ${PROJECT_SOURCE_DIR}/spec/ptcx.magic DESTINATION ${CMAKE_INSTALL_DATADIR}/ptcx COMPONENT ptcx-tools)
  install(FILES ${PROJECT_SOURCE_DIR}/tools/install/ptcx.xml DESTINATION ${CMAKE_INSTALL_DATADIR}/mime/packages
    COMPONENT ptcx-tools)
endif()

# Debian packages: cmake --preset release -DCMAKE_INSTALL_PREFIX=/usr, then cpack -G DEB
set(changelog ${PROJECT_BINARY_DIR}/changelog.gz)
add_custom_command(OUTPUT ${changelog} COMMAND ${PTC_GZIP} -9nc ${PROJECT_SOURCE_DIR}/tools/install/changelog > ${changelog}
  DEPENDS ${PROJECT_SOURCE_DIR}/tools/install/changelog VERBATIM)
add_custom_target(ptc_changelog ALL DEPENDS ${changelog})
set(about_libptc "Libraries that light scenes of points larger than memory
 PTCX is out-of-core point-based global illumination. This package has its
 libraries: libptc, and libptc-store for containers alone.")
set(about_libptc-dev "Libraries that light scenes larger than memory (development)
 PTCX is out-of-core point-based global illumination. This package has headers,
 static libraries, a CMake package and pkg-config files.")
set(about_ptcx-tools "Lights, verifies and converts scenes of points larger than memory
 PTCX sorts points along a Z-curve, builds an octree whose nodes know their
 light, keeps both in a checksummed container, and computes ambient occlusion,
 sky light and colour bleeding under a memory cap.")
set(section_libptc libs)
set(section_libptc-dev libdevel)
set(section_ptcx-tools graphics)
set(CPACK_COMPONENTS_ALL libptc libptc-dev)
if(PTC_TOOLS)
  list(APPEND CPACK_COMPONENTS_ALL ptcx-tools)
endif()
foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  foreach(file ${PROJECT_SOURCE_DIR}/tools/install/copyright ${changelog})
    install(FILES ${file} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${component} COMPONENT ${component})
  endforeach()
  string(TOUPPER ${component} upper)
  set(CPACK_COMPONENT_${upper}_DESCRIPTION "${about_${component}}")
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${component})
  set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION ${section_${component}})
endforeach()
set(CPACK_DEBIAN_LIBPTC-DEV_PACKAGE_DEPENDS "libptc (= ${PROJECT_VERSION}), libglm-dev")
set(CPACK_DEBIAN_LIBPTC-DEV_PACKAGE_SUGGESTS
  "libzstd-dev, liblz4-dev, libxxhash-dev, libopenexr-dev, libtbb-dev, libembree-dev, libfmt-dev, libhwy-dev, liburing-dev, libpugixml-dev, libdraco-dev, libmeshoptimizer-dev, libjpeg-dev, libpng-dev, zlib1g-dev")
set(CPACK_DEBIAN_LIBPTC_PACKAGE_RECOMMENDS libcurl4)  # loaded when a URL is opened
set(CPACK_DEBIAN_LIBPTC_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/tools/install/triggers)
set(CPACK_PACKAGE_NAME ptcx)
set(CPACK_PACKAGE_CONTACT "The PTCX authors <ptcx@users.noreply.github.com>")
set(CPACK_PACKAGING_INSTALL_PREFIX ${CMAKE_INSTALL_PREFIX})
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR})
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY ">=")
include(CPack)
