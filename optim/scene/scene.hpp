// SPDX-License-Identifier: Apache-2.0
// A scene as training uses it: cameras, frames with times, initial points. read_scene recognises
// the layout. Images are opened only to read their size.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "optim/formats/ply.hpp"
#include "optim/scene/camera.hpp"
#include "optim/scene/scene_options.hpp"

namespace gflow {

struct Image;  // optim/images/image.hpp

// One image of one camera at one time.
struct Frame {
  int camera = 0;    // index into Scene::cameras, the pose of the image
  int track = 0;     // id of the static or moving camera that took it, within its split
  int step = 0;      // index of the time step, from 0
  double time = 0;   // [0, 1]
  std::string path;  // image, or video if video_frame >= 0
  std::shared_ptr<const Image> image;  // the image itself, of a scene in memory: path names it
  std::string mask_path;               // mask image (Scene::masks), or empty
  // The mask itself, one channel, of the undistorted image in any size: mask_path names it.
  std::shared_ptr<const Image> mask;
  int video_frame = -1;   // index of the video frame
  std::string flow_path;  // true flow to the next step seen by this camera held static, or empty
  double flow_time = 0;   // [0, 1]; target time of the true flow
  // Mask of the true flow: 255 visible at both times, 128 occluded at the target time, 0 no
  // surface; or empty.
  std::string flow_mask_path;
  std::string depth_path;  // depth map (depth_map.hpp), or empty
  std::string name;        // unique in the scene and valid as a file name, e.g. cam03_0007
};

// The contents of a scene. Frames of train, test and val are sorted by track, then time.
struct Scene {
  std::string name;    // name of the folder, or of the video without extension
  std::string layout;  // its name in the table of scene.cpp; empty for a scene in memory
  std::string folder;  // folder of the scene, or path of the video
  std::vector<Camera> cameras;
  std::vector<Frame> train, test, val;
  PointCloud points;  // initial points; empty if the scene has none
  // Coordinates of cameras and points are relative to this place in the folder's world. It is zero
  // unless they are so far from zero that floats could not separate them.
  std::array<double, 3> origin = {0, 0, 0};
  double extent = 0;  // > 0, world; radius of the training cameras about their mean position, or
                      // for a single camera its distance from the scene
  std::string tracks_path;   // true paths of surface points, .npy [steps, points, 3], or empty
  int steps = 0;             // number of distinct training times; other views have the nearest step
  double fps = 0;            // frames per second, > 0; 24 if the scene has no value
  double near = 0, far = 0;  // depth range seen by the cameras; 0 if unknown
  // Distance along the axis of a camera from which Gaussians are drawn [scene units]; 0: not known
  // yet (complete_scene).
  double near_plane = 0;
  bool estimated_cameras = false;    // by `gflow cameras`, so training may correct them
  bool has_alpha = false;            // images have straight alpha, or masks that mean it
  Masks masks = Masks::alpha;        // what the frames' masks mean: ignore, alpha or foreground
  std::vector<std::string> notices;  // what was left out or assumed, one sentence each
};

// Completes a scene that was made in memory, whose cameras, frames (with camera, track, time,
// image) and points are set: time steps, names, order, origin, extent. Error when something
// contradicts itself. read_scene has done so.
// origin: the world origin of the model that will be shown with the scene; by default the scene
// chooses one.
void complete_scene(Scene& scene, const SceneOptions& options = {},
                    const std::optional<std::array<double, 3>>& origin = std::nullopt);

// Reads a scene folder or a video file. Error if no layout fits (lists what was looked for), or a
// file is missing, truncated or contradicts another.
Scene read_scene(const std::string& path, const SceneOptions& options = {},
                 const std::optional<std::array<double, 3>>& origin = std::nullopt);

// The point nearest to the optical axes of all training cameras; if these are parallel, the point
// at distance `extent` in front of the cameras.
Eigen::Vector3d focus_point(const Scene& scene);

// Share of the initial points that are in front of and inside the image of a training camera, in
// [0, 1]; of many points a sample is taken. 1 without points.
double share_of_points_in_view(const Scene& scene);

// Setting render.near: its value, or Scene::near_plane if it is 0.
inline float near_or_default(float near, const Scene& scene) {
  return near > 0 ? near : scene.near_plane > 0 ? float(scene.near_plane) : 0.05f;
}

// Identity of an image: pose, file, video frame, mask.
using ImageId = std::tuple<int, std::string, int, std::string>;
ImageId image_id(const Frame& frame);

// Whether every frame shows an image of the training split.
bool are_training_images(const Scene& scene, const std::vector<Frame>& frames);

// Whether a layout has no cameras of its own, so that SceneOptions::cameras may supply them.
bool takes_cameras(std::string_view layout);
// Whether z points up in all scenes of a layout.
bool is_z_up(std::string_view layout);
// Whether the cameras of a layout are several that film at the same time.
bool is_rig(std::string_view layout);
// Scene::layout of a folder or video; empty if none fits.
std::string layout_of(const std::string& path);

// Flow from one frame to another of the same track (of any track in pairs_in_time), usually to the
// next one. Each is seen by its own camera. `next` may be the earlier frame.
struct FlowPair {
  int frame = 0;  // index into Scene::train
  int next = -1;  // index into Scene::train; -1: use Frame::flow_path, camera held static
  int span = 1;   // distance in frames; 1: neighbours
};

// All pairs of consecutive frames of a track, in the order of Scene::train. Adds a pair with next =
// -1 for a frame with a true flow if its track has no later frame or the next one has another pose:
// true flow assumes a static camera.
std::vector<FlowPair> neighbour_pairs(const Scene& scene);

// All pairs (frame, span-th frame after it) of a track, span >= 2, in the order of Scene::train.
std::vector<FlowPair> distant_pairs(const Scene& scene, int span);

// Each frame and the next in time, whichever camera took them. Error if two frames have the same
// time.
std::vector<FlowPair> pairs_in_time(const Scene& scene);

// Whether the flow of a pair leads back in time.
bool is_backward_in_time(const Scene& scene, const FlowPair& pair);

// The pairs that have two frames, reversed.
std::vector<FlowPair> reversed(const std::vector<FlowPair>& pairs);

}  // namespace gflow
