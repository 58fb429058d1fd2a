# SuiteSparse, some of which is under the GPL: a simulator that has it is for comparing, not for handing on.
find_path(SUITESPARSE_INCLUDE cholmod.h PATH_SUFFIXES suitesparse REQUIRED)
add_library(suitesparse INTERFACE)
target_include_directories(suitesparse SYSTEM INTERFACE ${SUITESPARSE_INCLUDE})
foreach(name cholmod klu umfpack)
  find_library(SUITESPARSE_${name} ${name} REQUIRED)
  target_link_libraries(suitesparse INTERFACE ${SUITESPARSE_${name}})
endforeach()
list(APPEND CUTJOINT_LIBRARIES suitesparse)
# all solvers are as well optimised as what is emitted
set(CUTJOINT_OPTIMISED ON)
