// SPDX-License-Identifier: Apache-2.0
// Cameras of a plain video or a folder of images: given in a file, or one static camera that looks
// at the origin.
#pragma once
#include <string>
#include <vector>

#include "optim/scene/camera.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// The images of one view in order of time.
struct ViewImages {
  size_t count = 0;                // number of images
  std::vector<std::string> names;  // their file names; empty for the frames of a video
  bool is_whole = true;            // false: the video may have more frames
  int width = 0, height = 0;       // [px]
  std::string source;              // the first image or the video, for messages
};

struct ViewCameras {
  std::vector<Camera> cameras;  // one, or one per image
  std::vector<int> of_image;    // [count]; index into cameras; -1: the image is left out
};

// Without options.cameras: static_camera "input" at azimuth 0. Otherwise from that file, a
// cameras.json or a transforms file (optim/scene/readers/transforms_file.hpp), scaled to the image
// size: the camera named options.camera (folder and extension may be omitted), the only camera, or
// one per image. These belong to the images with their names, or are as many as images, in natural
// order of names. Names of cameras of a video may end in the number of the frame, from 0 or 1, if
// it is clear from which. Images without a camera are left out with a notice. Error if it is not
// clear which camera an image has.
ViewCameras cameras_of_view(const SceneOptions& options, const ViewImages& view,
                            std::vector<std::string>& notices);

inline constexpr const char* kNoPoses =
    "there are no camera poses: the camera is assumed to be static, at scene.elevation and radius "
    "with scene.fovy; if it moves, `gflow cameras` finds its poses, or --cameras gives them";
// The notice kNoPoses if the camera of a video is assumed to be static, because there is no file of
// cameras.
void report_no_poses(const SceneOptions& options, std::vector<std::string>& notices);

}  // namespace gflow
