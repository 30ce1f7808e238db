// SPDX-License-Identifier: Apache-2.0
// What signals do to the program while no InterruptGuard lives: at start, between stages, and in
// commands too short to stop in the middle.
#pragma once

namespace gflow {

// Before any file is opened, which might take the number of a standard stream that is closed and
// be written to as such: what is closed leads nowhere, but for standard output, where writing
// fails.
void open_standard_streams();

// From now on SIGINT, SIGTERM and SIGHUP end the program with one sentence and exit code 128 +
// signal (those that were ignored, as under nohup, stay so), and a file that meets a size limit
// (ulimit -f) or a pipe that nobody reads fails to be written, with a reason, instead of killing
// the program. One that was started by a gflow after let_children_end_with_this() stops as by
// SIGTERM when that one has ended, however it did.
void set_signals();
void let_children_end_with_this();

}  // namespace gflow
