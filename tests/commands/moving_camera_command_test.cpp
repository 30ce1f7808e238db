// SPDX-License-Identifier: Apache-2.0
// `gflow train` on the images of one moving camera, from poses to a model in which little moves.
#include "optim/movers/motion_masks.hpp"
#include "tests/support/blender_frame.hpp"
#include "tests/support/command.hpp"
#include "tests/support/room_video.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

class MovingCameraCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    room_ = new RoomVideo({0.05, 0, 0.03});
    std::string frames;
    for (int k = 0; k < RoomVideo::frames; ++k) {
      write_png(folder_->file(fmt::format("scene/images/{:02}.png", k)),
                room_->video.images[size_t(k)]);
      frames += (k ? "," : "") + blender_frame(room_->video.cameras[size_t(k)],
                                               fmt::format("images/{:02}", k),
                                               room_->all[size_t(k)].time);
    }
    folder_->write("scene/transforms_train.json",
                   fmt::format(R"({{"fl_x": {}, "w": {}, "h": {}, "frames": [{}]}})",
                               RoomVideo::focal, RoomVideo::width, RoomVideo::height, frames));
    ASSERT_EQ(gflow(train("whole")).code, 0);
  }
  static void TearDownTestSuite() {
    delete folder_;
    delete room_;
  }

  static std::string run(const std::string& name) { return folder_->path() + "/" + name; }
  static std::vector<std::string> train(const std::string& name) {
    std::vector<std::string> arguments{"train", run("scene"), "-o", run(name), "--quiet"};
    for (const char* set :
         {"train.iterations=60", "train.checkpoint_every=20", "init.background=400",
          "init.dynamic=300", "density.cap=5000", "nodes.count=16", "motion.sh_degree=0"}) {
      arguments.push_back("--set");
      arguments.push_back(set);
    }
    return arguments;
  }
  // A training killed once it has the checkpoint of this step. Later ones are removed.
  static void kill_after(int step, const std::vector<std::string>& arguments) {
    const CheckpointFolder checkpoints = RunFolder(run("killed")).checkpoints();
    const Command command(arguments);
    ASSERT_TRUE(wait_until([&] { return fs::exists(checkpoints.path(step)); }));
    command.send(SIGKILL);
    command.wait();
    for (const int later : checkpoints.steps())
      if (later > step) fs::remove(checkpoints.path(later));
    ASSERT_EQ(checkpoints.steps(), std::vector<int>{step});
  }
  static Outcome resume(const std::string& name) {
    return gflow({"train", "-o", run(name), "--resume"});
  }
  static HostModel model_of(const std::string& name) {
    return read_model(RunFolder(run(name)).model_path(60));
  }

  static TemporaryFolder* folder_;
  static RoomVideo* room_;
};
TemporaryFolder* MovingCameraCommand::folder_ = nullptr;
RoomVideo* MovingCameraCommand::room_ = nullptr;

TEST_F(MovingCameraCommand, WritesMasksOfWhatMoves) {
  Scene scene;
  for (const auto& entry : std::filesystem::directory_iterator(run("whole") + "/moving")) {
    Frame frame;
    frame.name = entry.path().stem().string();
    scene.train.push_back(frame);
  }
  ASSERT_EQ(scene.train.size(), size_t(RoomVideo::frames));
  std::sort(scene.train.begin(), scene.train.end(),
            [](const Frame& a, const Frame& b) { return a.name < b.name; });
  std::vector<Mask> masks;
  for (auto& [name, mask] : read_motion_masks(run("whole") + "/moving", scene))
    masks.push_back(mask);
  EXPECT_GT(overlap(masks, room_->moving), 0.6);
}

TEST_F(MovingCameraCommand, OnlyWhatMovesMayMove) {
  Queue queue = test_queue();
  const HostModel host = model_of("whole");
  EXPECT_GT(host.num_moving(), 50u);
  EXPECT_GT(host.count, 5 * host.num_moving());
  Model model(queue, host);
  const size_t moving = host.num_moving();
  // From frame to frame, as far as Gaussians are visible in both.
  double moved = 0, weight = 0;
  std::vector<float> before, visible_before;
  for (int k = 0; k < RoomVideo::frames; ++k) {
    GaussiansAt at;
    model.motion->at(queue, model.parameters, model.time(k / (RoomVideo::frames - 1.)), nullptr,
                     at);
    const std::vector<float> means = at.means.read(queue), opacities = at.opacities.read(queue);
    for (size_t i = 0; i < moving && k > 0; ++i) {
      const double visible = double(std::min(opacities[i], visible_before[i]));
      if (visible == 0) continue;  // it has no mean
      moved += visible * double(means[3 * i] - before[3 * i]);
      weight += visible;
    }
    if (k > 0) {
      EXPECT_TRUE(std::equal(means.begin() + long(3 * moving), means.end(),
                             before.begin() + long(3 * moving)));
    }
    before = means, visible_before = opacities;
  }
  EXPECT_NEAR(moved / weight, 0.05, 0.02);
}

TEST_F(MovingCameraCommand, ResumesWithTheSameBytesAndIsReplaced) {
  const Command command(train("stopped"));
  const std::string checkpoint = RunFolder(run("stopped")).checkpoints().path(20);
  ASSERT_TRUE(wait_until([&] { return fs::exists(checkpoint); }));
  command.send(SIGTERM);
  EXPECT_NE(command.wait().code, 0);
  const Outcome resumed = resume("stopped");
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  EXPECT_EQ(model_of("stopped").groups, model_of("whole").groups);

  // Replaced by a run of other masks.
  const std::string mask = run("stopped") + "/moving/images_00.png";
  ASSERT_TRUE(fs::exists(mask));
  write_file_atomically(mask, "of the previous run");
  std::vector<std::string> again = train("stopped");
  for (const char* more : {"--overwrite", "--set", "train.iterations=1"}) again.push_back(more);
  const Outcome replaced = gflow(again);
  ASSERT_EQ(replaced.code, 0) << replaced.err;
  EXPECT_GT(fs::file_size(mask), 50u);  // a PNG again
}

TEST_F(MovingCameraCommand, TheInitialModelIsMadeOnce) {
  fs::remove_all(run("killed"));
  kill_after(0, train("killed"));
  expect_refused(train("killed"), {"stopped at step 0 of 60", "--resume` continues it"});
  const Outcome resumed = resume("killed");
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  const std::string shown = resumed.out + resumed.err;
  EXPECT_NE(shown.find("continuing from"), std::string::npos) << shown;
  EXPECT_EQ(shown.find("background"), std::string::npos) << shown;
  EXPECT_EQ(model_of("killed").groups, model_of("whole").groups);

  // A run that replaces another has its folder after the first step.
  std::vector<std::string> again = train("killed");
  again.push_back("--overwrite");
  kill_after(1, again);
  ASSERT_EQ(resume("killed").code, 0);
  EXPECT_EQ(model_of("killed").groups, model_of("whole").groups);
}

TEST_F(MovingCameraCommand, StartsOverWithAWarningWithoutACheckpoint) {
  fs::remove_all(run("killed"));
  kill_after(0, train("killed"));
  fs::remove(RunFolder(run("killed")).checkpoints().path(0));
  std::vector<std::string> again = train("killed");
  for (const char* more : {"--set", "train.iterations=1"}) again.push_back(more);
  const Outcome outcome = gflow(again);
  EXPECT_EQ(outcome.code, 0);
  EXPECT_NE(outcome.err.find("stopped before its first checkpoint"), std::string::npos)
      << outcome.err;
}

}  // namespace
}  // namespace gflow
