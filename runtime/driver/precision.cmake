# Number types of a simulator.
set(CUTJOINT_PRECISION double CACHE STRING "number type of the run: single, double, extended (80 bits on x86) or quad (128 bits)")

# cutjoint_set_precision(<target> <precision> <scope>): what a target takes for cutjoint::Precision.
function(cutjoint_set_precision target precision scope)
  if(precision STREQUAL single)
    target_compile_definitions(${target} ${scope} CUTJOINT_REAL=float)
  elseif(precision STREQUAL extended)
    target_compile_definitions(${target} ${scope} "CUTJOINT_REAL=long double")
  elseif(precision STREQUAL quad)
    find_package(Eigen3 3.3 REQUIRED NO_MODULE)
    target_link_libraries(${target} ${scope} Eigen3::Eigen)
    target_compile_definitions(${target} ${scope} CUTJOINT_REAL=cutjoint::Quad)
    target_compile_options(${target} ${scope} -include cutjoint/quad.hpp)
  elseif(NOT precision STREQUAL double)
    message(FATAL_ERROR "no precision '${precision}'; there is single, double, extended and quad")
  endif()
endfunction()
