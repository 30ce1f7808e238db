// SPDX-License-Identifier: Apache-2.0
// What signals do to the program while no InterruptGuard lives: at start, between stages, and in
// commands too short to stop in the middle.
#pragma once

namespace gflow {

// From now on SIGINT, SIGTERM and SIGHUP end the program with one sentence and exit code 128 +
// signal (those that were ignored, as under nohup, stay so), and a file that meets a size limit
// (ulimit -f) fails to be written, with a reason, instead of killing the program.
void set_signals();

}  // namespace gflow
