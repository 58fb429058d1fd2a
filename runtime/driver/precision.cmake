# Number types of a simulator: double, or one of another package, whose C++ type is CUTJOINT_REAL.  A type that is not of the language has a
# header, CUTJOINT_REAL_HEADER, which makes it a number of Eigen's too.
set(CUTJOINT_PRECISION double CACHE STRING "name of the number type of the run")

# cutjoint_set_precision(<target> <precision> <scope>): what a target takes for cutjoint::Precision.
function(cutjoint_set_precision target precision scope)
  if(precision STREQUAL double)
    return()
  endif()
  target_compile_definitions(${target} ${scope} "CUTJOINT_REAL=${CUTJOINT_REAL}")
  if(CUTJOINT_REAL_HEADER)
    find_package(Eigen3 3.3 REQUIRED NO_MODULE)
    target_link_libraries(${target} ${scope} Eigen3::Eigen)
    target_compile_options(${target} ${scope} -include ${CUTJOINT_REAL_HEADER})
  endif()
endfunction()
