// SPDX-License-Identifier: Apache-2.0
// PoCL compiles kernels one at a time while other cores wait, and caches them in a folder that all
// processes share. If the cache is empty, a second process compiles the kernels of a training step
// while the first one checks the device and reads the scene. Time to the first step (AVX2, two idle
// cores, apps/bench/first_step): 3.7 s instead of 5.8; with flow 4.9 instead of 7.8; hexplane with
// flow 5.3 instead of 8.6. Total CPU time grows by a fifth, so the second process runs at low
// priority.
#pragma once
#include <sys/types.h>

#include <string>

#include "optim/options/train_options.hpp"

namespace gflow {

class CompileAhead {
 public:
  // Construct before any OpenCL call and before any thread starts, because it forks. Does nothing
  // where it cannot help. Errors of the child are not reported: this process meets them as well.
  // device: as for find_device.
  CompileAhead(const std::string& device, const TrainOptions& config);
  // Ends the child, whatever it does. The child also ends when this process ends in any other way.
  ~CompileAhead();
  CompileAhead(const CompileAhead&) = delete;
  CompileAhead& operator=(const CompileAhead&) = delete;

 private:
  pid_t pid_ = -1;  // -1: none
};

}  // namespace gflow
