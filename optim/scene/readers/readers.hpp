// SPDX-License-Identifier: Apache-2.0
// The scene layouts, one reader and one recogniser each; read_scene asks them in turn.
#pragma once
#include <string>

#include "optim/scene/scene.hpp"

namespace gflow {

// A video file of one camera: options.cameras, else at rest as in read_consistent4d:
// options.elevation, radius, fov_y. Frames and their times are counted by decoding. The test views
// are the training views.
Scene read_video_file(const std::string& path, const SceneOptions& options);

// D-NeRF / Blender: transforms_train.json, optionally transforms_{test,val}.json. OpenGL
// camera-to-world matrices, times in [0, 1] (0 when absent), intrinsics for all or each frame. What
// belongs to one moving camera is found by find_tracks.
bool is_blender(const std::string& folder);
Scene read_blender(const std::string& folder, const SceneOptions& options);

// Plenoptic video / N3V: poses_bounds.npy with camNN/images/ (preferred) or camNN.mp4, or with one
// picture a camera in images/ or images_N/: options.images, else the smallest size that is there
// (the greatest N). Camera options.holdout becomes the test camera. Points of a COLMAP model with
// as many pictures as there are cameras are aligned to the poses, and left out when that fails.
bool is_n3v(const std::string& folder);
Scene read_n3v(const std::string& folder, const SceneOptions& options);

// Consistent4D: numbered pictures (0.png, 1.png, ... or frame_0001.jpg, ...) of one camera in
// input/ or the folder itself, RGBA or plain, with test views in eval_0 ... eval_3 at azimuths -75,
// 15, 105 and 195 degrees. The input camera is that of options.cameras, or stands at azimuth 0.
// Times are as the numbers, so that pictures left out leave a gap. Without eval views the input
// view is the test view. An input/ beside sparse/0/ holds what COLMAP was given, and is no such
// view.
bool has_input_view(const std::string& folder);
bool has_numbered_pictures(const std::string& folder);
Scene read_consistent4d(const std::string& folder, const SceneOptions& options);

// nerfstudio: transforms.json. As Blender, with lens distortion (k1 ... k4, p1, p2; fisheye by
// camera_model) and mask_path; train_filenames, val_filenames and test_filenames where the file has
// them, else every options.test_every-th picture by name is a test picture. Points of
// ply_file_path. Without times a static scene.
bool is_nerfstudio(const std::string& folder);
Scene read_nerfstudio(const std::string& folder, const SceneOptions& options);

// nerfies, HyperNeRF: dataset.json (train_ids, val_ids), metadata.json (time_id, warp_id or
// appearance_id: the time), scene.json (scale, center), camera/ID.json, rgb/Nx/ID.png
// (options.images, else the largest pictures). Views of val_ids are for the test.
bool is_nerfies(const std::string& folder);
Scene read_nerfies(const std::string& folder, const SceneOptions& options);

// Panoptic Studio as in Dynamic 3D Gaussians: train_meta.json and test_meta.json (w, h, k, w2c, fn,
// cam_id), pictures in ims/, points in init_pt_cld.npz. seg/ counts as masks for Masks::all.
bool is_panoptic(const std::string& folder);
Scene read_panoptic(const std::string& folder, const SceneOptions& options);

// COLMAP: sparse/0/ and a picture folder (options.images, else images). A static scene, one step.
// masks/NAME or masks/NAME.png is the alpha of picture NAME.
bool is_colmap(const std::string& folder);
Scene read_colmap(const std::string& folder, const SceneOptions& options);

}  // namespace gflow
