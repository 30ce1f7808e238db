// SPDX-License-Identifier: Apache-2.0
// PoCL compiles one kernel after the other while other cores wait, and keeps them in a folder that
// all processes share. Where it has none yet, a second process has it compile what a training step
// needs while the first checks the device and reads the scene. Until the first step is made (AVX2,
// two quiet cores, apps/bench/first_step): 3.7 s, not 5.8; with flow 4.9, not 7.8; hexplane with
// flow 5.3, not 8.6. It takes a fifth more CPU time in all, so it is nice to whoever else has work.
#pragma once
#include <sys/types.h>

#include <string>

#include "optim/options/train_options.hpp"

namespace gflow {

class CompileAhead {
 public:
  // To be made before anything of OpenCL is called and before there are threads, as it forks; does
  // nothing where it cannot help. Nothing that goes wrong in that process is told: this one comes
  // to it, too. device: as find_device takes it.
  CompileAhead(const std::string& device, const TrainOptions& config);
  // Ends that process, wherever it is; so does the end of this process, however it comes.
  ~CompileAhead();
  CompileAhead(const CompileAhead&) = delete;
  CompileAhead& operator=(const CompileAhead&) = delete;

 private:
  pid_t pid_ = -1;  // -1: there is none
};

}  // namespace gflow
