# Flags of our own code only; users of the installed libraries never see them.
add_library(holdfast_flags INTERFACE)
target_compile_options(holdfast_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wcast-align
  $<$<CXX_COMPILER_ID:GNU>:-Wduplicated-cond -Wlogical-op>
  # GCC takes a source that was put together with others for a header, where anonymous names would be a mistake.
  $<$<AND:$<BOOL:${CMAKE_UNITY_BUILD}>,$<COMPILE_LANG_AND_ID:CXX,GNU>>:-Wno-subobject-linkage>
  # One rounding per operation, so that no compiler version or -march merges a multiply and an add.
  -ffp-contract=off)

find_program(CLANG_TIDY clang-tidy)

# holdfast_add_library(NAME HEADERS .. SOURCES .. DEPENDS .. PRIVATE_DEPENDS ..): target holdfast_NAME, exported as holdfast::NAME.
# Headers that most sources read are parsed once, by holdfast_common: a third of a source's compile time.
# What GCC 12 thinks of its own std::string once that is inlined, it says only where the header is precompiled.
function(holdfast_precompile target)
  if(HOLDFAST_TIDY)
    return()  # clang cannot read what GCC precompiled
  endif()
  if(target STREQUAL holdfast_common)
    target_precompile_headers(${target} PRIVATE <Eigen/Core> <yaml-cpp/yaml.h>
      <algorithm> <functional> <map> <memory> <string> <vector>)
  else()
    target_precompile_headers(${target} REUSE_FROM holdfast_common)
    target_compile_definitions(${target} PRIVATE BOOST_ALL_NO_LIB)  # as Boost has it there: both must agree
  endif()
  target_compile_options(${target} PRIVATE
    $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-array-bounds;-Wno-restrict;-Wno-stringop-overflow;-Wno-stringop-overread>)
endfunction()

function(holdfast_add_library name)
  cmake_parse_arguments(ARG "" "" "HEADERS;SOURCES;DEPENDS;PRIVATE_DEPENDS" ${ARGN})
  set(target holdfast_${name})
  add_library(${target} ${ARG_SOURCES})
  add_library(holdfast::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  target_sources(${target} PUBLIC FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${ARG_HEADERS})
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PUBLIC ${ARG_DEPENDS})
  foreach(dependency IN LISTS ARG_PRIVATE_DEPENDS ITEMS holdfast_flags)
    target_link_libraries(${target} PRIVATE $<BUILD_INTERFACE:${dependency}>)
  endforeach()
  holdfast_precompile(${target})
  if(HOLDFAST_TIDY AND CLANG_TIDY)
    set_target_properties(${target} PROPERTIES CXX_CLANG_TIDY "${CLANG_TIDY};--quiet")
  endif()
  install(TARGETS ${target} EXPORT holdfastTargets
    FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/holdfast)
endfunction()

# holdfast_add_program(NAME MAIN DEPENDS ..): the program holdfast-NAME.
function(holdfast_add_program name main)
  cmake_parse_arguments(ARG "" "" "DEPENDS" ${ARGN})
  add_executable(holdfast-${name} ${main})
  target_link_libraries(holdfast-${name} PRIVATE ${ARG_DEPENDS} holdfast_flags)
  # All programs stand in one folder, so that one starts another without a search path.
  set_target_properties(holdfast-${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
  install(TARGETS holdfast-${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endfunction()
