// SPDX-License-Identifier: Apache-2.0
// Helpers shared by the scene readers: folder listings, paths inside the scene, poses, initial
// points.
#pragma once
#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "optim/scene/camera.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// Names in a folder in natural order (2 before 10); empty if the folder does not exist.
std::vector<std::string> list_images(const std::string& folder);  // .png .jpg .webp .tif ...
// Images at any depth as paths relative to the folder, in no order.
std::vector<std::string> list_images_below(const std::string& folder);
std::vector<std::string> list_folders(const std::string& folder);
std::vector<std::string> list_videos(const std::string& folder);  // .mp4 .avi .mov .mkv .webm
bool has_video_extension(const std::string& path);                // these

// Natural order: digits compare as numbers, "cam2" < "cam10".
bool natural_less(const std::string& a, const std::string& b);

// "a, b, c and 5 more": at most so many names of a list, for messages.
std::string short_list(const std::vector<std::string>& names, size_t most);

// A path with slashes for the backslashes of programs on Windows.
std::string with_slashes(std::string path);

// The path of `relative` in a folder, with_slashes. If it is absolute or leaves the folder by "..",
// the longest end of it that exists there; Error if none does. `source` is the file that named it.
std::string path_inside(const std::string& folder, const std::string& relative,
                        const std::string& source);

// Path of the first of the names (relative to folder) that exists, else empty.
std::string first_existing(const std::string& folder, const std::vector<std::string>& names);

// BASE itself, or BASE with the extension of an image in lower or upper case; empty if neither is a
// file.
std::string find_image(const std::string& base);

// As find_image, else the file of that folder whose name differs in upper and lower case only.
std::string find_image_of_any_case(const std::string& base);

// Counts entries of a file that are left out, to say so once.
class LeftOut {
 public:
  // why: "without an image file"
  explicit LeftOut(const char* why) : why_(why) {}
  void add(const std::string& entry);
  // A notice with the number of entries and the first; Error if they are more than half of `all`.
  void report(size_t all, const std::string& source, std::vector<std::string>& notices) const;

 private:
  const char* why_;
  size_t count_ = 0;
  std::string first_;
};

// folder/name.
std::string join(const std::string& folder, const std::string& name);

// File name without folder and extension.
std::string stem(const std::string& path);

// A name of an image without the extension of an image, if it has one.
std::string without_image_extension(const std::string& name);

// An image name and its number: "frame_0012" is {"frame_", "0012"}; number may be empty.
struct Numbered {
  std::string prefix, number;
};
Numbered split_number(const std::string& stem);

// World-to-camera matrix from a camera-to-world pose with OpenCV axes (x right, y down, looks along
// z). The rotation is made exactly orthonormal. Error if a number is not finite or the rotation is
// not a multiple of an orthonormal one within 1e-3; `what` names the pose.
Eigen::Matrix4d viewmat_from_pose(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& position,
                                  const std::string& what);

// Sets the image size of a camera from a file [px]. Error that names `where` unless both sides are
// integers from 1 to 999999.
void set_size(Camera& camera, double width, double height, const std::string& where);

// Scales the intrinsics of a camera to the size of its image. Error if the aspect ratios differ by
// 2 % or more (rounding of odd sizes is less); `source` and `image` are named in it.
Camera fitted_to(Camera camera, int width, int height, const std::string& source,
                 const std::string& image);

// Index of an equal camera (size, intrinsics, lens, pose) in the list; appends the camera if it is
// new.
int find_or_add(std::vector<Camera>& cameras, const Camera& camera);

// The first of the folder's point clouds with a known name: points3D.ply, points3d.ply,
// points_t0.ply, fused.ply, points3D_multipleview.ply, points3D_downsample2.ply; or empty.
std::string find_points_ply(const std::string& folder);

// For a scene without points: a notice if the folder has a PLY of points with another name.
void report_other_points(const std::string& folder, std::vector<std::string>& notices);

// Initial points of a scene: find_points_ply, else those of the COLMAP model in sparse/; empty if
// there are none (report_other_points).
PointCloud find_points(const std::string& folder, std::vector<std::string>& notices);

// The distinct times of the frames in increasing order.
std::vector<double> distinct_times(const std::vector<Frame>& frames);

// Index of the nearest of these times, the earlier of two.
size_t nearest_time(const std::vector<double>& times, double time);

// Sets each frame's step to the index of the nearest of these times.
void set_steps(const std::vector<double>& times, std::vector<Frame>& frames);

// Sets the true flow and its mask if BASE.flo, BASE.flo.gz or BASE.png (KITTI) exists.
void find_true_flow(Frame& frame, const std::string& base, double flow_time);

// Median distance of the points from a place. Precondition: at least one point.
double median_distance(const PointCloud& points, const Eigen::Vector3d& from);

// Scene::extent: the radius of the training cameras, or for a single camera its distance from the
// points.
double scene_extent(const Scene& scene);

}  // namespace gflow
