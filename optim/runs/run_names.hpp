// SPDX-License-Identifier: Apache-2.0
// Names of files in a run folder, and how gflow recognises a run folder and what training may
// replace in it.
#pragma once
#include <filesystem>
#include <string>

namespace gflow {

inline constexpr const char* kRunStamp = "caches.stamp";  // present in every run folder
inline constexpr const char* kRunLock = ".lock";
inline constexpr const char* kRunReport = "report.html";
inline constexpr const char* kRunNotices = "notices.json";  // what training warned of
inline constexpr const char* kRunScene = "scene";           // of a video whose cameras were found
// The first files of a run that has begun, until they are in their places (replacement.hpp).
inline constexpr const char* kRunBegun = ".begun";

// Whether training made the folder: it has the stamp or a scene made from a video, or, if that was
// removed with the caches, settings and a training result. Settings or cameras alone may be
// anybody's.
bool is_made_by_training(const std::filesystem::path& folder);

// Whether a file name is that of a run's results or per_view file, of any split and iteration.
// results_paper.json, for example, is not.
bool is_name_of_results(const std::string& name);

// Whether training writes a file or folder of this name in a run folder.
bool is_name_of_training(const std::string& name);

// Name of a temporary folder of this process for files that are being replaced.
std::string temporary_folder_name(const std::string& stem);

// Whether a file is a temporary whose process has ended, or is not gflow.
bool is_left_behind(const std::string& filename);

}  // namespace gflow
