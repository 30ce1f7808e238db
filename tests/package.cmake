# Installs the build into a new folder, builds apps/example against it, and runs it; then makes the Debian
# packages and inspects them:
#   cmake -DBUILD=build/release -DSOURCE=. -P tests/package.cmake
cmake_minimum_required(VERSION 3.25)

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
file(READ ${prefix}/share/zsh/vendor-completions/_gflow zsh)
if(NOT zsh MATCHES "'[*]--quiet\\[[^\n]*\\]'\n" OR NOT zsh MATCHES "'[*]--output\\[[^\n]*\\]:value:_files'\n")
  message(FATAL_ERROR "zsh completion takes a flag for an option with a value, or the reverse:\n${zsh}")
endif()
if(EXISTS ${BUILD}/man/gflow.1)
  if(NOT EXISTS ${prefix}/share/man/man1/gflow-train.1)
    message(FATAL_ERROR "the man page of gflow train is not installed")
  endif()
  file(READ ${prefix}/share/man/man1/gflow.1 page)
  if(NOT page MATCHES "EXIT STATUS.*130, 143, 129.*ENVIRONMENT.*GFLOW_DEVICE.*SEE ALSO.*gflow-train")
    message(FATAL_ERROR "the man page of gflow lacks a section:\n${page}")
  endif()
endif()

# The Debian packages gflow, gflow-dev and python3-gflow.
find_program(DPKG_DEB dpkg-deb)
find_program(SHLIBDEPS dpkg-shlibdeps)
find_program(FILE_TYPE file)
if(NOT DPKG_DEB OR NOT SHLIBDEPS OR NOT FILE_TYPE)
  message(STATUS "dpkg-dev or file is not installed: the Debian packages are not tested")
  return()
endif()
set(debs ${BUILD}/package/debs)
run(${CMAKE_CPACK_COMMAND} --config ${BUILD}/CPackConfig.cmake -B ${debs})
set(packaged "")
set(packages gflow gflow-dev)
if(EXISTS ${prefix}/lib/python3/dist-packages/gflow)
  list(APPEND packages python3-gflow)
endif()
foreach(package ${packages})
  file(GLOB deb ${debs}/${package}_*.deb)
  run(${DPKG_DEB} --extract ${deb} ${debs}/${package})
  file(GLOB_RECURSE files RELATIVE ${debs}/${package}/usr ${debs}/${package}/usr/*)
  if(NOT share/doc/${package}/copyright IN_LIST files)
    message(FATAL_ERROR "${package} has no copyright file")
  endif()
  list(APPEND packaged ${files})
  set(${package}_files "${files}")
  run(${DPKG_DEB} --field ${deb} Depends)
  set(${package}_depends "${output}")
endforeach()
file(GLOB_RECURSE installed RELATIVE ${prefix} ${prefix}/*)
list(REMOVE_ITEM installed share/doc/gflow/LICENSE)  # Debian has the Apache licence
list(SORT installed)
list(SORT packaged)
if(NOT packaged STREQUAL installed)
  message(FATAL_ERROR "the packages contain\n${packaged}\nbut these files are installed:\n${installed}")
endif()
if(gflow_files MATCHES "(^|;)(include|lib)/" OR gflow-dev_files MATCHES "(^|;)bin/")
  message(FATAL_ERROR "a file is in the wrong package:\n${gflow_files}\n${gflow-dev_files}")
endif()
if("python3-gflow" IN_LIST packages)
  if(NOT python3-gflow_files MATCHES "dist-packages/gflow/_core.*dist-packages/gflow/torch[.]py"
     OR NOT python3-gflow_depends MATCHES "python3-numpy.*libfmt")
    message(FATAL_ERROR "python3-gflow contains ${python3-gflow_files} and depends on ${python3-gflow_depends}")
  endif()
endif()
if(NOT gflow_depends MATCHES "opencl-icd.*libzip" OR NOT gflow-dev_depends MATCHES "^gflow \\(= [0-9.]+\\), ")
  message(FATAL_ERROR "gflow depends on ${gflow_depends}gflow-dev depends on ${gflow-dev_depends}")
endif()
