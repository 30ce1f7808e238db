// SPDX-License-Identifier: Apache-2.0
// Checks of output paths: a command must not overwrite its inputs or the files of a run.
#pragma once
#include <string>

namespace gflow {

// Throws an Error if `output` is the same file as `input`, by any name; neither needs to exist.
void require_other_file(const std::string& output, const std::string& input);

// Throws an Error if the path is a file that training writes into its run folder, or is inside a
// folder that training creates there. Other files may be put beside them.
void require_no_file_of_run(const std::string& output);

// Also throws an Error if the file cannot be written, so that the command fails before its work.
// An empty path is accepted: no output is requested. `option` names the option in the message.
void require_writable(const std::string& option, const std::string& path);

// As require_no_file_of_run, for a folder of images. It must not be the run folder itself either.
void require_no_folder_of_run(const std::string& output);

}  // namespace gflow
