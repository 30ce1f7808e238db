// SPDX-License-Identifier: Apache-2.0
// The readers on real scenes and on scenes with ground truth, if these exist beside the repository.
// A clone without them runs only the synthetic scenes of the other tests.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "optim/flow/chained_flow.hpp"
#include "optim/flow/flow_store.hpp"
#include "optim/flow/point_tracks.hpp"
#include "optim/formats/npy.hpp"
#include "optim/images/image_header.hpp"
#include "optim/scene/readers/colmap_model.hpp"
#include "optim/scene/readers/readers.hpp"
#include "runtime/base/worse.hpp"
#include "tests/support/python.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

bool there(const std::string& path) { return std::filesystem::exists(path); }

// Maximum distance between the projections of points by two cameras [px].
double worst_gap(const Camera& a, const Camera& b, const PointCloud& points) {
  double worst = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p(points.xyz[3 * i], points.xyz[3 * i + 1], points.xyz[3 * i + 2]);
    if ((a.viewmat * p.homogeneous()).z() < 0.1) continue;
    worst = worse(worst, (a.project(p) - b.project(p)).norm());
  }
  return worst;
}

// Lower quartile of |flow at the pixel - motion of the projected track| over the tracks on
// confident pixels [px]. At least a quarter of the tracks is on the visible side. Checks camera
// axes, pixel centres, and sign and pairing of the flow at once.
struct TrackGap {
  double quartile = 0;
  size_t tracks = 0;
};
TrackGap track_gap(const Array& tracks, int step, int later, const Camera& camera,
                   const TargetFlow& flow) {
  const std::vector<double> xyz = tracks.as_double();
  const size_t n = tracks.shape[1];
  std::vector<double> gaps;
  for (size_t i = 0; i < n; ++i) {
    const double* p = &xyz[3 * (size_t(step) * n + i)];
    const double* q = &xyz[3 * (size_t(later) * n + i)];
    const Eigen::Vector2d a = camera.project({p[0], p[1], p[2]});
    const Eigen::Vector2d b = camera.project({q[0], q[1], q[2]});
    const int x = int(std::floor(a.x())), y = int(std::floor(a.y()));
    if (x < 0 || y < 0 || x >= camera.width || y >= camera.height) continue;
    const size_t at = size_t(y) * size_t(camera.width) + size_t(x);
    if (!flow.confidence[at]) continue;
    gaps.push_back(
        (Eigen::Vector2d(flow.flow.uv[2 * at], flow.flow.uv[2 * at + 1]) - (b - a)).norm());
  }
  if (gaps.empty()) return {};
  std::sort(gaps.begin(), gaps.end());
  return {gaps[gaps.size() / 4], gaps.size()};
}

double moving_error(const FlowField& flow, const FlowField& truth) {
  double sum = 0, count = 0;
  for (size_t i = 0; i < truth.valid.size(); ++i) {
    const double u = truth.uv[2 * i], v = truth.uv[2 * i + 1];
    if (std::hypot(u, v) <= 1) continue;
    sum += std::hypot(flow.uv[2 * i] - u, flow.uv[2 * i + 1] - v);
    ++count;
  }
  return sum / count;
}

}  // namespace

TEST(SharedScenes, LlffColmapAndTransformsGiveTheSameCameras) {
  const std::string folder = shared("scenes/n3v-sphere");
  if (!there(folder)) return;
  const Scene scene = read_scene(folder);
  EXPECT_EQ(scene.layout, "n3v");
  EXPECT_EQ(scene.cameras.size(), 9u);
  EXPECT_EQ(scene.train.size(), 160u);
  EXPECT_EQ(scene.test.size(), 20u);
  EXPECT_EQ(scene.points.size(), 6908u);
  const ColmapModel model = read_colmap_model(folder + "/sparse/0");
  const Scene blender = read_blender(folder, {});
  ASSERT_EQ(model.images.size(), 9u);
  EXPECT_EQ(blender.cameras.size(), 9u);
  // The matrices are rounded to float32: 6e-8 x 231 px of focal length, magnified for points far
  // off the axis.
  for (size_t i = 0; i < 9; ++i)
    EXPECT_LT(worst_gap(scene.cameras[i], model.images[i].camera, scene.points), 1e-4);
  for (const Frame& frame : blender.train) {
    const size_t i = size_t(std::stoi(frame.name.substr(3, 2)));
    EXPECT_LT(worst_gap(scene.cameras[i], blender.cameras[size_t(frame.camera)], scene.points),
              1e-4);
  }
}

TEST(SharedScenes, PlyAndColmapPointsAgree) {
  const std::string folder = shared("scenes/n3v-sphere");
  if (!there(folder)) return;
  const PointCloud ply = read_point_cloud(folder + "/points3D.ply");
  const PointCloud colmap = read_colmap_points(folder + "/sparse/0");
  EXPECT_EQ(ply.rgb, colmap.rgb);
  for (size_t i = 0; i < ply.xyz.size(); ++i) EXPECT_NEAR(ply.xyz[i], colmap.xyz[i], 1e-5);
}

TEST(SharedScenes, TracksMoveAsTheTrueFlowSays) {
  for (const char* name : {"n3v-sphere", "n3v-baton", "c4d-hammer", "c4d-fox", "dnerf-knight"}) {
    const std::string folder = shared(std::string("scenes/") + name);
    if (!there(folder)) continue;
    const Scene scene = read_scene(folder);
    for (size_t i : {size_t(0), scene.train.size() / 2}) {
      const Frame& frame = scene.train[i];
      if (frame.flow_path.empty()) continue;
      const Camera& camera = scene.cameras[size_t(frame.camera)];
      const TrackGap gap = track_gap(read_npy(folder + "/tracks3d.npy"), frame.step, frame.step + 1,
                                     camera, read_true_flow(frame, camera.width, camera.height));
      EXPECT_GT(gap.tracks, 256u) << name;  // of 512
      // A track is anywhere in its pixel; the flow is that of the centre.
      EXPECT_LT(gap.quartile, 0.2) << name << " " << frame.name;
    }
  }
}

TEST(SharedScenes, TrueFlowChainedFollowsTheTracks) {
  for (const char* name : {"n3v-sphere", "n3v-baton", "c4d-hammer", "c4d-fox"}) {
    const std::string folder = shared(std::string("scenes/") + name);
    if (!there(folder)) continue;
    const Scene scene = read_scene(folder);
    FrameStore frames(scene);
    std::vector<FlowPair> pairs = neighbour_pairs(scene);
    const auto links = std::make_shared<FlowStore>(true_flows(scene, pairs, frames));
    const FlowPair pair = distant_pairs(scene, 4)[2];
    pairs.push_back(pair);
    const TargetFlow chain = chained_flows(links, pairs)[0]();
    const Frame &frame = scene.train[size_t(pair.frame)], &later = scene.train[size_t(pair.next)];
    const TrackGap gap = track_gap(read_npy(folder + "/tracks3d.npy"), frame.step, later.step,
                                   scene.cameras[size_t(frame.camera)], chain);
    EXPECT_GT(gap.tracks, 256u) << name;
    // As above: a track 0.4 px beside the centre rotates around it while the baton turns by 80
    // degrees.
    EXPECT_LT(gap.quartile, 0.5) << name;
  }
}

TEST(SharedScenes, DisChainedReachesWhatItDoesNotInOneLeap) {
  const std::string folder = shared("scenes/n3v-baton");
  if (!there(folder)) return;
  const Scene scene = read_scene(folder);
  const Array tracks = read_npy(folder + "/tracks3d.npy");
  FrameStore frames(scene);
  const auto rgb = [&](size_t f) { return frames.rgb(scene.train[f]); };
  Links there, back;
  for (size_t f = 2; f < 6; ++f) {
    auto [a, b] = estimate_target_flows(*rgb(f), *rgb(f + 1), CameraMotion::none);
    there.push_back(std::make_shared<TargetFlow>(std::move(a)));
    back.insert(back.begin(), std::make_shared<TargetFlow>(std::move(b)));
  }
  const auto gap = [&](const TargetFlow& flow) {
    return track_gap(tracks, 2, 6, scene.cameras[size_t(scene.train[2].camera)], flow);
  };
  const TrackGap chain = gap(chained(there, back)),
                 leap = gap(estimate_target_flows(*rgb(2), *rgb(6), CameraMotion::none).first);
  // Measured: 107 tracks, 1.15 px. With one flow over the whole span, after 80 degrees: 4 tracks
  // and 21 px.
  EXPECT_GT(chain.tracks, 80u);
  EXPECT_LT(chain.quartile, 1.5);
  EXPECT_GT(leap.quartile, 5);
}

TEST(SharedScenes, ComputedAndStoredConsistent4dCamerasAgree) {
  const std::string folder = shared("scenes/c4d-hammer");
  if (!there(folder)) return;
  const Scene scene = read_scene(folder), stored = read_blender(folder, {});
  EXPECT_EQ(scene.layout, "consistent4d");
  EXPECT_EQ(scene.test.size(), 80u);
  EXPECT_TRUE(scene.has_alpha);
  ASSERT_EQ(stored.cameras.size(), 5u);
  for (size_t i = 0; i < 5; ++i)
    EXPECT_LT(worst_gap(scene.cameras[i], stored.cameras[i], scene.points), 1e-4) << i;
}

TEST(SharedScenes, TheKnightHasAPairForEachTrueFlow) {
  const std::string folder = shared("scenes/dnerf-knight");
  if (!there(folder)) return;
  const Scene scene = read_scene(folder);
  EXPECT_EQ(scene.layout, "blender");
  EXPECT_EQ(scene.steps, 60);
  const std::vector<FlowPair> pairs = neighbour_pairs(scene);
  EXPECT_EQ(pairs.size(), 59u);
  for (const FlowPair& pair : pairs) EXPECT_EQ(pair.next, -1);
  EXPECT_EQ(scene.points.size(), 4000u);
}

TEST(SharedScenes, TheMujocoScenesHaveTwelveCameras) {
  for (const char* name : {"scene9_topology", "scene10_texture"}) {
    const std::string folder = shared(std::string("data/dnerf_mujoco/") + name);
    if (!there(folder)) continue;
    const Scene scene = read_scene(folder);
    EXPECT_EQ(scene.cameras.size(), 12u) << name;
    EXPECT_TRUE(scene.has_alpha);
    EXPECT_NO_THROW(FrameStore{scene});
    EXPECT_EQ(neighbour_pairs(scene).size(), scene.train.size() - 12);
  }
}

TEST(SharedScenes, TheRealPlenopticPhotographsAreAStaticScene) {
  const std::string folder = shared("data/dynerf_flame_steak_5v");
  if (!there(folder)) return;
  const Scene scene = read_scene(folder);
  EXPECT_EQ(scene.layout, "n3v");
  EXPECT_EQ(scene.steps, 1);
  EXPECT_EQ(scene.train.size(), 4u);
  EXPECT_EQ(scene.cameras[0].width, 676);
  EXPECT_GT(scene.points.size(), 100u);
  // COLMAP's world differs from that of poses_bounds.npy, so the points were transformed. COLMAP's
  // own cameras and points, for images undistorted to another size, must agree within some pixels
  // in most places.
  const ColmapModel model = read_colmap_model(folder + "/sparse/0");
  for (size_t i = 0; i < 5; ++i) {
    const Camera colmap = reduced(model.images[i].camera, 4);
    std::vector<double> gaps;
    for (size_t k = 0; k < scene.points.size(); ++k) {
      const double *p = &scene.points.xyz[3 * k], *q = &model.points.xyz[3 * k];
      const Eigen::Vector2d b = colmap.project({q[0], q[1], q[2]});
      if (!(b.x() > 0 && b.y() > 0 && b.x() < colmap.width && b.y() < colmap.height)) continue;
      gaps.push_back((scene.cameras[i].project({p[0], p[1], p[2]}) - b).norm());
    }
    std::sort(gaps.begin(), gaps.end());
    EXPECT_LT(gaps[gaps.size() / 2], 4) << model.images[i].name;
  }
}

TEST(SharedScenes, VideosShowWhatTheImagesShow) {
  const std::string folder = shared("scenes/n3v-sphere");
  if (!there(folder)) return;
  const Scene scene = read_scene(folder);
  const std::vector<size_t> steps = {0, 7, 19};
  Scene filmed = scene;
  for (size_t k : steps) {
    filmed.train[k].path = folder + "/cam01.mp4";
    filmed.train[k].video_frame = int(k);
  }
  FrameStore videos(filmed), images(scene);
  for (size_t k : steps) {
    const auto a = videos.rgb(filmed.train[k]), b = images.rgb(scene.train[k]);
    double sum = 0;
    for (size_t i = 0; i < a->pixels.size(); ++i)
      sum += std::pow(double(a->pixels[i]) - double(b->pixels[i]), 2);
    // Documented with the scene: at least 46.69 dB; OpenCV's colour conversion costs some.
    EXPECT_GT(10 * std::log10(255. * 255. * double(a->pixels.size()) / sum), 40) << "step " << k;
  }
}

TEST(SharedScenes, DisReachesItsKnownErrorOnTheSphere) {
  const std::string folder = shared("scenes/n3v-sphere");
  if (!there(folder)) return;
  const Scene scene = read_scene(folder);
  FrameStore store(scene);
  double sum = 0;
  const std::vector<size_t> steps = {0, 3, 6, 9, 12, 15, 18};
  for (size_t k : steps) {
    const Frame& frame = scene.train[k];  // a frame of cam01
    const TargetFlow target_flow =
        estimate_target_flows(*store.rgb(frame), *store.rgb(scene.train[k + 1]), CameraMotion::none)
            .first;
    sum += moving_error(target_flow.flow, read_true_flow(frame, 256, 192).flow);
  }
  // Measured independently with OpenCV in Python: 0.20 px.
  EXPECT_NEAR(sum / double(steps.size()), 0.20, 0.03);
}

TEST(SharedScenes, RealFlowFilesAreRead) {
  const std::string folder = shared("data/flow_kitti");
  if (!there(folder)) return;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string path = entry.path().string();
    if (entry.path().extension() != ".png" || path.find("flow", folder.size()) == path.npos)
      continue;
    const FlowField flow = read_kitti_flow(path);
    double valid = 0, length = 0;
    for (size_t i = 0; i < flow.valid.size(); ++i) {
      valid += flow.valid[i];
      length += std::hypot(flow.uv[2 * i], flow.uv[2 * i + 1]);
    }
    // Documented with the data: 16.2 % valid, mean 51 px.
    EXPECT_NEAR(valid / double(flow.valid.size()), 0.162, 0.0005) << path;
    EXPECT_NEAR(length / valid, 51, 0.5) << path;
  }
}

// The tracks of tracks_of_truth.py equal the scene's true flow at their pixels.
TEST(SharedScenes, TracksOfTruthAgreeWithTheTrueFlow) {
  const std::string folder = shared("scenes/n3v-sphere");
  if (!there(folder) || !has_python()) return;
  const TemporaryFolder out;
  const std::string script = GFLOW_SOURCE_DIR "/apps/experiments/tracks_of_truth.py ";
  ASSERT_EQ(std::system((python() + script + folder + " " + out.path() + " > /dev/null").c_str()),
            0);
  const Scene scene = read_scene(folder);
  const PointTracks tracks = read_point_tracks(out.path() + "/cam03.npz");
  ASSERT_EQ(tracks.frames, 20u);
  EXPECT_EQ(tracks.points, 128u);
  size_t known = 0;
  for (const Frame& frame : scene.train) {
    if (scene.cameras[size_t(frame.camera)].name != "cam03" || frame.step > 17) continue;
    const TargetFlow truth = read_true_flow(frame, 256, 192);
    const TargetFlow told =
        flow_of_points(tracks, size_t(frame.step), size_t(frame.step) + 1, 256, 192);
    for (size_t i = 0; i < truth.flow.valid.size(); ++i) {
      if (!told.flow.valid[i]) continue;
      ++known;
      ASSERT_EQ(truth.confidence[i], 255);
      for (size_t axis : {0, 1})
        ASSERT_NEAR(told.flow.uv[2 * i + axis], truth.flow.uv[2 * i + axis], 0.25);
    }
  }
  EXPECT_GT(known, 18u * 128u / 4);  // the visible side, one point per pixel
}
