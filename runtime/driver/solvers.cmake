# cutjoint_add_solvers(<target> <comparison>): the linear solvers of a program with a Lagrangian method.  Those of Eigen; with <comparison>
# also those of SuiteSparse, some of which are under the GPL: a program that has them is for comparing, not for handing on.
set(CUTJOINT_SOLVERS_FOLDER ${CMAKE_CURRENT_LIST_DIR})

function(cutjoint_add_solvers target comparison)
  if(NOT comparison)
    target_sources(${target} PRIVATE ${CUTJOINT_SOLVERS_FOLDER}/solvers.cpp)
    return()
  endif()
  find_path(SUITESPARSE_INCLUDE cholmod.h PATH_SUFFIXES suitesparse REQUIRED)
  target_sources(${target} PRIVATE ${CUTJOINT_SOLVERS_FOLDER}/comparison_solvers.cpp)
  target_include_directories(${target} SYSTEM PRIVATE ${SUITESPARSE_INCLUDE})
  cutjoint_link_solvers(${target} PUBLIC)
endfunction()

# cutjoint_link_solvers(<target> <scope>): what a program links that uses a library made with <comparison>.
function(cutjoint_link_solvers target scope)
  foreach(name cholmod klu umfpack)
    find_library(SUITESPARSE_${name} ${name} REQUIRED)
    target_link_libraries(${target} ${scope} ${SUITESPARSE_${name}})
  endforeach()
endfunction()
