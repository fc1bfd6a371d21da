# SPDX-License-Identifier: BSD-3-Clause
# find_package(tetlod) gives the targets
#   tetlod::tetlod         libtetlod: reads streams (tetlod.h)
#   tetlod::build          libtetlod-build: builds streams (tetlod_build.h)
#   tetlod::tetlod_static  and tetlod::build_static, the same as archives
get_filename_component(_tetlod_libdir "${CMAKE_CURRENT_LIST_DIR}/../.." ABSOLUTE)
get_filename_component(_tetlod_includedir "${CMAKE_CURRENT_LIST_DIR}/@includedir@" ABSOLUTE)
include(CMakeFindDependencyMacro)
set(THREADS_PREFER_PTHREAD_FLAG ON)
find_dependency(Threads)

function(_tetlod_target name kind file)
  if(TARGET tetlod::${name})
    return()
  endif()
  add_library(tetlod::${name} ${kind} IMPORTED)
  set_target_properties(tetlod::${name} PROPERTIES
    IMPORTED_LOCATION "${_tetlod_libdir}/${file}"
    INTERFACE_INCLUDE_DIRECTORIES "${_tetlod_includedir}"
    INTERFACE_LINK_LIBRARIES "${ARGN}")
endfunction()

_tetlod_target(tetlod SHARED libtetlod.so)
_tetlod_target(build SHARED libtetlod-build.so)
_tetlod_target(tetlod_static STATIC libtetlod.a m)
_tetlod_target(build_static STATIC libtetlod-build.a tetlod::tetlod_static Threads::Threads m)
