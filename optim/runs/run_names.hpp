// SPDX-License-Identifier: Apache-2.0
// What the folder of a run is known by, and the names that trainings write in it: for those who
// replace them, and for all others, who must not.
#pragma once
#include <filesystem>
#include <string>

namespace gflow {

inline constexpr const char* kRunStamp = "caches.stamp";  // every run folder has it
inline constexpr const char* kRunLock = ".lock";
// In a folder elsewhere to which flow, frames or test of a run is a link: all in it is gflow's.
inline constexpr const char* kOnlyOurs = ".gflow";

// Whether a training has made the folder: it has the stamp, or, where somebody has removed that
// with the caches, settings and something trained. Settings alone, or cameras, are anybody's.
bool is_made_by_training(const std::filesystem::path& folder);

// Whether a file of this name holds figures of a run: results or per_view, of a split or of all, of
// an iteration or the last. That a user calls one results_paper.json makes it none.
bool is_name_of_results(const std::string& name);

// Whether a training writes what is so called in the folder of its run.
bool is_name_of_training(const std::string& name);

// `stem` as a temporary of this process is called, a folder of things that change places.
std::string temporary_folder_name(const std::string& stem);

// Whether a file has the name of a temporary, and the process it was of is no more, or is no gflow.
bool is_left_behind(const std::string& filename);

}  // namespace gflow
