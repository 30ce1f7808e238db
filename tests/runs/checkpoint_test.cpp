// SPDX-License-Identifier: Apache-2.0
// Checkpoint files: reading returns exactly what was written, or fails.
#include "optim/runs/checkpoint.hpp"

#include <cmath>

#include "tests/support/file_size_limit.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

Checkpoint some_checkpoint(int step) {
  Checkpoint checkpoint;
  checkpoint.facts = {step, 12.5, "[train]\nseed = 3\n", "0badcafe", "a device", "12345678"};
  std::vector<float> means(300);
  for (size_t i = 0; i < means.size(); ++i) means[i] = 0.1f * float(i + size_t(step));
  checkpoint.arrays = {{"gaussians/means", {{100, 3}, means}},
                       {"gaussians/rows/steps", {{100}, std::vector<uint32_t>(100, 7)}},
                       {"density/pull", {{0}, std::vector<float>{}}}};
  return checkpoint;
}

bool same(const Checkpoint& a, const Checkpoint& b) {
  const auto facts = [](const CheckpointFacts& f) {
    return std::tie(f.step, f.seconds, f.config, f.scene, f.device, f.program);
  };
  if (facts(a.facts) != facts(b.facts) || a.arrays.size() != b.arrays.size()) return false;
  for (const auto& [name, array] : a.arrays) {
    const auto found = b.arrays.find(name);
    if (found == b.arrays.end() || found->second.shape != array.shape ||
        found->second.values != array.values)
      return false;
  }
  return true;
}

TEST(Checkpoint, WhatIsWrittenIsReadAgain) {
  const TemporaryFolder folder;
  write_checkpoint(folder.file("a.npz"), some_checkpoint(20));
  EXPECT_TRUE(same(read_checkpoint(folder.file("a.npz")), some_checkpoint(20)));
}

TEST(Checkpoint, HoldsTheShapeOfItsModel) {
  const TemporaryFolder folder;
  Checkpoint checkpoint = some_checkpoint(20);
  EXPECT_FALSE(checkpoint.facts.shape);  // written by an older gflow
  for (size_t kind = 0; kind < names_of(MotionModelKind{}).size(); ++kind) {
    ModelShape shape;
    shape.motion = MotionModelKind(kind);
    shape.sh_degree = 3;
    shape.keys = 7;
    shape.key_scales = 1;
    shape.bases = 5;
    shape.duration = 1.1f;
    shape.cutoff = kind % 2 ? 0.5f : 0.f;
    shape.hexplane.levels = 3;
    shape.hexplane.times = 5;
    shape.hexplane.centre = {-0.1f, 1e-7f, 123.456f};
    shape.hexplane.half_size = {0.3f, 1e9f, 2};
    shape.hexplane.time_spline = 1;
    checkpoint.facts.shape = shape;
    write_checkpoint(folder.file("a.npz"), checkpoint);
    const ModelShape read = read_checkpoint(folder.file("a.npz")).facts.shape.value();
    EXPECT_EQ(read.motion, shape.motion);
    EXPECT_EQ(read.sh_degree, 3);
    std::vector<double> expected, found;
    MotionShape::fields(shape, [&](const char*, auto x, double, double) { expected.push_back(x); });
    MotionShape::fields(read, [&](const char*, auto x, double, double) { found.push_back(x); });
    EXPECT_EQ(found, expected);
  }
}

// Older versions interpolated rows in time linearly and did not say so.
TEST(Checkpoint, FieldsOfOlderVersionsAreLinearInTime) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.npz");
  Checkpoint checkpoint = some_checkpoint(20);
  ModelShape shape;
  shape.motion = MotionModelKind::hexplane;
  shape.hexplane.time_spline = 1;
  shape.hexplane.times = 5;
  checkpoint.facts.shape = shape;
  write_checkpoint(path, checkpoint);
  Arrays arrays = read_npz(path);
  auto& bytes = std::get<std::vector<uint8_t>>(arrays.at("facts").values);
  std::string text(bytes.begin(), bytes.end());
  const std::string number = ",\"time_spline\":1";
  ASSERT_NE(text.find(number), std::string::npos) << text;
  text.erase(text.find(number), number.size());
  bytes.assign(text.begin(), text.end());
  arrays.at("facts").shape = {text.size()};
  write_npz(path, arrays);
  EXPECT_EQ(read_checkpoint(path).facts.shape->hexplane.time_spline, 0);
}

TEST(Checkpoint, ShapesThatNoModelHasAreRefused) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.npz");
  const auto rejected = [&](const char* name, const std::function<void(ModelShape&)>& spoil) {
    Checkpoint checkpoint = some_checkpoint(20);
    checkpoint.facts.shape = ModelShape();
    spoil(*checkpoint.facts.shape);
    write_checkpoint(path, checkpoint);
    expect_error([&] { read_checkpoint(path); }, {path, "is damaged: ", name});
    expect_error([&] { read_checkpoint_facts(path); }, {path, name});
  };
  rejected("'duration'", [](ModelShape& s) { s.duration = 0; });
  rejected("'duration' is null", [](ModelShape& s) { s.duration = INFINITY; });
  rejected("'cutoff'", [](ModelShape& s) { s.cutoff = 1; });
  rejected("'sh_degree' is 1000000", [](ModelShape& s) { s.sh_degree = 1000000; });
  rejected("'sh_degree' is -5", [](ModelShape& s) { s.sh_degree = -5; });
  rejected("origin", [](ModelShape& s) { s.origin[1] = 1e308; });
  rejected("'keys' is 0", [](ModelShape& s) { s.motion = MotionModelKind::keyframes; });
}

TEST(Checkpoint, OfAnotherStepThanItsNameSaysIsRefused) {
  const TemporaryFolder folder;
  const std::string path = folder.file("iteration_30.npz");
  write_checkpoint(path, some_checkpoint(20));
  expect_error([&] { read_checkpoint(path); }, {"iteration_30.npz is damaged", "its step is 20"});
  write_checkpoint(path, some_checkpoint(30));
  EXPECT_EQ(read_checkpoint(path).facts.step, 30);
}

TEST(Checkpoint, APathThatIsNotUtf8IsNoObstacle) {
  const TemporaryFolder folder;
  Checkpoint checkpoint = some_checkpoint(1);
  checkpoint.facts.config = "[scene]\npath = \"/caf\xe9\"\n";
  write_checkpoint(folder.file("a.npz"), checkpoint);
  EXPECT_EQ(read_checkpoint(folder.file("a.npz")).facts.step, 1);
}

// Only bits without meaning (times and versions of the archive) may change. Otherwise reading
// returns what was written or gives a reason.
TEST(Checkpoint, EveryByteThatChangesIsNoticedOrMeansNothing) {
  const TemporaryFolder folder;
  const Checkpoint written = some_checkpoint(20);
  write_checkpoint(folder.file("a.npz"), written);
  const std::string whole = contents(folder.file("a.npz"));
  size_t rejected = 0;
  for (size_t i = 0; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] = char(damaged[i] ^ (1 << i % 8));
    folder.write("damaged.npz", damaged);
    try {
      EXPECT_TRUE(same(read_checkpoint(folder.file("damaged.npz")), written)) << "byte " << i;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("damaged.npz"), std::string::npos) << error.what();
      ++rejected;
    }
  }
  EXPECT_GT(rejected, whole.size() * 4 / 5);
}

TEST(Checkpoint, CutOffAnywhereItIsRefused) {
  const TemporaryFolder folder;
  write_checkpoint(folder.file("a.npz"), some_checkpoint(20));
  const std::string whole = contents(folder.file("a.npz"));
  for (size_t length = 0; length < whole.size(); length += length < 64 ? 1 : 13) {
    folder.write("cut.npz", whole.substr(0, length));
    expect_error([&] { read_checkpoint(folder.file("cut.npz")); }, {"cut.npz"});
  }
}

// Another archive in its place, or a future format.
TEST(Checkpoint, OtherArchivesAndFormatsAreRefusedWithTheReason) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.npz");
  const auto with_facts = [&](const std::string& text) {
    write_npz(path, {{"facts", {{text.size()}, std::vector<uint8_t>(text.begin(), text.end())}}});
  };
  write_npz(path, {{"means", {{1}, std::vector<float>{1}}}});
  expect_error([&] { read_checkpoint(path); }, {"a.npz", "not a checkpoint"});
  with_facts("{");
  expect_error([&] { read_checkpoint(path); }, {"a.npz", "not a checkpoint"});
  with_facts("{\"format\": \"new\"}");
  expect_error([&] { read_checkpoint(path); }, {"a.npz", "not a checkpoint"});
  for (const char* format : {"1", "3"}) {
    with_facts("{\"format\": " + std::string(format) + "}");
    expect_error([&] { read_checkpoint(path); },
                 {"a.npz", std::string("format ") + format, "reads format 2"});
  }
  with_facts("{\"format\": 4294967298}");  // 2 to 32 bits
  expect_error([&] { read_checkpoint(path); }, {"format 4294967298"});
  with_facts("{\"format\": 2, \"config\": " + std::string(200, '[') + std::string(200, ']') + "}");
  expect_error([&] { read_checkpoint(path); }, {"a.npz", "nested more than 100"});
  for (const char* step : {"1099511627776", "-1", "0.5", "\"7\""}) {  // 2^40 is 0 to 32 bits
    with_facts("{\"format\": 2, \"arrays\": {}, \"step\": " + std::string(step) + "}");
    const std::string said = std::string("damaged: its step is ") + step;
    expect_error([&] { read_checkpoint(path); }, {"a.npz", said});
    expect_error([&] { read_checkpoint_facts(path); }, {"a.npz", said});
  }
  with_facts("{\"format\": 2, \"arrays\": {\"gone\": [3]}}");
  expect_error([&] { read_checkpoint(path); }, {"a.npz", "'gone'"});
  const std::string facts = "{\"format\": 2, \"arrays\": {\"means\": [3]}}";
  write_npz(path, {{"facts", {{facts.size()}, std::vector<uint8_t>(facts.begin(), facts.end())}},
                   {"means", {{2}, std::vector<float>{1, 2}}}});
  expect_error([&] { read_checkpoint(path); },
               {"'means'", "a different shape than when it was written"});
}

TEST(CheckpointFolder, KeepsTheLastTwo) {
  const TemporaryFolder folder;
  const CheckpointFolder checkpoints(folder.path() + "/checkpoints");
  EXPECT_FALSE(checkpoints.latest());
  for (const int step : {5, 10, 100}) checkpoints.write(some_checkpoint(step));
  EXPECT_EQ(folder.count(), 2u);
  EXPECT_TRUE(std::filesystem::exists(checkpoints.path(10)));
  EXPECT_TRUE(same(checkpoints.latest()->checkpoint, some_checkpoint(100)));
  std::filesystem::remove_all(folder.path() + "/checkpoints");
  EXPECT_FALSE(checkpoints.latest());
}

TEST(CheckpointFolder, TakesTheOneBeforeADamagedOneAndSaysSo) {
  const TemporaryFolder folder;
  const CheckpointFolder checkpoints(folder.path());
  for (const int step : {10, 20}) checkpoints.write(some_checkpoint(step));
  std::filesystem::resize_file(checkpoints.path(20), 1000);
  testing::internal::CaptureStderr();
  const auto found = checkpoints.latest();
  const std::string said = testing::internal::GetCapturedStderr();
  ASSERT_TRUE(found);
  EXPECT_EQ(found->checkpoint.facts.step, 10);
  EXPECT_EQ(said.rfind("gflow: warning: ", 0), 0u) << said;
  EXPECT_NE(said.find("iteration_20.npz"), std::string::npos) << said;
  // The next checkpoint is kept together with the valid one, not with the damaged one.
  checkpoints.write(some_checkpoint(15));
  EXPECT_TRUE(std::filesystem::exists(checkpoints.path(10)));
  EXPECT_FALSE(std::filesystem::exists(checkpoints.path(20)));
}

// Valid checksums do not suffice: a training rejects states that no training writes.
TEST(CheckpointFolder, TakesTheOneBeforeAnUnsoundOne) {
  const TemporaryFolder folder;
  const CheckpointFolder checkpoints(folder.path());
  const auto taken = [&](const Checkpoint& last, const std::string& reason) {
    checkpoints.write(some_checkpoint(10));
    write_checkpoint(checkpoints.path(20), last);
    testing::internal::CaptureStderr();
    const auto found = checkpoints.latest();
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_NE(said.find(reason), std::string::npos) << said;
    return found ? found->checkpoint.facts.step : -1;
  };
  for (const float value : {std::nanf(""), HUGE_VALF, -1.f})
    for (const char* name : {"gaussians/means", "gaussians/means/exp_avg_sq", "table1/planes"}) {
      if (value == -1 && std::string(name) != "gaussians/means/exp_avg_sq") continue;
      Checkpoint last = some_checkpoint(20);
      last.arrays[name] = {{1, 3}, std::vector<float>{0, 1, value}};
      EXPECT_EQ(taken(last, std::string("'") + name + "'"), 10) << name << " " << value;
    }
  for (const auto& [name, value] : {std::pair("gaussians/rows/reach", 0.f),
                                    {"gaussians/rows/reach", -1.f},
                                    {"table1/rows/reach", 0.f},
                                    {"gaussians/rows/pace", -1.f},
                                    {"gaussians/rows/pace", 1001.f},
                                    {"density/pull", std::nanf("")},
                                    {"density/views", -1.f}}) {
    Checkpoint last = some_checkpoint(20);
    last.arrays[name] = {{2}, std::vector<float>{1, value}};
    EXPECT_EQ(taken(last, std::string("'") + name + "'"), 10) << value;
  }
  Checkpoint wraps = some_checkpoint(20);  // overflows at the next step
  wraps.arrays["gaussians/rows/steps"] = {{2}, std::vector<uint32_t>{1, 4294967295u}};
  EXPECT_EQ(taken(wraps, "'gaussians/rows/steps'"), 10);
  Checkpoint far = some_checkpoint(20);
  far.arrays["table1/rows/now"] = {{1}, std::vector<uint32_t>{4294967295u}};
  EXPECT_EQ(taken(far, "'table1/rows/now'"), 10);
  far.arrays["table1/rows/now"] = {{1}, std::vector<uint32_t>{21}};  // the training is at 20
  EXPECT_EQ(taken(far, "'table1/rows/now'"), 10);
  Checkpoint to_come = some_checkpoint(20);  // a row's last step is beyond the table's step 7
  to_come.arrays["gaussians/rows/now"] = {{1}, std::vector<uint32_t>{7}};
  to_come.arrays["gaussians/rows/last"] = {{2}, std::vector<uint32_t>{7, 8}};
  EXPECT_EQ(taken(to_come, "'gaussians/rows/last' or 'gaussians/rows/now'"), 10);
  for (const int step : {-5, 10, 30}) EXPECT_EQ(taken(some_checkpoint(step), "its step is"), 10);
  Checkpoint without_settings = some_checkpoint(20);
  without_settings.facts.config = "[train\nseed = 3\n";
  EXPECT_EQ(taken(without_settings, "iteration_20.npz is damaged: reading the configuration its"),
            10);
  EXPECT_EQ(taken(some_checkpoint(20), ""), 20);
}

TEST(CheckpointFolder, WithNoneThatCanBeReadIsAnError) {
  const TemporaryFolder folder;
  const CheckpointFolder checkpoints(folder.path());
  for (const int step : {10, 20}) folder.write("iteration_" + std::to_string(step) + ".npz", "PK");
  testing::internal::CaptureStderr();
  expect_error([&] { checkpoints.latest(); },
               {"no usable checkpoint in", "iteration_10.npz", "--overwrite"});
  testing::internal::GetCapturedStderr();
}

// The last readable checkpoint is never removed.
TEST(CheckpointFolder, MakesRoomByTheOnesBeforeTheLast) {
  const TemporaryFolder folder;
  const CheckpointFolder checkpoints(folder.path());
  const DiskFull full("cannot write the next: No space left on device");
  std::string said;
  const auto makes_room = [&] {
    testing::internal::CaptureStderr();
    const bool made = checkpoints.make_room(full);
    said = testing::internal::GetCapturedStderr();
    return made;
  };
  EXPECT_FALSE(makes_room());
  checkpoints.write(some_checkpoint(10));
  EXPECT_FALSE(makes_room());
  checkpoints.write(some_checkpoint(20));
  EXPECT_TRUE(makes_room());
  EXPECT_EQ(checkpoints.steps(), std::vector<int>{20});
  for (const char* part : {"No space left", "step 10", "kept that of step 20"})
    EXPECT_NE(said.find(part), std::string::npos) << part << " in " << said;
  folder.write("iteration_30.npz", "damaged");
  EXPECT_TRUE(makes_room());
  EXPECT_EQ(checkpoints.steps(), std::vector<int>{20});
  folder.write("iteration_20.npz", "damaged");
  folder.write("iteration_30.npz", "damaged");
  EXPECT_FALSE(makes_room());
  EXPECT_EQ(folder.count(), 2u);
}

TEST(CheckpointFolder, OnAFullDiskTheOlderOnesRemain) {
  const TemporaryFolder folder;
  const CheckpointFolder checkpoints(folder.path());
  for (const int step : {10, 20}) checkpoints.write(some_checkpoint(step));
  {
    const FileSizeLimit limit(1000);
    expect_error([&] { checkpoints.write(some_checkpoint(30)); },
                 {"iteration_30.npz", "File too large"});
  }
  EXPECT_EQ(folder.count(), 2u);
  EXPECT_EQ(checkpoints.latest()->checkpoint.facts.step, 20);
}

}  // namespace
}  // namespace gflow
