# Installs the build into a new folder, builds apps/example against it, and runs it:
#   cmake -DBUILD=build/release -DSOURCE=. -P tests/package.cmake
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "${ARGN} ended with ${code}:\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

set(prefix ${BUILD}/package/prefix)
file(REMOVE_RECURSE ${BUILD}/package)
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})
run(${CMAKE_COMMAND} -S ${SOURCE}/apps/example -B ${BUILD}/package/example -G Ninja -DCMAKE_PREFIX_PATH=${prefix})
run(${CMAKE_COMMAND} --build ${BUILD}/package/example)

run(${BUILD}/package/example/fit)
if(NOT output MATCHES "step 0: loss 0\\.([0-9]+), flow.*step 9: loss 0\\.([0-9]+), flow")
  message(FATAL_ERROR "the example prints no losses:\n${output}")
endif()
if(NOT CMAKE_MATCH_2 LESS CMAKE_MATCH_1)
  message(FATAL_ERROR "ten Adam steps do not lower the loss:\n${output}")
endif()

run(${BUILD}/package/example/train ${SOURCE}/apps/demo/scene ${BUILD}/package/model.ply)
run(${prefix}/bin/gflow info ${BUILD}/package/model.ply)
if(NOT output MATCHES "spacetime")
  message(FATAL_ERROR "the example's model is not described:\n${output}")
endif()

# Completion in the installed script: a command, an option of it, a setting.
file(WRITE ${BUILD}/package/complete.sh [[
compopt() { :; }
source "$1"
try() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _gflow; echo "${COMPREPLY[@]}"; }
try gflow tr
try gflow train scene --overw
try gflow bench sk
try gflow train scene --set motion.mod
]])
run(bash ${BUILD}/package/complete.sh ${prefix}/share/bash-completion/completions/gflow)
if(NOT output STREQUAL "train\n--overwrite\nskip\nmotion.model=\n")
  message(FATAL_ERROR "completion gives:\n${output}")
endif()
if(EXISTS ${BUILD}/man/gflow.1 AND NOT EXISTS ${prefix}/share/man/man1/gflow-train.1)
  message(FATAL_ERROR "the man page of gflow train is not installed")
endif()
