// SPDX-License-Identifier: Apache-2.0
// A scene as training sees it: cameras, frames with times, initial points. read_scene recognises
// the layout; nothing here opens a picture except to learn its size.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "optim/formats/ply.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

struct Image;  // optim/images/image.hpp

// One image of one camera at one time.
struct Frame {
  int camera = 0;                      // index into Scene::cameras: the pose it was taken from
  int track = 0;                       // which camera of its split filmed it, at rest or moving
  int step = 0;                        // number of the time step, from 0
  double time = 0;                     // [0, 1]
  std::string path;                    // image file, or video when video_frame >= 0
  std::shared_ptr<const Image> image;  // the image itself, of a scene in memory: path names it
  std::string mask_path;  // picture that becomes its alpha (times its own, if any), or empty
  int video_frame = -1;   // which frame of the video
  std::string flow_path;  // true flow to the next step at this camera, or empty
  double flow_time = 0;   // [0, 1] time the true flow leads to
  // Mask of the true flow: 255 seen at both times, 128 hidden at the next, 0 nothing; or empty.
  std::string flow_mask_path;
  std::string depth_path;  // true depth along +z, .npy, or empty
  std::string name;        // unique in the scene, e.g. cam03_0007; usable as a file name
};

// Everything a scene folder says. Frames of train, test and val are sorted by track, then time.
struct Scene {
  std::string name;    // the folder's name, or the video's without extension
  std::string layout;  // video, n3v, panoptic, nerfies, consistent4d, blender, nerfstudio or colmap
  std::string folder;  // or the video
  std::vector<Camera> cameras;
  std::vector<Frame> train, test, val;
  PointCloud points;  // initial points, empty when the scene has none
  // Coordinates of cameras and points are relative to this place of the folder's world, which is 0
  // unless they are so far from its zero that floats would not tell them apart.
  std::array<double, 3> origin = {0, 0, 0};
  double extent = 0;        // > 0, world: radius of the training cameras about their mean position,
                            // or, where they are one camera, its distance from the scene
  std::string tracks_path;  // true paths of surface points, .npy [steps, points, 3], or empty
  int steps = 0;            // number of distinct training times; steps of others are the nearest
  double fps = 0;           // frames per second, > 0; 24 where the scene does not tell
  double near = 0, far = 0;  // depths between which the cameras see anything; 0 where it does not
  bool has_alpha = false;    // pictures carry straight alpha or have masks
  std::vector<std::string> notices;  // of what is there and cannot be used; a sentence each
};

// Which mask pictures count: those that are meant as transparency, also those that label what moves
// (Panoptic's seg/), or none.
enum class Masks { automatic, all, none };

// What a user may say about a scene. Values that do not concern the layout found are ignored.
struct SceneOptions {
  std::string images;  // n3v/colmap/nerfies: picture folder, e.g. images_4, 2x; empty: see there
  Masks masks = Masks::automatic;  // colmap, nerfstudio, panoptic
  int holdout = 0;                 // n3v: index of the camera kept for testing; -1 keeps none
  int test_every = 8;    // colmap/nerfstudio: every n-th picture is a test picture; 0 none
  std::string cameras;   // consistent4d/video: file of the input camera or cameras, or empty
  std::string camera;    // consistent4d/video: the one of them by name, or empty
  double fps = 0;        // > 0 where the scene's own is not to be believed
  double elevation = 0;  // consistent4d/video: of the input camera [deg]
  double radius = 2.0;   // consistent4d/video: its distance from the origin, or from what it films
  double fov_y = 49.1;   // consistent4d/video: vertical field of view [deg]
  bool first_views = false;  // consistent4d: the first picture of each test view is trained on
  // The time steps that are used: first_step, first_step + stride, ..., at most max_steps of them
  // (0: all). Unless that is all, the times of the first and the last become 0 and 1, and true flow
  // between neighbouring steps is forgotten where the stride leaves some out.
  int first_step = 0, stride = 1, max_steps = 0;
  // What coordinates are made relative to: that of the model that the scene is looked at with;
  // without it the scene chooses.
  std::optional<std::array<double, 3>> origin;
};

// Completes a scene that was made in memory, whose cameras, frames (with camera, track, time,
// image) and points are set: time steps, names, order, origin, extent. Error when something
// contradicts itself. read_scene has done so.
void complete_scene(Scene& scene, const SceneOptions& options = {});

// Reads the scene in folder, or video file, `path`. Error when no layout fits (it says what was
// looked for), and when a file is missing, truncated or contradicts another.
Scene read_scene(const std::string& path, const SceneOptions& options = {});

// The point nearest to the axes of all training cameras, or one `extent` ahead where they are
// parallel.
Eigen::Vector3d looked_at(const Scene& scene);

// What tells pictures apart: the pose, the file and the video's frame, the mask.
using PictureId = std::tuple<int, std::string, int, std::string>;
PictureId picture_id(const Frame& frame);

// Whether each of the frames shows a picture of the training split.
bool are_trained_on(const Scene& scene, const std::vector<Frame>& frames);

// Whether a layout has no cameras of its own, so that SceneOptions::cameras may give them.
bool takes_cameras(const std::string& layout);
// Scene::layout of the folder or video `path`; empty when none fits.
std::string layout_of(const std::string& path);

// Two frames of one track, neighbours mostly; a flow leads from `frame`, seen by its camera, to
// `next`, seen by that frame's camera. `next` may be the earlier of the two.
struct FlowPair {
  int frame = 0;  // index into Scene::train
  int next = -1;  // index into Scene::train; -1: along Frame::flow_path, the camera at rest
  int span = 1;   // how many pictures further; 1: neighbours
};

// All pairs (frame, following frame) of a track, neighbours in time; and pairs with next = -1 for
// frames which come with a true flow and whose track has no later frame or one from another pose:
// a true flow is that seen by a camera at rest. In the order of Scene::train.
std::vector<FlowPair> neighbour_pairs(const Scene& scene);

// All pairs (frame, the span-th after it) of a track, span >= 2, in the order of Scene::train.
std::vector<FlowPair> distant_pairs(const Scene& scene, int span);

// Each frame and the next in time, whichever camera took them. Error where several frames have one
// time.
std::vector<FlowPair> pairs_in_time(const Scene& scene);

// Whether the flow of a pair leads back in time.
bool leads_back(const Scene& scene, const FlowPair& pair);

// Each pair that has two frames again, from `next` to `frame`.
std::vector<FlowPair> reversed(const std::vector<FlowPair>& pairs);

}  // namespace gflow
