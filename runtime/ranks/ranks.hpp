// SPDX-License-Identifier: Apache-2.0
// The processes that mpirun has started together (MPI ranks). Without MPI at build time, or if this
// process was started by itself, there is one. Nothing but MPI talks to other machines.
#pragma once
#include <string>
#include <vector>

namespace gflow {

class Ranks {
 public:
  // The number of processes that mpirun, or another launcher of MPI, says that it started; 1: none.
  static int announced();

  // Joins them. Error if there are several and gflow was built without MPI.
  Ranks();
  // Leaves them. Waits for the others.
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  int rank() const { return rank_; }
  int count() const { return count_; }
  const std::string& machine() const { return machine_; }

  // Says one message and returns those of all ranks, in their order. Waits for them. For one thread
  // at a time.
  std::vector<std::string> gather(const std::string& message);

 private:
  int rank_ = 0, count_ = 1;
  std::string machine_;
};

}  // namespace gflow
