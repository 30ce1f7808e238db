// SPDX-License-Identifier: Apache-2.0
// From a video of one moving camera to a scene folder with its poses: tracks, reconstruction,
// files.
#pragma once
#include <array>
#include <string>

#include "optim/scene/loaded_scene.hpp"

namespace gflow {

// tracks: gflow's own, of a video. colmap: by the program COLMAP, also of photographs in any order.
enum class CameraMethod { tracks, colmap };
constexpr std::array<const char*, 2> names_of(CameraMethod) { return {"tracks", "colmap"}; }

struct FindCameras {
  CameraMethod method = CameraMethod::tracks;
  double fovy = 0;      // vertical field of view [degrees]; 0: estimated
  bool radial = false;  // estimate radial lens distortion
  bool quiet = false;   // no progress lines
};

// File in the scene folder that says from what it was made.
inline constexpr const char* kMadeFrom = "video.txt";
// Its contents: the path of the video in the first line, then everything else that matters. That of
// another method begins with that of CameraMethod::tracks.
std::string made_from(const Scene& video, const SceneOptions& options, CameraMethod method);
// Whether a folder holds nothing but what a stopped search has left.
bool is_unfinished_scene(const std::string& folder);

// Loads a video or a folder of numbered images, without the notice that it has no poses. Error if
// it is a scene that has cameras.
LoadedScene load_video(const SceneOptions& options);

// Finds the poses of a loaded video and writes the scene (camera_scene.hpp) as `folder`, which must
// be new, empty or unfinished. Until it is complete it holds only the tracks (track_file.hpp), from
// which a search with the same images continues if this one is stopped. Warns of frames that could
// not be placed, and prints what was found. Error if the camera does not move, only turns, or there
// are too few frames. If COLMAP fails, its output is kept as `folder`.colmap.log; otherwise it is
// colmap.log in the scene.
void find_cameras(const LoadedScene& video, const SceneOptions& options, const FindCameras& how,
                  const std::string& folder);

}  // namespace gflow
