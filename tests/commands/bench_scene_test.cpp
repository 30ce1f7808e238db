// SPDX-License-Identifier: Apache-2.0
// `gflow bench` on scenes: step, skip, and the trainings of pareto. Times are not tested.
#include <chrono>
#include <cmath>
#include <csignal>
#include <thread>

#include "tests/support/bench_command.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

// Each trains as many steps as fit into the time of the default.
TEST(Bench, ParetoTrainsWithEachChoiceForTheSameTime) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const TemporaryFolder folder;
  const Outcome outcome =
      small_pareto({"--knob", "transport", "--scene", scene.path(), "--steps", "12", "--seeds", "1",
                    "--set", "density.enabled=false", "--json", folder.file("a.json"), "--markdown",
                    folder.file("a.md"), "--plots", folder.file("plots"), "--quiet"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json rows = report_in(folder.file("a.json"))["rows"];
  const Json& shipped = rows["shipped, trained"];
  EXPECT_EQ(shipped["steps"], 12);
  for (const auto& [name, row] : rows.items()) {
    if (name.find(", trained") == std::string::npos) continue;
    const double time = row["CPU of a step, of shipped"]["median"], steps = row["steps"];
    EXPECT_EQ(steps, std::max(1.0, std::floor(12 / time))) << name;
    EXPECT_GT(row["PSNR [dB]"]["median"], 5) << name;
  }
  EXPECT_NE(contents(folder.file("a.md")).find("## In training"), std::string::npos);
  EXPECT_TRUE(fs::exists(folder.file("plots/pareto_trained.tsv")));

  // One step each, so that they differ by the choice alone.
  const Outcome one =
      small_pareto({"--knob", "alpha >=", "--knob", "saturated tiles", "--scene", scene.path(),
                    "--steps", "1", "--seeds", "1", "--json", folder.file("b.json"), "--quiet"});
  ASSERT_EQ(one.code, 0) << one.err;
  const Json single = report_in(folder.file("b.json"))["rows"];
  const Json& first = single["shipped, trained"]["PSNR [dB]"];
  const Json& exact = single["saturated tiles walked on, trained"];
  if (exact["steps"] == 1) {  // 2 if it took half the time
    EXPECT_EQ(exact["PSNR [dB]"], first);
  }
  for (const char* other : {"alpha >= 1/64, trained", "alpha >= 1/2048, trained"})
    EXPECT_NE(single[other]["PSNR [dB]"], first) << other;
  Json old = report_in(folder.file("b.json"));
  EXPECT_EQ(old["trained"]["steps"], 1);
  // Images and flow of trainings are compared, too: by more than a fifth of a dB, a tenth.
  for (Json& row : old["rows"])
    for (Json& measurement : row)
      if (measurement.is_object()) measurement["high"] = 1e6;
  Json& once = old["rows"]["alpha >= 1/64, trained"];
  for (const char* part : {"median", "low", "high"}) {
    once["PSNR [dB]"][part] = first["median"].get<double>() + 40;
    once["flow error, moving [px]"][part] = 1e-4;
  }
  const Outcome worse = small_pareto({"--knob", "alpha >=", "--knob", "saturated tiles", "--scene",
                                      scene.path(), "--steps", "1", "--seeds", "1", "--quiet",
                                      "--compare", folder.write("old.json", old.dump())});
  EXPECT_EQ(worse.code, 3) << worse.out << worse.err;
  EXPECT_NE(worse.out.find(", twice: alpha >= 1/64, trained, PSNR [dB]; alpha >= 1/64, trained, "
                           "flow error, moving [px]\n"),
            std::string::npos)
      << worse.out;
  const Outcome missing = small_pareto({"--knob", "lanes", "--scene", folder.file("nowhere")});
  EXPECT_EQ(missing.code, 1);
  EXPECT_EQ(missing.out, "");
  EXPECT_EQ(missing.err.find("1 of"), std::string::npos) << missing.err;  // reported first
  expect_refused({"bench", "pareto", "--scene", scene.path(), "--set", "flow.top_k=1"},
                 {"--set flow.top_k=1", "--knob"});
}

TEST(Bench, InterruptedItLeavesNothingBehind) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const TemporaryFolder folder;
  const Command command({"bench", "step", scene.path(), "--warm", "1000000"},
                        "export TMPDIR='" + folder.path() + "'");
  for (int i = 0; i < 6000 && command.said().find("train") == std::string::npos; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_FALSE(fs::is_empty(folder.path()));
  command.send(SIGINT);
  const Outcome outcome = command.wait();
  EXPECT_EQ(outcome.code, 130);
  EXPECT_NE(outcome.err.find("interrupted"), std::string::npos) << outcome.err;
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Bench, StepTellsEachKindAndItsKernels) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const TemporaryFolder folder;
  const std::string file = folder.file("a.json");
  const Outcome outcome = gflow({"bench", "step", scene.path(), "--warm", "4", "--block", "2",
                                 "--repeats", "1", "--json", file, "--quiet"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json rows = report_in(file)["rows"];
  for (const char* kind : {"images only", "with flow", "flow in all tiles in every step",
                           "flow, rigidity", "flow, velocity"})
    EXPECT_TRUE(rows.contains(kind)) << kind;
  EXPECT_FALSE(rows.contains("images only: flow_loss"));
  EXPECT_TRUE(rows.contains("with flow: flow_loss"));
}

// Otherwise blocks would differ in the number of steps with flow, of whole images, or with a motion
// loss.
TEST(Bench, BlocksHoldTheSameKindsOfStep) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const Outcome outcome =
      gflow({"bench", "step", scene.path(), "--warm", "1", "--block", "10", "--repeats", "1",
             "--set", "flow.every=3", "--set", "train.focus=1", "--set", "loss.motion_every=4"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("--block 10 becomes 12"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.out.find("times are of 12 steps together"), std::string::npos);
  // With default settings: five steps of image parts and one of whole images, and flow in every
  // step.
  const Outcome same = gflow({"bench", "step", scene.path(), "--warm", "1", "--block", "6",
                              "--repeats", "1", "--set", "motion.model=keyframes"});
  ASSERT_EQ(same.code, 0) << same.err;
  EXPECT_EQ(same.err.find("becomes"), std::string::npos) << same.err;
}

TEST(Bench, SkipTellsWhatEachSavesAndChanges) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const TemporaryFolder folder;
  const std::string file = folder.file("a.json");
  const Outcome outcome = gflow({"bench", "skip", scene.path(), "--warm", "4", "--block", "2",
                                 "--repeats", "1", "--set", "density.enabled=false", "--json", file,
                                 "--quiet", "--plots", folder.file("plots")});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json rows = report_in(file)["rows"];
  ASSERT_EQ(rows.size(), 15u);
  const std::string bars = contents(folder.file("plots/skip.tsv"));
  EXPECT_EQ(bars.find("kind\tCPU [ms]\tlower quartile\tupper quartile\nall skips\t"), 0u) << bars;
  EXPECT_TRUE(fs::exists(folder.file("plots/skip.gnuplot")));
  const Json &all = rows["all skips"], &none = rows["no skip at all"];
  const Json& inexact = rows["no exact skip"];  // requests the same work in the same way
  EXPECT_EQ(all["model differs by"], 0);
  EXPECT_NE(outcome.out.find("with flow in every step both, no skip at all takes "),
            std::string::npos);
  for (const char* exact : {"masks", "saturated", "zero_gradients", "culled", "flow", "bands"})
    EXPECT_EQ(rows[fmt::format("without {}", exact)]["model differs by"], 0) << exact;
  for (const char* in_the_mean :
       {"flow in low-motion tiles too (flow.low_motion=1)", "flow in every step (flow.every=1)"})
    EXPECT_GT(rows[in_the_mean]["model differs by"], 0) << in_the_mean;
  EXPECT_GT(rows["without masks"]["pairs in cells"], all["pairs in cells"]);
  EXPECT_GT(rows["without boxes"]["intersections"], all["intersections"]);
  EXPECT_GE(rows["at every time (motion.cutoff=0)"]["drawn"], all["drawn"]);
  EXPECT_GE(rows["without culled"]["posed"], all["posed"]);
  EXPECT_GE(all["posed"], all["drawn"]);
  for (const Json* row : {&none, &inexact})
    EXPECT_GT((*row)["pairs in cells"], all["pairs in cells"]);
  EXPECT_LT(inexact["model differs by"], 0.1 * none["model differs by"].get<double>());
  EXPECT_GT(inexact["moved by Adam"], all["moved by Adam"]);
  EXPECT_GT(none["CPU, of all skips"]["high"], 0);
  EXPECT_GE(all["moved by Adam"], all["drawn"]);
  EXPECT_GT(rows["without unseen"]["moved by Adam"], all["moved by Adam"]);
  for (const char* fewer_bytes : {"unseen", "bands"})
    EXPECT_GT(rows[fmt::format("without {}", fewer_bytes)]["bytes [1e6]"], all["bytes [1e6]"]);
  EXPECT_GT(all["of the copy peak [%]"], 0);
  EXPECT_GT(all["of the FMA peak, at least [%]"], 0);
  EXPECT_EQ(rows["without masks"]["pairs blended"], all["pairs blended"]);
  EXPECT_LE(all["posed"], all["listed"]);
  EXPECT_LE(all["listed"], rows["without culled"]["listed"]);
  // What is left out of the backward pass, of the second time, of flow and of colour.
  EXPECT_GE(rows["without zero_gradients"]["pairs back"], all["pairs back"]);
  EXPECT_EQ(rows["without zero_gradients"]["pairs back"],
            rows["without zero_gradients"]["pairs in cells"]);
  EXPECT_GE(rows["without saturated"]["pairs in cells"], all["pairs in cells"]);
  EXPECT_EQ(rows["without saturated"]["pairs blended"], all["pairs blended"]);
  EXPECT_GE(rows["without static_pose"]["posed at t2"], all["posed at t2"]);
  EXPECT_GT(rows["flow in every step (flow.every=1)"]["tiles with flow"], 0);
  EXPECT_GT(none["tiles with flow"], all["tiles with flow"]);
  const double each = 3 * 9;  // motion.sh_degree 2
  EXPECT_FLOAT_EQ(rows["without bands"]["colour values"].get<float>(),
                  each * all["drawn"].get<float>());  // means over steps, then summed
  EXPECT_LT(all["colour values"], rows["without bands"]["colour values"]);
}

}  // namespace
}  // namespace gflow
