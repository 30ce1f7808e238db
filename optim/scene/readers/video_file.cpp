// SPDX-License-Identifier: Apache-2.0
// A plain video: one camera, given or placed as for Consistent4D. Times come from the container, so
// that a variable frame rate is kept.
#include <fmt/format.h>

#include <algorithm>
#include <climits>
#include <cstdint>

#include "optim/images/video.hpp"
#include "optim/scene/readers/given_cameras.hpp"
#include "optim/scene/readers/readers.hpp"

namespace gflow {

Scene read_video_file(const std::string& path, const SceneOptions& options) {
  const VideoInfo info = video_info(path);
  // Frames after the last used step need not be decoded.
  const int64_t used =
      options.max_steps > 0
          ? options.first_step + int64_t(options.stride) * (options.max_steps - 1) + 1
          : 0;
  const std::vector<double> stamps = frame_times(path, int(std::min<int64_t>(used, INT_MAX)));
  Scene scene;
  scene.layout = "video";
  // What the container states may be an estimate.
  const double end = stamps.back() + 1 / info.fps;
  if (used > 0) {
    // read in part on purpose
  } else if (double(stamps.size()) < 0.9 * info.frames - 1) {
    scene.notices.push_back(
        fmt::format("video {}: only {} of {} frames could be read; the file seems cut off", path,
                    stamps.size(), info.frames));
  } else if (end < 0.9 * info.seconds - 0.1) {
    scene.notices.push_back(
        fmt::format("video {}: its frames end after {:.2f} of {:.2f} s; the file seems cut off",
                    path, end, info.seconds));
  }
  if (info.interlaced)
    scene.notices.push_back(fmt::format(
        "video {} is interlaced: what moves has combs at its edges; deinterlace it first, for "
        "instance by ffmpeg -i VIDEO -vf bwdif OUTPUT",
        path));
  scene.fps = info.fps;
  scene.has_alpha = info.alpha;
  const bool is_whole = used == 0 || int64_t(stamps.size()) < used;
  const ViewCameras given = cameras_of_view(
      options, {stamps.size(), {}, is_whole, info.width, info.height, path}, scene.notices);
  report_no_poses(options, scene.notices);
  scene.cameras = given.cameras;
  if (scene.cameras.size() == 1) scene.extent = options.radius;
  for (size_t k = 0; k < stamps.size(); ++k) {
    if (given.of_image[k] < 0) continue;
    Frame frame;
    frame.step = int(scene.train.size());
    frame.video_frame = int(k);
    frame.camera = given.of_image[k];
    frame.time = stamps[k];
    frame.path = path;
    frame.name = fmt::format("input_{:04}", k);
    scene.train.push_back(frame);
  }
  scene.steps = int(scene.train.size());
  const double first = scene.train.front().time, last = scene.train.back().time;
  for (Frame& frame : scene.train)
    frame.time = (frame.time - first) / (last > first ? last - first : 1);
  scene.test = scene.train;
  for (Frame& frame : scene.test) frame.name = "test_" + frame.name;
  return scene;
}

}  // namespace gflow
