// SPDX-License-Identifier: Apache-2.0
// Where a command may write: not over what it reads, and not over what a training has written.
#pragma once
#include <string>

namespace gflow {

// Error when `output` is the file `input`, by whatever name; neither need exist.
void require_other_file(const std::string& output, const std::string& input);

// Error where the file would be one of those that trainings write into the folder of their run, or
// lie in a folder of theirs. Others may be put beside them.
void require_no_file_of_run(const std::string& output);

// The same, and Error where no file can be written: told now rather than when all is done. Empty:
// none is asked for. `option` asked for it.
void require_writable(const std::string& option, const std::string& path);

// As require_no_file_of_run, of a folder that is filled with pictures: it may not be the run's own
// either.
void require_no_folder_of_run(const std::string& output);

}  // namespace gflow
