// SPDX-License-Identifier: Apache-2.0
// The replacement of a run's files, if any, by the first files of a new run. One rename decides:
// before it the folder holds the previous run, untouched; after it the new one, and the replacement
// is pending. What then remains to be done, removing the previous run's files and putting the new
// ones in their places, can be repeated, so the next gflow that opens the folder completes it if
// this process is killed.
#pragma once
#include <functional>

#include "optim/runs/run_folder.hpp"

namespace gflow {

// Begins a run whose lock the caller holds. `write` writes its first files, config.toml among them,
// into the folder that it receives. Error if that fails, or if a file of the previous run could not
// be replaced: then nothing has changed. Later errors say that the previous run is given up.
void begin_run(const RunFolder& run, const std::function<void(const RunFolder& files)>& write);

// Whether a run has begun and the replacement of files is not complete.
bool is_replacement_pending(const RunFolder& run);
// Completes it. Error if a file cannot be removed or renamed.
void complete_replacement(const RunFolder& run, const FileLock&);
// The same; does nothing if another process holds the lock, because that process will do it.
void complete_replacement(const RunFolder& run);

}  // namespace gflow
