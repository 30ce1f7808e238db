// SPDX-License-Identifier: Apache-2.0
// Signal handling while no InterruptGuard exists: at start, between stages, and in commands too
// short to stop in the middle.
#pragma once

namespace gflow {

// Opens closed standard streams on /dev/null; writes to standard output then fail. Call before any
// file is opened: otherwise a file could take the descriptor of a closed stream and receive its
// output.
void open_standard_streams();

// Makes SIGINT, SIGTERM and SIGHUP end the program with one sentence and exit code 128 + signal.
// Signals that are ignored, as under nohup, stay ignored. A file size limit (ulimit -f) or a closed
// pipe makes a write fail with a reason instead of killing the program. A program that was started
// by gflow after let_children_end_with_this() stops as by SIGTERM when that gflow has ended in any
// way.
void set_signals();
void let_children_end_with_this();

}  // namespace gflow
