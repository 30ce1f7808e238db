# Writes every kernel text into one C++ table:
#   cmake -DDIR=<kernels> -DOUT=<file.cpp> -P embed.cmake
file(GLOB_RECURSE names RELATIVE ${DIR} ${DIR}/*.cl ${DIR}/*.h)
set(table "")
foreach(name ${names})
  file(READ ${DIR}/${name} text)
  string(APPEND table "    {\"${name}\", R\"~~(${text})~~\"},\n")
endforeach()
file(WRITE ${OUT} "// Generated from kernels/ by embed.cmake.
#include \"runtime/cl/kernel_sources.hpp\"
namespace gflow {
const std::map<std::string, std::string>& kernel_sources() {
  static const std::map<std::string, std::string> sources = {
${table}  };
  return sources;
}
}  // namespace gflow
")
