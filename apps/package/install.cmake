# cmake --install: the program, headers and libraries for find_package(gflow), and kernel sources to read
# or modify (GFLOW_KERNEL_DIR), and the Python module (apps/python). cpack makes Debian packages of it: the
# component program is `gflow`, dev is `gflow-dev`, python is `python3-gflow`.
install(TARGETS gflow RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
install(DIRECTORY kernels/ DESTINATION ${CMAKE_INSTALL_DATADIR}/gflow/kernels COMPONENT program
        FILES_MATCHING PATTERN "*.cl" PATTERN "*.h")
install(DIRECTORY apps/presets DESTINATION ${CMAKE_INSTALL_DATADIR}/gflow COMPONENT program)
install(FILES ${CMAKE_BINARY_DIR}/completions/gflow COMPONENT program
        DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES ${CMAKE_BINARY_DIR}/completions/_gflow COMPONENT program
        DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions)
if(HELP2MAN)
  install(DIRECTORY ${CMAKE_BINARY_DIR}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program)
endif()
install(FILES apps/package/README.md apps/package/copyright DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT license)  # in no package: Debian has it

install(CODE "set(SOURCE \"${CMAKE_SOURCE_DIR}\")\nset(INCLUDEDIR \"${CMAKE_INSTALL_INCLUDEDIR}/gflow\")"
        COMPONENT dev)
install(SCRIPT apps/package/headers.cmake COMPONENT dev)
install(DIRECTORY apps/example DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT dev)
install(FILES apps/package/copyright DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/gflow-dev COMPONENT dev)

# Two export sets, so that gflow::engine does not require OpenCV.
set(PACKAGE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/gflow)
install(TARGETS gflow_base gflow_runtime gflow_formats gflow_engine EXPORT engine
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev)
install(EXPORT engine NAMESPACE gflow:: FILE gflowEngineTargets.cmake DESTINATION ${PACKAGE_DIR} COMPONENT dev)
if(OpenCV_FOUND)
  install(TARGETS gflow_scene gflow_cameras gflow_networks gflow_guidance gflow_train gflow_experiments gflow_report EXPORT train
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev)
  install(EXPORT train NAMESPACE gflow:: FILE gflowTrainTargets.cmake DESTINATION ${PACKAGE_DIR} COMPONENT dev)
endif()

include(CMakePackageConfigHelpers)
configure_package_config_file(apps/package/gflowConfig.cmake.in ${CMAKE_BINARY_DIR}/gflowConfig.cmake
                              INSTALL_DESTINATION ${PACKAGE_DIR})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/gflowConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/gflowConfig.cmake ${CMAKE_BINARY_DIR}/gflowConfigVersion.cmake
        optim/images/FindOpenCV.cmake DESTINATION ${PACKAGE_DIR} COMPONENT dev)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "gflow maintainers <gflow@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Trains moving 3D Gaussian scenes from video on any OpenCL device")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL program dev)
if(TARGET gflow_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
  install(FILES apps/package/copyright DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/python3-gflow COMPONENT python)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_STRIP_FILES ON)

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME gflow)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS "pocl-opencl-icd | opencl-icd")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS colmap)  # gflow cameras --method colmap

if(TARGET gflow_python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-gflow)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_DESCRIPTION "The Python module gflow: differentiable rendering and training of moving 3D Gaussians.")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
  find_package(Python COMPONENTS Interpreter QUIET)
  math(EXPR next_minor "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
      "python3 (>= 3.${Python_VERSION_MINOR}), python3 (<< 3.${next_minor}), python3-numpy, pocl-opencl-icd | opencl-icd")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS gflow)  # gflow.export, gflow.experiment
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS python3-torch)  # gflow.torch
endif()

set(CPACK_DEBIAN_DEV_PACKAGE_NAME gflow-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_DESCRIPTION "Headers, static libraries and CMake package files for find_package(gflow).")
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS ON)
set(CPACK_COMPONENT_DEV_DEPENDS program)
# What gflowConfig.cmake looks for.
set(dev_packages pkg-config ocl-icd-opencl-dev opencl-clhpp-headers libeigen3-dev libfmt-dev libspdlog-dev
    zlib1g-dev libzip-dev libzstd-dev)
if(OpenCV_FOUND)
  list(APPEND dev_packages nlohmann-json3-dev libtomlplusplus-dev libjpeg-dev libpng-dev libtiff-dev libwebp-dev
       libopencv-core-dev libopencv-imgproc-dev libopencv-video-dev libopencv-calib3d-dev libceres-dev libavformat-dev libavcodec-dev libswscale-dev libavutil-dev)
endif()
if(OPENCV_DNN_LIBRARY)
  list(APPEND dev_packages libopencv-dnn-dev)
endif()
list(JOIN dev_packages ", " CPACK_DEBIAN_DEV_PACKAGE_DEPENDS)
include(CPack)
