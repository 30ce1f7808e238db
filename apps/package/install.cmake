# cmake --install: the program, headers and libraries for find_package(gflow), and kernel sources to read
# or modify (GFLOW_KERNEL_DIR). cpack packages them as a .deb.
install(TARGETS gflow RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(CODE "set(SOURCE \"${CMAKE_SOURCE_DIR}\")\nset(INCLUDEDIR \"${CMAKE_INSTALL_INCLUDEDIR}/gflow\")")
install(SCRIPT apps/package/headers.cmake)
install(DIRECTORY kernels/ DESTINATION ${CMAKE_INSTALL_DATADIR}/gflow/kernels
        FILES_MATCHING PATTERN "*.cl" PATTERN "*.h")
install(DIRECTORY apps/presets DESTINATION ${CMAKE_INSTALL_DATADIR}/gflow)
install(FILES ${CMAKE_BINARY_DIR}/completions/gflow DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES ${CMAKE_BINARY_DIR}/completions/_gflow DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions)
if(HELP2MAN)
  install(DIRECTORY ${CMAKE_BINARY_DIR}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
endif()
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})

# Two export sets, so that gflow::engine does not require OpenCV.
set(PACKAGE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/gflow)
install(TARGETS gflow_base gflow_runtime gflow_formats gflow_engine EXPORT engine
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT engine NAMESPACE gflow:: FILE gflowEngineTargets.cmake DESTINATION ${PACKAGE_DIR})
if(OpenCV_FOUND)
  install(TARGETS gflow_scene gflow_networks gflow_guidance gflow_train EXPORT train
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(EXPORT train NAMESPACE gflow:: FILE gflowTrainTargets.cmake DESTINATION ${PACKAGE_DIR})
endif()

include(CMakePackageConfigHelpers)
configure_package_config_file(apps/package/gflowConfig.cmake.in ${CMAKE_BINARY_DIR}/gflowConfig.cmake
                              INSTALL_DESTINATION ${PACKAGE_DIR})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/gflowConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/gflowConfig.cmake ${CMAKE_BINARY_DIR}/gflowConfigVersion.cmake
        optim/images/FindOpenCV.cmake DESTINATION ${PACKAGE_DIR})

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "gflow maintainers <gflow@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Trains moving 3D Gaussian scenes from video on any OpenCL device")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "pocl-opencl-icd | opencl-icd")
set(CPACK_STRIP_FILES ON)
include(CPack)
