# Installs the headers that users include, and those that these include:
#   SOURCE/optim/train/train.hpp -> INCLUDEDIR/optim/train/train.hpp
# The exported targets have INCLUDEDIR in their include path.
cmake_policy(VERSION 3.25)
set(pending optim/engine/engine.hpp optim/model/renderer.hpp  # gflow::engine
    optim/train/train.hpp optim/runs/train_run.hpp optim/runs/evaluate_run.hpp)  # gflow::train
foreach(room formats motion loss density model)  # to read files, to build losses and motion models on
  file(GLOB headers RELATIVE ${SOURCE} ${SOURCE}/optim/${room}/*.hpp)
  list(APPEND pending ${headers})
endforeach()
set(headers "")
while(pending)
  list(POP_FRONT pending header)
  if(header IN_LIST headers)
    continue()
  endif()
  list(APPEND headers ${header})
  set(file ${SOURCE}/${header})
  if(header MATCHES "^shared/")
    set(file ${SOURCE}/kernels/${header})
  endif()
  get_filename_component(folder ${header} DIRECTORY)
  file(INSTALL ${file} DESTINATION ${CMAKE_INSTALL_PREFIX}/${INCLUDEDIR}/${folder})
  file(STRINGS ${file} includes REGEX "^ *#include \"")
  list(TRANSFORM includes REPLACE "^ *#include \"([^\"]+)\".*" "\\1")
  list(APPEND pending ${includes})
endwhile()
