# Writes version.h when it would change: at every build, so that RUN_META names the commit that was built.
execute_process(COMMAND git describe --always --dirty --abbrev=12 WORKING_DIRECTORY ${SOURCE_DIR}
  OUTPUT_VARIABLE HOLDFAST_COMMIT OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
if(NOT HOLDFAST_COMMIT)
  set(HOLDFAST_COMMIT unknown)
endif()
configure_file(${SOURCE_DIR}/cmake/version.h.in ${OUTPUT})
