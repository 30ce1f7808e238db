// SPDX-License-Identifier: Apache-2.0
#include "optim/eval/rendering.hpp"

#include <nlohmann/json.hpp>

#include "optim/images/movie.hpp"
#include "optim/images/video.hpp"
#include "optim/scene/cameras_json.hpp"
#include "runtime/base/interrupt.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/file_size_limit.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

TEST(WriteMovie, HasTheFramesThatItAskedFor) {
  const TemporaryFolder folder;
  std::vector<size_t> asked;
  write_movie(
      folder.file("a.mp4"), 3,
      [&](size_t i) {
        asked.push_back(i);
        return Image{17, 16, 3, std::vector<uint8_t>(17 * 16 * 3, uint8_t(80 * i))};
      },
      10);
  EXPECT_EQ(asked, (std::vector<size_t>{0, 1, 2}));
  const VideoInfo info = video_info(folder.file("a.mp4"));
  EXPECT_EQ(info.frames, 3);
  EXPECT_EQ(info.width, 18);  // even
  EXPECT_DOUBLE_EQ(info.fps, 10);
}

TEST(WriteMovie, LeavesNothingWhenAFrameFails) {
  const TemporaryFolder folder;
  const auto frame = [](size_t i) {
    if (i == 1) throw Error("no such image");
    return Image{16, 16, 3, std::vector<uint8_t>(16 * 16 * 3)};
  };
  expect_error([&] { write_movie(folder.file("a.mp4"), 2, frame, 10); }, {"no such image"});
  EXPECT_EQ(folder.count(), 0u);
}

TEST(WriteMovie, SaysWhyTheDiskTakesNoMore) {
  const auto noisy = [](size_t i) {
    Image image{64, 64, 3, std::vector<uint8_t>(64 * 64 * 3)};
    for (size_t k = 0; k < image.pixels.size(); ++k)
      image.pixels[k] = uint8_t(127 + 127 * noise(uint(i), uint(k)));
    return image;
  };
  const TemporaryFolder folder;
  for (const size_t bytes : {0, 1000, 20000, 60000}) {
    const FileSizeLimit limit(bytes);
    expect_error([&] { write_movie(folder.file("a.mp4"), 30, noisy, 10); },
                 {"a.mp4", "File too large"});
    EXPECT_EQ(folder.count(), 0u) << bytes;
  }
  write_movie(folder.file("a.mp4"), 30, noisy, 10);
  EXPECT_GT(fs::file_size(folder.file("a.mp4")), 60000u);
}

// --- which views

TEST(ParseTimes, ReadsRangesAndLists) {
  EXPECT_EQ(parse_times("0:1:3"), (std::vector<double>{0, 0.5, 1}));
  EXPECT_EQ(parse_times("1:0:2"), (std::vector<double>{1, 0}));
  EXPECT_EQ(parse_times("0.5:1:1"), (std::vector<double>{0.5}));
  EXPECT_EQ(parse_times("0.25"), (std::vector<double>{0.25}));
  EXPECT_EQ(parse_times("0,0.75,0.5"), (std::vector<double>{0, 0.75, 0.5}));
}

TEST(ParseTimes, RefusesEverythingElseAndShowsHow) {
  for (const char* text : {"", "x", "0:1", "0:1:0", "0:1:2.5", "0:1:2:3", "0:2:3", "-0.1", "0,,1",
                           "nan", "0,1x", "0x1p-1", "0:1:99999999999"})
    expect_error([&] { parse_times(text); }, {text, "0:1:40", "0,0.25,1"});
}

struct Made {
  Queue queue = test_queue();
  SmallScene scene{queue};
  LoadedScene loaded = load_scene(small_config(scene, 1).scene, "");
  std::vector<RenderView> test_views() const {
    return split_views(loaded.scene, loaded.scene.test, loaded.frames->cameras(), "test");
  }
};

TEST(Views, OfASplitAreItsFramesWithFlowToTheNextOne) {
  const Made made;
  const std::vector<RenderView> views = made.test_views();
  ASSERT_EQ(views.size(), 5u);
  for (size_t k = 0; k < 5; ++k) {
    EXPECT_EQ(views[k].name, "cam00_000" + std::to_string(k));
    EXPECT_EQ(views[k].movie, "cam00");
    EXPECT_DOUBLE_EQ(views[k].time, double(k) / 4);
    EXPECT_EQ(views[k].truth, &made.loaded.scene.test[k]);
    EXPECT_DOUBLE_EQ(views[k].time_t2, k < 4 ? double(k + 1) / 4 : -1);
    EXPECT_EQ(views[k].truth_t2, k < 4 ? &made.loaded.scene.test[k + 1] : nullptr);
  }
}

TEST(Views, OfACameraHaveTheImagesOfItsFrames) {
  const Made made;
  const Camera camera = camera_named(made.loaded.frames->cameras(), "cam02");
  const std::vector<RenderView> views = camera_views({camera}, {0, 0.3, 0.75}, &made.loaded.scene);
  ASSERT_EQ(views.size(), 3u);
  EXPECT_EQ(views[0].truth->name, "cam02_0000");
  EXPECT_EQ(views[1].truth, nullptr);  // between two time steps
  EXPECT_EQ(views[2].truth->name, "cam02_0003");
  EXPECT_DOUBLE_EQ(views[0].time_t2, 0.3);
  EXPECT_LT(views[2].time_t2, 0);
}

TEST(Views, OfASingleTimeLeadToTheNextStep) {
  const Made made;
  const Camera camera = camera_named(made.loaded.frames->cameras(), "cam02");
  const RenderView view = camera_views({camera}, {0.5}, &made.loaded.scene)[0];
  EXPECT_DOUBLE_EQ(view.time_t2, 0.75);
  EXPECT_EQ(view.truth_t2->name, "cam02_0003");
  EXPECT_LT(camera_views({camera}, {1}, &made.loaded.scene)[0].time_t2, 0);
  EXPECT_LT(camera_views({camera}, {0.5}, nullptr)[0].time_t2, 0);
}

TEST(Views, CamerasWithFewFramesShareAMovie) {
  const Made made;
  std::vector<Frame> frames;
  for (const Frame& frame : made.loaded.scene.train)
    if (frame.step == 2) frames.push_back(frame);
  for (Frame& frame : frames) frame.flow_path.clear();
  const std::vector<RenderView> views =
      split_views(made.loaded.scene, frames, made.loaded.frames->cameras(), "train");
  ASSERT_EQ(views.size(), 3u);
  for (const RenderView& view : views) {
    EXPECT_EQ(view.movie, "train");
    EXPECT_DOUBLE_EQ(view.time_t2, 0.75);  // the next time step
  }
}

TEST(Views, AnUnknownCameraIsAnsweredWithTheKnownOnes) {
  const Made made;
  expect_error([&] { camera_named(made.loaded.frames->cameras(), "cam99"); },
               {"cam99", "cam00, cam01, cam02, cam03"});
}

TEST(Views, CamerasComeBackFromTheJsonOfARun) {
  const Made made;
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  run.write_cameras(*made.loaded.frames, 0.25f);
  const std::vector<Camera> back = read_cameras_json(run.path("cameras.json"), 1);
  ASSERT_EQ(back.size(), 4u);
  for (size_t i = 0; i < 4; ++i) {
    const Camera& camera = made.loaded.scene.cameras[i];
    EXPECT_EQ(back[i].name, camera.name);
    EXPECT_EQ(back[i].width, camera.width);
    EXPECT_EQ(back[i].fx, camera.fx);
    EXPECT_EQ(back[i].near, 0.25);
    EXPECT_LT((back[i].viewmat - camera.viewmat).cwiseAbs().maxCoeff(), 1e-12);
  }
  EXPECT_EQ(read_cameras_json(run.path("cameras.json"), 2)[0].width, 24);
}

TEST(Views, BrokenCamerasAreRefused) {
  const TemporaryFolder folder;
  for (const char* text : {"", "{", "{}", "[]", "[1]", "[{\"width\": 8}]",
                           "[{\"width\":8,\"height\":8,\"fx\":9,\"fy\":9,\"position\":[0,0,0],"
                           "\"rotation\":[[1,0,0],[0,2,0],[0,0,1]]}]",
                           "[{\"width\":8,\"height\":8,\"fx\":9,\"fy\":9,\"position\":[0,0,null],"
                           "\"rotation\":[[1,0,0],[0,1,0],[0,0,1]]}]"}) {
    const std::string path = folder.write("cameras.json", text);
    expect_error([&] { read_cameras_json(path, 1); }, {"cameras.json"});
  }
}

TEST(Views, AnOrbitSeesEveryGaussianUpright) {
  const HostModel model = small_model(true);
  for (const std::string up : {"-y", "z"}) {
    const std::vector<RenderView> views = orbit_views(model, parse_times("0:1:8"), up);
    ASSERT_EQ(views.size(), 8u);
    const Eigen::Vector3d axis = up == "z" ? Eigen::Vector3d(0, 0, 1) : Eigen::Vector3d(0, -1, 0);
    for (const RenderView& view : views) {
      const Camera& c = view.camera;
      const Eigen::Matrix3d r = c.viewmat.topLeftCorner<3, 3>();
      EXPECT_NEAR(r.determinant(), 1, 1e-12);
      EXPECT_LT((r * axis).y(), -0.9);  // up in the image is towards smaller y
      EXPECT_NEAR((r * axis).x(), 0, 1e-12);
      for (size_t i = 0; i < model.count; ++i) {
        const float* m = &model.groups.at("means")[3 * i];
        const Eigen::Vector2d at = c.project({m[0], m[1], m[2]});
        EXPECT_TRUE(at.x() > 0 && at.y() > 0 && at.x() < c.width && at.y() < c.height);
      }
    }
    EXPECT_GT((views[0].camera.position() - views[4].camera.position()).norm(), 2);
  }
  expect_error([&] { orbit_views(model, {0}, "up"); }, {"'up'", "-y"});
}

TEST(Views, ASwayingCameraCirclesAroundWhatItLooksAt) {
  HostModel model = small_model(true);
  std::vector<float>& means = model.groups.at("means");
  for (size_t i = 0; i < model.count; ++i) {  // 4 before the cameras
    means[3 * i] = 0.1f * float(i % 3), means[3 * i + 1] = 0, means[3 * i + 2] = 4;
  }
  Camera camera;
  camera.width = 40, camera.height = 30, camera.fx = camera.fy = 30, camera.cx = 20, camera.cy = 15;
  const std::vector<Camera> cameras{camera, camera};
  const auto views =
      swaying_views(camera_views(cameras, parse_times("0:1:9"), nullptr), model, 10, 8);
  ASSERT_EQ(views.size(), 9u);  // one camera only
  const Eigen::Vector3d target(0, 0, 4);
  double most_side = 0, most_up = 0;
  for (const RenderView& view : views) {
    const Eigen::Vector3d from = view.camera.position() - target;
    EXPECT_LT((view.camera.project(target) - Eigen::Vector2d(20, 15)).norm(), 1e-9);
    EXPECT_NEAR(from.norm(), 4, 1e-9);
    most_side = std::max(most_side, std::asin(std::fabs(from.x()) / 4) / degree);
    most_up = std::max(most_up, std::asin(std::fabs(from.y()) / 4) / degree);
    EXPECT_EQ(view.movie, "sway");
  }
  EXPECT_NEAR(most_side, 10, 0.1);
  EXPECT_NEAR(most_up, 5, 0.1);
  EXPECT_LT((views[8].camera.viewmat - views[0].camera.viewmat).norm(), 1e-9);  // a whole circle
  EXPECT_EQ(views[4].time, 0.5);

  // The circle ends with the video, and a time that is left out is filled in.
  const auto all = camera_views({camera}, parse_times("0,0.25,0.75,1"), nullptr);
  const auto filled = swaying_views(all, model, 10, 100);
  ASSERT_EQ(filled.size(), 5u);
  EXPECT_EQ(filled[2].time, 0.5);
  // Times a millionth apart do not ask for a million views.
  const auto uneven = camera_views({camera}, parse_times("0,1e-6,2e-6,1"), nullptr);
  EXPECT_LT(swaying_views(uneven, model, 10, 100).size(), 200u);
  const double fifth = 2 * M_PI / 5;
  EXPECT_NEAR(std::fabs(filled[1].camera.position().x()),
              4 * std::sin(10 * degree * std::sin(fifth)), 0.01);
}

// --- rendering

TEST(RenderViews, WritesEveryKindOfImageAndTheVideos) {
  Made made;
  const TemporaryFolder folder;
  Model model(made.queue, made.scene.truth);
  std::vector<size_t> calls;
  const RenderReport report =
      render_views(made.queue, model, made.test_views(), made.loaded.frames.get(), folder.path(),
                   {}, [&](size_t done, size_t) { calls.push_back(done); });
  EXPECT_EQ(report.views, 5u);
  EXPECT_EQ(report.flows, 4u);
  EXPECT_EQ(report.compared, 5u);
  EXPECT_EQ(calls.size(), 5u);
  EXPECT_EQ(report.movies, (std::vector<std::string>{folder.path() + "/cam00.mp4",
                                                     folder.path() + "/compare_cam00.mp4"}));
  // 5 x (rgb, alpha, depth png, json, npy, compare) + 4 x (flo, png) + 2 videos
  EXPECT_EQ(folder.count(), 5u * 6 + 4 * 2 + 2);
  EXPECT_EQ(video_info(report.movies[0]).frames, 5);
  EXPECT_EQ(video_info(report.movies[1]).width, 5 * 48);
}

TEST(RenderViews, OfTheModelThatDrewTheSceneAreTheScene) {
  Made made;
  const TemporaryFolder folder;
  Model model(made.queue, made.scene.truth);
  render_views(made.queue, model, made.test_views(), made.loaded.frames.get(), folder.path(), {},
               {});
  for (const Frame& frame : made.loaded.scene.test) {
    EXPECT_EQ(read_image(folder.path() + "/rgb/" + frame.name + ".png").pixels,
              read_image(frame.path).pixels);
    if (frame.flow_path.empty()) continue;
    EXPECT_EQ(read_flo(folder.path() + "/flow/" + frame.name + ".flo").uv,
              read_flo(frame.flow_path).uv);
  }
  // Columns: truth, render, error, flow, reference flow.
  const Image row = read_image(folder.path() + "/compare/cam00_0001.png");
  ASSERT_EQ(row.width, 5 * 48);
  for (int y = 0; y < row.height; ++y)
    for (int x = 0; x < 48; ++x)
      for (int c = 0; c < 3; ++c) {
        const auto at = [&](int panel) {
          return row.pixels[size_t(3 * (y * row.width + 48 * panel + x) + c)];
        };
        ASSERT_EQ(at(0), at(1));
        ASSERT_EQ(at(2), 0);
        ASSERT_EQ(at(3), at(4));
      }
}

TEST(RenderViews, DepthIsTheSameInPngAndArray) {
  Made made;
  const TemporaryFolder folder;
  Model model(made.queue, made.scene.truth);
  std::vector<RenderView> views = made.test_views();
  views.resize(1);
  render_views(made.queue, model, views, nullptr, folder.path(), {}, {});
  const std::string base = folder.path() + "/depth/cam00_0000";
  const Array depth = read_npy(base + ".npy");
  EXPECT_EQ(depth.shape, (std::vector<size_t>{40, 48}));
  const std::vector<float> values = depth.as_float();
  // Between the nearest Gaussian of the blob and the wall's far corner, from a camera 3 units away.
  for (const float d : values) EXPECT_TRUE(d > 2.4f && d < 4.8f) << d;
  const double unit = nlohmann::json::parse(contents(base + ".json")).at("unit");
  EXPECT_EQ(unit, 1e-4);                                 // 4.x units in 16 bits
  EXPECT_FALSE(fs::exists(folder.path() + "/compare"));  // no images to compare with
}

TEST(RenderViews, StopsAfterAWholeViewWhenProgressThrows) {
  Made made;
  const TemporaryFolder folder;
  Model model(made.queue, made.scene.truth);
  EXPECT_THROW(render_views(made.queue, model, made.test_views(), nullptr, folder.path(), {},
                            [](size_t done, size_t) {
                              if (done == 2) throw Interrupted("stop");
                            }),
               Interrupted);
  EXPECT_TRUE(fs::exists(folder.path() + "/flow/cam00_0001.png"));
  EXPECT_FALSE(fs::exists(folder.path() + "/rgb/cam00_0002.png"));
}

}  // namespace
}  // namespace gflow
