# LCM by its own CMake package where there is one (1.4 and later), else by pkg-config (Debian 12's 1.3.1).
# Defines the target holdfast_lcm.
if(NOT TARGET holdfast_lcm)
  add_library(holdfast_lcm INTERFACE IMPORTED)
  find_package(lcm CONFIG QUIET)
  if(lcm_FOUND)
    target_link_libraries(holdfast_lcm INTERFACE lcm)
  else()
    find_package(PkgConfig REQUIRED)
    pkg_check_modules(LCM REQUIRED IMPORTED_TARGET lcm)
    target_link_libraries(holdfast_lcm INTERFACE PkgConfig::LCM)
  endif()
endif()
set(HoldfastLcm_FOUND TRUE)
