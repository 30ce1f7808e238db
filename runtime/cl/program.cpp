// SPDX-License-Identifier: Apache-2.0
// Reading, include expansion and building of kernel files.
#include "runtime/cl/program.hpp"

#include <fmt/format.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <mutex>
#include <set>
#include <sstream>

#include "runtime/cl/chunks.hpp"
#include "runtime/cl/kernel_sources.hpp"
#include "runtime/cl/pocl_cache.hpp"
#include "runtime/cl/program_cache.hpp"

namespace gflow {
namespace {

// Guarded by registered_mutex.
std::map<std::string, std::string>& registered_kernels() {
  static std::map<std::string, std::string> texts;
  return texts;
}
std::mutex registered_mutex;

std::string kernel_text(const std::string& file) {
  {
    const std::lock_guard<std::mutex> lock(registered_mutex);
    const auto own = registered_kernels().find(file);
    if (own != registered_kernels().end()) return own->second;
  }
  if (const char* folder = std::getenv("GFLOW_KERNEL_DIR"); folder && *folder) {
    std::ifstream in(std::string(folder) + "/" + file, std::ios::binary);
    if (!in) throw Error("there is no kernel file " + file + " in GFLOW_KERNEL_DIR = " + folder);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  const auto found = kernel_sources().find(file);
  if (found == kernel_sources().end()) throw Error("there is no kernel file " + file);
  return found->second;
}

// The x of a line #include "x"; empty for any other line.
std::string included_file(const std::string& line) {
  const std::string start = "#include \"";
  if (line.compare(0, start.size(), start) != 0) return "";
  return line.substr(start.size(), line.find('"', start.size()) - start.size());
}

void expand(const std::string& file, std::set<std::string>& done, std::ostream& out) {
  if (!done.insert(file).second) return;
  std::istringstream in(kernel_text(file));
  std::string line;
  out << "#line 1 \"" << file << "\"\n";
  for (int number = 1; std::getline(in, line); ++number) {
    const std::string other = included_file(line);
    if (other.empty()) {
      out << line << "\n";
      continue;
    }
    // C++ headers (.hpp) are inside #ifdef branches that OpenCL C never takes.
    if (other.find(".hpp") == std::string::npos) expand(other, done, out);
    out << "#line " << number + 1 << " \"" << file << "\"\n";
  }
}

cl::Program built_from_source(Queue& queue, const std::string& source, const std::string& options) {
  cl::Program program(queue.context, source);
  program.build(queue.device, options.c_str());
  return program;
}

// PoCL gives no reason if a file could not be written.
cl::Program built_with_reasons(Queue& queue, const std::string& file, const std::string& source,
                               const std::string& options) {
  try {
    return built_from_source(queue, source, options);
  } catch (const cl::Error& problem) {
    const bool of_build = problem.err() == CL_BUILD_PROGRAM_FAILURE && is_pocl(queue.info);
    const std::string why = of_build ? compile_failure_reason() : "";
    if (why.empty()) throw;
    throw NoRoomForPrograms(fmt::format("compiling {}: {}", file, why));
  }
}

// Without room LLVM would end the program.
void require_room_for_programs(const DeviceInfo& device, const std::string& file) {
  constexpr uint64_t taken = uint64_t{16} << 20;  // twice what all kernels of a training take
  const std::string problem = is_pocl(device) ? pocl_cache_problem(taken) : "";
  if (!problem.empty()) throw NoRoomForPrograms(fmt::format("compiling {}: {}", file, problem));
}

}  // namespace

void register_kernel(const std::string& file, const std::string& text) {
  const std::lock_guard<std::mutex> lock(registered_mutex);
  if (kernel_sources().count(file) || !registered_kernels().emplace(file, text).second)
    throw Error("there is already a kernel file named " + file);
}

std::string expand_includes(const std::string& file) {
  std::ostringstream out;
  std::set<std::string> done;
  expand(file, done, out);
  return out.str();
}

Program::Program(Queue& queue, const std::string& file, const Defines& defines) : file(file) {
  // -w: else PoCL counts clang's warnings of vectors wider than the registers on stderr.
  std::string options = fmt::format("-cl-std=CL1.2 -w -cl-kernel-arg-info -DLANES={} -DGROUP={}",
                                    queue.lanes, chunk_group(queue));
  for (const auto& [name, value] : defines) options += " -D" + name + "=" + value.text;
  const std::string source = expand_includes(file);

  cl::Program& known = queue.programs[options + "\n" + source];
  if (!known()) {
    require_room_for_programs(queue.info, file);
    known = cl_call("building " + file + " with " + options, [&] {
      const ProgramCache cache(queue, source, options);
      if (auto program = cache.load(queue, options); program()) return program;
      auto program = built_with_reasons(queue, file, source, options);
      cache.store(program);
      return program;
    });
  }
  handle = known;
}

}  // namespace gflow
