// SPDX-License-Identifier: Apache-2.0
// Guidance by another program: JSON lines over its standard input and output, images in shared
// memory. apps/guidance/README.md describes the protocol; gflow_guidance.py beside it is the Python
// side.
#pragma once
#include <memory>

#include "optim/guidance/child.hpp"
#include "optim/guidance/guidance.hpp"
#include "optim/guidance/sds.hpp"
#include "optim/guidance/shared_memory.hpp"

namespace gflow {

class ProcessGuidance : public Guidance {
 public:
  // Protocol version; a program with another one is an Error.
  static constexpr int version = 1;

  // Starts the program and waits for its greeting. time_out: for the greeting and each answer [s].
  // `rule`: for the timestep drawn for the program. GuidanceFailed if it does not greet in time or
  // has another version.
  ProcessGuidance(const std::string& command, double time_out, const SdsRule& rule);

  std::vector<GuidanceAnswer> guide(const GuidanceRequest& request) override;
  std::string name() const override;

 private:
  std::string command_;
  std::chrono::milliseconds time_out_;
  SdsRule rule_;
  Child child_;
  std::unique_ptr<SharedMemory> memory_;  // grows when a request needs more
};

}  // namespace gflow
