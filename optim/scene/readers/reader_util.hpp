// SPDX-License-Identifier: Apache-2.0
// What the scene readers share: listing files, paths that stay in the scene, poses, initial points.
#pragma once
#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "optim/scene/camera.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// Names in a folder in natural order (2 before 10); empty when there is no such folder.
std::vector<std::string> list_pictures(const std::string& folder);  // .png .jpg .jpeg
std::vector<std::string> list_folders(const std::string& folder);
std::vector<std::string> list_videos(const std::string& folder);  // .mp4 .avi .mov .mkv .webm

// True where digits compare as numbers: "cam2" < "cam10".
bool natural_less(const std::string& a, const std::string& b);

// The path of `relative` in folder. Error when it is absolute or leaves the folder by "..";
// `source` is the file that named it.
std::string path_inside(const std::string& folder, const std::string& relative,
                        const std::string& source);

// The first of the names (relative to folder) that exists, with its folder; else empty.
std::string first_existing(const std::string& folder, const std::vector<std::string>& names);

// folder/name.
std::string join(const std::string& folder, const std::string& name);

// File name without folder and extension.
std::string stem(const std::string& path);

// World-to-camera from camera-to-world with OpenCV axes (x right, y down, z ahead). The rotation is
// brought to exact orthonormality. Error when a number is not finite or the 3x3 part is no rotation
// within 1e-3; `what` names the pose.
Eigen::Matrix4d viewmat_from_pose(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& position,
                                  const std::string& what);

// Gives a camera the size that a file states [px]. Error that names `where` unless the sides are
// whole numbers from 1 to 999999.
void set_size(Camera& camera, double width, double height, const std::string& where);

// Scales the intrinsics of a camera stored for another size to a picture's. Error when the shapes
// differ by more than 2 % (rounding of odd sizes is less); `source` and `picture` are named.
Camera fitted_to(Camera camera, int width, int height, const std::string& source,
                 const std::string& picture);

// Index of an equal camera (size, intrinsics, lens, pose) in the list, which gets it when it is
// new.
int find_or_add(std::vector<Camera>& cameras, const Camera& camera);

// The first of points3D.ply, points3d.ply, points_t0.ply, fused.ply in the folder, or empty.
std::string find_points_ply(const std::string& folder);

// Initial points of the scene: that PLY, else sparse/0/points3D.{bin,txt,ply}; none when there is
// no such file.
PointCloud find_points(const std::string& folder);

// Times of the frames, rising, each once.
std::vector<double> distinct_times(const std::vector<Frame>& frames);

// Gives each frame the number of the nearest of these times.
void set_steps(const std::vector<double>& times, std::vector<Frame>& frames);

// Sets the flow and mask of a frame when BASE.flo or BASE.flo.gz is there.
void find_true_flow(Frame& frame, const std::string& base, double flow_time);

// The median distance of the points from a place. Precondition: there are points.
double median_distance(const PointCloud& points, const Eigen::Vector3d& from);

// The radius of the training cameras, or their distance from the points: see Scene::extent.
double scene_extent(const Scene& scene);

}  // namespace gflow
