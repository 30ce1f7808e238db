// SPDX-License-Identifier: Apache-2.0
// The scene layouts: one reader and one recogniser each. read_scene tries them in turn.
#pragma once
#include <string>

#include "optim/scene/scene.hpp"

namespace gflow {

// A video file of one camera: options.cameras, else a static camera as in read_consistent4d
// (options.elevation, radius, fovy). Frames and times come from decoding. The training views are
// also the test views.
Scene read_video_file(const std::string& path, const SceneOptions& options);

// D-NeRF / Blender: transforms_train.json, optionally transforms_{test,val}.json. OpenGL
// camera-to-world matrices, times (0 if absent; scaled to [0, 1] if one exceeds 1), intrinsics for
// all frames or per frame. find_tracks detects a moving camera.
bool is_blender(const std::string& folder);
Scene read_blender(const std::string& folder, const SceneOptions& options);

// Plenoptic video / N3V: poses_bounds.npy (or 4DGaussians' poses_bounds_multipleview.npy) with
// camNN/images/ (preferred), camNN.mp4 or images in camNN/, or with one image per camera in images/
// or images_N/: options.images, else the smallest images (the largest N). Camera options.holdout is
// the test camera. Points of a COLMAP model are aligned to the poses, and dropped if that fails.
bool is_n3v(const std::string& folder);
Scene read_n3v(const std::string& folder, const SceneOptions& options);

// Consistent4D: numbered images (0.png, 1.png, ... or frame_0001.jpg, ...) of one camera in input/
// or the folder itself, with or without alpha, and test views in eval_0 ... eval_3 at azimuths -75,
// 15, 105 and 195 degrees. The input camera is given by options.cameras or is at azimuth 0. Times
// follow the numbers, so that missing images leave a gap. Without eval views the input view is the
// test view. An input/ beside a COLMAP model is its input and does not count as this layout.
bool has_input_view(const std::string& folder);
bool has_numbered_images(const std::string& folder);
Scene read_consistent4d(const std::string& folder, const SceneOptions& options);

// nerfstudio, instant-ngp: transforms.json. As Blender, with lens distortion (k1 ... k6, p1, p2;
// fisheye by camera_model or is_fisheye) and mask_path. Splits by train_filenames, val_filenames
// and test_filenames if present, else every options.test_every-th image by name is a test image.
// Points from ply_file_path. Without times a static scene.
bool is_nerfstudio(const std::string& folder);
Scene read_nerfstudio(const std::string& folder, const SceneOptions& options);

// nerfies, HyperNeRF, DyCheck: dataset.json (train_ids, val_ids) or splits/train.json and
// splits/val.json, else splits/test.json (frame_names, time_ids), metadata.json (time from time_id,
// warp_id or appearance_id), scene.json (scale, center), camera/ID.json, rgb/Nx/ID.png
// (options.images, else the largest images). val_ids or splits/val.json are the test views.
bool is_nerfies(const std::string& folder);
Scene read_nerfies(const std::string& folder, const SceneOptions& options);

// Panoptic Studio as in Dynamic 3D Gaussians: train_meta.json and test_meta.json (w, h, k, w2c, fn,
// cam_id), images in ims/, points in init_pt_cld.npz. seg/ holds masks, used on request.
bool is_panoptic(const std::string& folder);
Scene read_panoptic(const std::string& folder, const SceneOptions& options);

// COLMAP: the model in sparse/ (find_colmap_model) and an image folder (options.images, else
// images). A static scene of one step.
// Masks by name (find_mask).
bool is_colmap(const std::string& folder);
Scene read_colmap(const std::string& folder, const SceneOptions& options);

}  // namespace gflow
