// SPDX-License-Identifier: Apache-2.0
#include "runtime/ranks/ranks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "runtime/base/error.hpp"

#ifdef GFLOW_WITH_MPI
#define OMPI_SKIP_MPICXX 1  // the C interface only
#define MPICH_SKIP_MPICXX 1
#include <mpi.h>
#endif

namespace gflow {

int Ranks::announced() {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"})
    if (const char* value = std::getenv(name)) return std::max(1, std::atoi(value));
  return 1;
}

#ifdef GFLOW_WITH_MPI

namespace {

// Bytes in one call of MPI, whose counts are ints.
constexpr size_t kMostBytes = size_t{1} << 30;

}  // namespace

Ranks::Ranks() {
  int level = 0;
  if (MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SERIALIZED, &level) != MPI_SUCCESS ||
      level < MPI_THREAD_SERIALIZED)
    throw Error("starting MPI: this MPI library does not allow threads; use one that does");
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &count_);
  char name[MPI_MAX_PROCESSOR_NAME] = {};
  int length = 0;
  MPI_Get_processor_name(name, &length);
  machine_.assign(name, size_t(length));
}

Ranks::~Ranks() { MPI_Finalize(); }

std::vector<std::string> Ranks::gather(const std::string& message) {
  const auto ranks = size_t(count_);
  unsigned long long mine = message.size();
  std::vector<unsigned long long> sizes(ranks);
  MPI_Allgather(&mine, 1, MPI_UNSIGNED_LONG_LONG, sizes.data(), 1, MPI_UNSIGNED_LONG_LONG,
                MPI_COMM_WORLD);
  std::vector<std::string> messages(ranks);
  messages[size_t(rank_)] = message;
  // One after the other, since each may be larger than what one call carries.
  for (size_t from = 0; from < ranks; ++from) {
    messages[from].resize(sizes[from]);
    for (size_t at = 0; at < sizes[from]; at += kMostBytes)
      MPI_Bcast(&messages[from][at], int(std::min(kMostBytes, size_t(sizes[from]) - at)), MPI_BYTE,
                int(from), MPI_COMM_WORLD);
  }
  return messages;
}

#else

Ranks::Ranks() {
  if (announced() > 1)
    throw Error(fmt::format(
        "training on {} ranks: this gflow was built without MPI; build it with an MPI library "
        "(libopenmpi-dev), or start it without mpirun",
        announced()));
}

Ranks::~Ranks() = default;

std::vector<std::string> Ranks::gather(const std::string& message) { return {message}; }

#endif

}  // namespace gflow
