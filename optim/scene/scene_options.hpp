// SPDX-License-Identifier: Apache-2.0
// Scene to read, and how to read it (settings scene.*).
#pragma once
#include <array>
#include <cstdint>
#include <string>

#include "optim/images/movie.hpp"
#include "runtime/base/option.hpp"

namespace gflow {

enum class Background { white, black, random };
constexpr std::array<const char*, 3> names_of(Background) { return {"white", "black", "random"}; }

// What mask images mean: black pixels take no part in the training, they are transparent, or they
// are background, which matters less than the rest. automatic: as the programs of the layout take
// them.
enum class Masks { automatic, ignore, alpha, foreground, none };
constexpr std::array<const char*, 5> names_of(Masks) {
  return {"auto", "ignore", "alpha", "foreground", "none"};
}

// What depth files hold: depth in scene units, depth up to a scale and a shift of each image, or
// inverse depth up to these, as networks for single images estimate it.
enum class DepthFiles { metric, scaled, disparity };
constexpr std::array<const char*, 3> names_of(DepthFiles) {
  return {"metric", "scaled", "disparity"};
}

// Times of images: those in the scene's files, or the numbers in the names of images that are
// frames of videos.
enum class Times { files, order };
constexpr std::array<const char*, 2> names_of(Times) { return {"files", "order"}; }

// Background grey, 0 to 255, for rendering and evaluation. Background::random affects training
// steps only and is white here.
constexpr uint8_t shown_level(Background background) {
  return background == Background::black ? 0 : 255;
}

// Settings that do not apply to the layout of the scene are ignored.
struct SceneOptions {
  std::string path;
  int resolution = 1;
  Background background = Background::white;
  int holdout = 0;
  std::string skip_cameras;
  Times times = Times::files;
  std::string time_offsets;
  std::string images;
  Masks masks = Masks::automatic;
  DepthFiles depth = DepthFiles::metric;
  float depth_unit = 0.001f;
  std::string cameras;
  std::string camera;
  bool still = false;
  float fps = 0;
  float elevation = 0;
  float radius = 2;
  float fovy = 49.1f;
  bool first_views = false;
  int test_every = 8;
  int val_every = 0;
  int first_step = 0;
  int stride = 1;
  int max_steps = 0;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("path", self.path, "folder of the scene; `gflow train SCENE` sets it");
    field("resolution", self.resolution, "divisor of the image width and height",
          one_of({1, 2, 4, 8}));
    field(
        "background", self.background,
        "background of transparent images; random: a new colour in each training step, else white");
    field("holdout", self.holdout, "number of the test camera; -1: none (N3V)", at_least(-1));
    field("skip_cameras", self.skip_cameras,
          "names of cameras to leave out, separated by commas: cam03,cam13");
    field(
        "times", self.times,
        "times of the images: as in the files of the scene (files), or by the numbers in the names "
        "of images that are frames of videos (order; nerfstudio, COLMAP)");
    field("time_offsets", self.time_offsets,
          "shifts of cameras in time [frames], for cameras out of sync: cam03=0.5,cam07=-1; frames "
          "of cam03 are then half a frame later than those of the others");
    field("images", self.images,
          "folder with one image per camera (N3V, COLMAP), or in rgb/ (nerfies); empty: found by "
          "name");
    field("masks", self.masks,
          "mask images (mask_path of nerfstudio, masks/ of COLMAP, seg/ of Panoptic): black pixels "
          "are left out of losses and metrics (ignore), transparent (alpha), or background, less "
          "important than the others (foreground, see loss.foreground); none: no masks; auto: "
          "ignore, but none for Panoptic, whose seg/ labels what moves");
    field("depth", self.depth,
          "what depth files hold (depth/, see loss.depth): depth in scene units (metric), depth up "
          "to scale and shift (scaled), or inverse depth up to scale and shift (disparity)");
    field("depth_unit", self.depth_unit,
          advanced("scene units per unit of metric depth files of integers, PNG or .npy (0.001: "
                   "millimetres)"),
          above(0));
    field("cameras", self.cameras,
          "file with the camera, or with one camera per image: cameras.json or transforms.json; "
          "empty: a static camera by scene.elevation, radius and fovy (Consistent4D, video)");
    field("camera", self.camera, "name of the camera in that file, if it has several");
    field("still", self.still,
          "the camera of a video stands still, even where most of the image moves: no search for "
          "its poses");
    field("fps", self.fps, "frames per second; 0: as in the video, else 24",
          zero_or_between(float(slowest_fps), float(fastest_fps)));
    field("elevation", self.elevation,
          "elevation of the camera above the horizon [degrees] (Consistent4D, video)",
          between(-90, 90));
    field("radius", self.radius,
          "distance of the camera from the origin, or of a given camera from its subject [scene "
          "units] (Consistent4D, video)",
          above(0));
    field("fovy", self.fovy, "vertical field of view [degrees] (Consistent4D, video)",
          between(1, 170));
    field("first_views", self.first_views,
          "also train on the first image of each test view (Consistent4D)");
    field("test_every", self.test_every,
          "every n-th image is a test image; 0: none (COLMAP, nerfstudio)", at_least(0));
    field(
        "val_every", self.val_every,
        "hold back every n-th training camera, or of a single camera every n-th image, to measure "
        "during training how well it predicts views that it does not see; 0: none",
        zero_or_between(2, 1000000));
    field("first_step", self.first_step, "first time step to use, from 0", at_least(0));
    field("stride", self.stride, "use every n-th time step from first_step", at_least(1));
    field("max_steps", self.max_steps, "maximum number of time steps; 0: all", at_least(0));
  }
};

}  // namespace gflow
