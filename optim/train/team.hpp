// SPDX-License-Identifier: Apache-2.0
// The devices of this process among those of all: each has a thread and a Seat.
#pragma once
#include <condition_variable>
#include <functional>
#include <mutex>

#include "optim/train/seat.hpp"

namespace gflow {

// Says one message of this process and returns those of all processes, in their order. For one
// thread at a time.
using Gather = std::function<std::vector<std::string>(const std::string&)>;

// Where a process is among all.
struct ProcessPlace {
  size_t process = 0;   // number of this one
  std::string machine;  // name of its machine; "": there is one process only
  Gather gather;        // empty: there is one process only
};

class Team {
 public:
  // devices: those of this process. All processes make their Team together.
  Team(size_t devices, ProcessPlace place = {});
  Team(const Team&) = delete;
  Team& operator=(const Team&) = delete;

  size_t devices() const { return devices_; }  // of all processes
  Seat& seat(size_t device) { return *seats_[device]; }
  // Bytes that this process has sent to others so far.
  size_t sent() const { return sent_; }

 private:
  class SeatHere;
  std::shared_ptr<const Messages> swap(size_t device, std::string message);
  Messages swap_with_others();

  ProcessPlace place_;
  size_t first_ = 0, devices_;  // number of this process's first device, of all devices
  std::vector<std::unique_ptr<Seat>> seats_;
  std::mutex mutex_;
  std::condition_variable all_here_;
  Messages here_;  // of this process's devices
  size_t arrived_ = 0, turn_ = 0, sent_ = 0;
  std::shared_ptr<const Messages> result_;
  std::string failed_;  // why processes no longer reach each other; "": they do
};

}  // namespace gflow
