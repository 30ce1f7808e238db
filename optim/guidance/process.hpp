// SPDX-License-Identifier: Apache-2.0
// Guidance by another program. Lines of JSON over its standard input and output, pictures in shared
// memory; apps/guidance/README.md has the protocol, gflow_guidance.py beside it the other side.
#pragma once
#include <memory>

#include "optim/guidance/child.hpp"
#include "optim/guidance/guidance.hpp"
#include "optim/guidance/sds.hpp"
#include "optim/guidance/shared_memory.hpp"

namespace gflow {

class ProcessGuidance : public Guidance {
 public:
  // The protocol that is spoken; a program of another one is refused.
  static constexpr int version = 1;

  // Starts the program and waits for its greeting. time_out: for greeting and each answer [s].
  // `rule` is for the timestep that is drawn for the program. GuidanceFailed when it does not greet
  // in time, or as another version.
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
