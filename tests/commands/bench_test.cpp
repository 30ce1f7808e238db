// SPDX-License-Identifier: Apache-2.0
// `gflow bench`: its counts are right and its reports can be compared. Times are not tested.
#include <cmath>

#include "optim/formats/npz.hpp"
#include "runtime/cl/device.hpp"
#include "tests/support/bench_command.hpp"

namespace gflow {
namespace {

std::vector<std::string> raster(const std::vector<std::string>& more) {
  std::vector<std::string> arguments{"bench", "raster", "--repeats", "1"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST(Bench, RasterTellsEveryStageAndCountsTheWork) {
  const TemporaryFolder folder;
  const std::string file = folder.file("a.json");
  const Outcome outcome = gflow(raster({"--pixels", "40x24", "--gaussians", "300", "--json", file,
                                        "--plots", folder.file("plots")}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("40x24, 300: backward"), std::string::npos) << outcome.out;
  const Json report = report_in(file);
  EXPECT_EQ(report["bench"], "raster");
  EXPECT_GT(report["peak_gflops"].get<double>(), 0);
  const Json& rows = report["rows"];
  for (const char* stage : {"motion", "project", "transport", "bin", "mask", "splat", "backward",
                            "gather", "project back", "motion back", "Adam"})
    EXPECT_TRUE(rows.contains(std::string("40x24, 300: ") + stage)) << stage;
  const Json& all = rows["40x24, 300"];
  EXPECT_GT(all["wall [ms]"]["median"].get<double>(), 0);
  if (const Json& raster = all["bin to gather, of that [ms]"]; !raster.is_null()) {  // on CPUs
    EXPECT_GT(raster["median"].get<double>(), 0);
    double of_stages = 0;  // half the CPU time of each, in one repeat, so only about
    for (const char* stage : {"bin", "mask", "transport", "splat", "backward", "gather"})
      of_stages +=
          0.5 *
          rows[std::string("40x24, 300: ") + stage]["CPU, about [ms]"]["median"].get<double>();
    EXPECT_NEAR(raster["median"].get<double>() / of_stages, 1, 0.3);
  }
  const double listed = all["listed a pixel"], masked = all["masked a pixel"];
  const double blended = all["blended a pixel"];
  EXPECT_GE(listed, masked);
  EXPECT_GE(masked, blended);
  EXPECT_NEAR(blended, 48, 10);  // the target of the scene
  const std::string shares = contents(folder.file("plots/raster.tsv"));
  EXPECT_EQ(shares.find("scene\tcull\tmotion\tproject\tbin\t"), 0u) << shares;
  EXPECT_NE(shares.find("\n40x24, 300\t"), std::string::npos) << shares;
}

TEST(Bench, OneSplatOverTheImageIsOnePairAPixel) {
  const TemporaryFolder folder;
  Arrays scene;
  scene["means"] = {{1, 3}, std::vector<float>{0, 0, 2}};
  scene["quats"] = {{1, 4}, std::vector<float>{1, 0, 0, 0}};
  scene["scales"] = {{1, 3}, std::vector<float>{5, 5, 5}};
  scene["opacities"] = {{1}, std::vector<float>{0.5f}};
  scene["colors"] = {{1, 3}, std::vector<float>{1, 1, 1}};
  scene["viewmat"] = {{4, 4}, std::vector<float>{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
  scene["K"] = {{3, 3}, std::vector<float>{20, 0, 10, 0, 20, 6, 0, 0, 1}};
  scene["size"] = {{2}, std::vector<int32_t>{20, 12}};
  write_npz(folder.file("a.npz"), scene);
  const std::string file = folder.file("a.json");
  const Outcome outcome = gflow(raster({folder.file("a.npz"), "--no-flow", "--json", file}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json all = report_in(file)["rows"][folder.file("a.npz")];
  for (const char* pairs : {"listed a pixel", "masked a pixel", "blended a pixel"})
    EXPECT_EQ(all[pairs], 1) << pairs;
  EXPECT_EQ(all["intersections"], 2);  // tiles
  const Outcome moving = gflow(raster({folder.file("a.npz")}));
  EXPECT_EQ(moving.code, 1);
  EXPECT_NE(moving.err.find("means_t2"), std::string::npos) << moving.err;
}

TEST(Bench, ParetoTellsTimeAndErrorOfAChoiceAndDrawsThem) {
  const TemporaryFolder folder;
  const Outcome outcome =
      small_pareto({"--knob", "alpha >=", "--json", folder.file("a.json"), "--plots",
                    folder.file("plots"), "--markdown", folder.file("a.md")});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json rows = report_in(folder.file("a.json"))["rows"];
  ASSERT_EQ(rows.size(), 5u);
  const Json &shipped = rows["shipped"], &coarse = rows["alpha >= 1/64"],
             &fine = rows["alpha >= 1/2048"];
  // As defined: float against double. Without cut-offs: more accurate with smaller thresholds.
  EXPECT_LT(shipped["colour"], 1e-6);
  EXPECT_LT(shipped["gradients"], 1e-4);
  for (const char* error : {"colour, all", "flow, all [px]", "gradients, all"}) {
    EXPECT_GT(coarse[error], shipped[error]) << error;
    EXPECT_GT(shipped[error], fine[error]) << error;
  }
  EXPECT_GT(fine["colour"], shipped["colour"]);
  // No other row is as accurate as defined, so it is on the front whatever the times are.
  EXPECT_EQ(shipped["on the front"], 1);
  EXPECT_EQ(shipped["CPU, of shipped"]["high"], 1);
  EXPECT_GT(fine["CPU, of shipped"]["high"], 0);
  const std::string table = contents(folder.file("a.md"));
  EXPECT_NE(table.find("| **shipped** | **1** | "), std::string::npos) << table;
  const std::string data = contents(folder.file("plots/pareto.tsv"));
  EXPECT_EQ(std::count(data.begin(), data.end(), '\n'), 6);
  EXPECT_NE(contents(folder.file("plots/pareto.gnuplot")).find("svg = 'pareto.svg'"),
            std::string::npos);
}

TEST(Bench, BoxesThatCutSplatsOffAreLessExactAndSkipsAreNot) {
  const TemporaryFolder folder;
  const std::string file = folder.file("a.json");
  const Outcome outcome = small_pareto({"--knob", "boxes", "--knob", "skips", "--json", file});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  Json report = report_in(file);
  Json& rows = report["rows"];
  const double exact = rows["shipped"]["colour"];
  EXPECT_LT(rows["skips none"]["colour"], 1.5 * exact);
  EXPECT_LT(rows["boxes loose"]["colour"], 1.5 * exact);
  EXPECT_GT(rows["boxes of at most 3.0 sigma"]["colour"], 10 * exact);
  EXPECT_GT(rows["boxes of at most 2.0 sigma"]["colour"],
            rows["boxes of at most 3.0 sigma"]["colour"]);

  // A larger error is reported like a longer time.
  for (Json& row : rows)
    for (Json& measurement : row)
      if (measurement.is_object()) measurement["high"] = 1e6;
  rows["shipped"]["gradients"] = 0.5 * rows["shipped"]["gradients"].get<double>();
  const Outcome compared = small_pareto(
      {"--knob", "boxes", "--knob", "skips", "--compare", folder.write("old.json", report.dump())});
  EXPECT_EQ(compared.code, 3) << compared.err;
  EXPECT_NE(compared.out.find("less exact\n"), std::string::npos) << compared.out;
  EXPECT_NE(compared.out.find(", twice: shipped, gradients\n"), std::string::npos) << compared.out;
}

TEST(Bench, AnUnknownKnobIsNamedWithThoseThereAre) {
  const Outcome outcome = gflow({"bench", "pareto", "--knob", "speed"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("--knob speed: there is none, but transport, top_k"),
            std::string::npos)
      << outcome.err;
}

TEST(Bench, ScalingTellsHowCostGrowsAndPredicts) {
  const TemporaryFolder folder;
  const std::string file = folder.file("a.json");
  const Outcome outcome = gflow({"bench", "scaling", "--most", "3000", "--repeats", "1", "--json",
                                 file, "--gpu-tflops", "10"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json rows = report_in(file)["rows"];
  // The pairs per pixel do not depend on the number of Gaussians or pixels; unrendered frames have
  // none.
  const auto pairs = [&](const char* row) { return rows[row]["blended pairs"].get<double>(); };
  EXPECT_NEAR(pairs("Gaussians: 3000") / pairs("Gaussians: 1000"), 1, 0.2);
  EXPECT_NEAR(pairs("pixels: 262144") / pairs("pixels: 65536"), 4, 0.8);
  EXPECT_NEAR(pairs("frames: 100") / pairs("frames: 1"), 1, 0.1);
  for (const char* sweep : {"time with Gaussians", "time with pixels", "time with frames"})
    EXPECT_TRUE(rows.contains(sweep)) << sweep;
  const Json& predicted = rows["5 million, 3840x2160, predicted"];
  EXPECT_NEAR(predicted["compute, at peak [ms]"].get<double>() * 10,
              predicted["operations [1e9]"].get<double>(), 1e-3);
  EXPECT_EQ(predicted["a step, the longer of the last two [ms]"],
            std::max(predicted["compute, at the share of peak reached here [ms]"].get<double>(),
                     predicted["memory, at peak [ms]"].get<double>()));
  EXPECT_TRUE(rows["time with frames"].contains("of the last two"));
  // The scene does not depend on the sizes measured beside it.
  const Outcome fewer = gflow({"bench", "scaling", "--most", "1000", "--repeats", "1", "--json",
                               file, "--plots", folder.file("plots")});
  ASSERT_EQ(fewer.code, 0) << fewer.err;
  const Json again = report_in(file)["rows"]["5 million, 3840x2160, predicted"];
  for (const char* counted : {"operations [1e9]", "bytes [1e9]"})
    EXPECT_EQ(again[counted], predicted[counted]) << counted;
  const std::string script = contents(folder.file("plots/scaling.gnuplot"));
  for (const char* axis : {"Gaussians", "pixels", "frames"})
    EXPECT_NE(script.find(fmt::format("set xlabel '{}'", axis)), std::string::npos) << script;
}

TEST(Bench, AFolderThatCannotBeMadeIsToldBeforeAnythingIsMeasured) {
  const TemporaryFolder folder;
  const std::string file = folder.write("a file", "");
  const Outcome outcome =
      gflow(raster({"--pixels", "16x16", "--gaussians", "20", "--plots", file + "/plots"}));
  EXPECT_EQ(outcome.code, 1);
  EXPECT_EQ(outcome.out, "");
  EXPECT_NE(outcome.err.find("drawing into " + file + "/plots: cannot create that folder"),
            std::string::npos)
      << outcome.err;
}

Outcome small_raster(std::vector<std::string> more) {
  for (const char* word : {"--pixels", "16x16", "--gaussians", "20"}) more.push_back(word);
  return gflow(raster(more));
}

// The median of two values is their mean, with as much below as above.
TEST(Bench, QuartilesLieBetweenRanksAndWhatNobodyCountedIsNotZero) {
  const TemporaryFolder folder;
  const std::string file = folder.file("a.json");
  const Outcome outcome = gflow({"bench", "raster", "--pixels", "16x16", "--gaussians", "20",
                                 "--repeats", "2", "--json", file});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json report = report_in(file), rows = report["rows"];
  const Json& wall = rows["16x16, 20"]["wall [ms]"];
  const double low = wall["low"], high = wall["high"], median = wall["median"];
  EXPECT_LT(low, high);
  EXPECT_NEAR(median, (low + high) / 2, 1e-9 * high);
  EXPECT_GT(rows["16x16, 20: splat"]["of the FMA peak [%]"], 0);
  EXPECT_TRUE(rows["16x16, 20: bin"]["of the FMA peak [%]"].is_null());
  // The index of an intersection, half a splat and the mask.
  const Json& mask = rows["16x16, 20: mask"];
  const double bytes = 1e-2 * mask["of the copy peak [%]"].get<double>() * 1e6 *
                       mask["device [ms]"]["median"].get<double>() *
                       report["peak_copy_gbs"].get<double>();
  EXPECT_NEAR(bytes, 38 * rows["16x16, 20"]["intersections"].get<double>(), 1e-3);
  for (const char* stage : {"motion", "project", "bin", "transport", "splat", "backward", "gather",
                            "project back", "motion back", "Adam"})
    EXPECT_GT(rows[std::string("16x16, 20: ") + stage]["of the copy peak [%]"], 0) << stage;
  // Changed peaks during the measurement are reported.
  bool changed = false;
  for (const char* peak : {"peak_gflops", "peak_copy_gbs"}) {
    const double before = report[peak], after = report[std::string(peak) + "_after"];
    changed = changed || std::max(before, after) > 1.2 * std::min(before, after);
  }
  EXPECT_EQ(!report.at("notes").empty(), changed);
  EXPECT_EQ(outcome.out.find("the peaks were") != std::string::npos, changed);
}

TEST(Bench, OptionsOfRandomScenesDoNotGoWithAFile) {
  const Outcome outcome =
      gflow(raster({GFLOW_SOURCE_DIR "/tests/data/oracle/small_paper.npz", "--frames", "5"}));
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("--frames"), std::string::npos) << outcome.err;
}

TEST(Bench, CasesAreAsManyOfBothAndEachOnce) {
  expect_refused(raster({"--pixels", "16x16,24x24", "--gaussians", "10,20,30"}),
                 {"--pixels has 2 sizes", "--gaussians 3 numbers", "--grid"});
  expect_refused(raster({"--pixels", "16x16,16x16", "--gaussians", "20"}),
                 {"--pixels 16x16 with --gaussians 20", "twice"});
  const TemporaryFolder folder;
  const std::string file = folder.file("a.json");
  const Outcome outcome =
      gflow(raster({"--pixels", "16x16", "--gaussians", "10,20", "--json", file, "--quiet"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json rows = report_in(file)["rows"];
  EXPECT_TRUE(rows.contains("16x16, 10") && rows.contains("16x16, 20"));
}

TEST(Bench, AReportOfOtherThingsIsNotCompared) {
  const TemporaryFolder folder;
  const std::string file = folder.file("a.json");
  const Outcome first = small_raster({"--lanes", "4", "--json", file});
  ASSERT_EQ(first.code, 0) << first.err;
  for (const std::vector<std::string>& other :
       {std::vector<std::string>{"--lanes", "1"}, {"--no-flow"}, {"--depth"}, {"--frames", "3"}}) {
    std::vector<std::string> words = other;
    if (other[0] != "--lanes") words.insert(words.end(), {"--lanes", "4"});
    words.insert(words.end(), {"--compare", file});
    const Outcome outcome = small_raster(words);
    EXPECT_EQ(outcome.code, 1) << other[0];
    EXPECT_EQ(outcome.out, "") << "measured first";
    EXPECT_NE(
        outcome.err.find("was measured with " + other[0].substr(other[0] == "--no-flow" ? 5 : 2)),
        std::string::npos)
        << outcome.err;
  }
}

TEST(Bench, WhatCannotBeWrittenIsToldBeforeAnythingIsMeasured) {
  const TemporaryFolder folder;
  const std::string file = folder.write("a file", "as it was");
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"raster", "--json", "/nowhere/a.json"},
        {"raster", "--json", file + "/a.json"},
        {"raster", "--plots", "/proc"},
        {"pareto", "--markdown", "/nowhere/a.md"},
        {"scaling", "--json", "/dev/full"}}) {
    std::vector<std::string> words{"bench"};
    words.insert(words.end(), command.begin(), command.end());
    const Outcome outcome = gflow(words);
    EXPECT_EQ(outcome.code, 1);
    EXPECT_EQ(outcome.out, "");
    EXPECT_NE(outcome.err.find(command[1] + ": cannot write " + command[2]), std::string::npos)
        << outcome.err;
  }
  EXPECT_EQ(contents(file), "as it was");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()), 1);
}

TEST(Bench, AnEarlierReportIsComparedByRatio) {
  const TemporaryFolder folder;
  const std::string file = folder.file("a.json");
  const Outcome first = small_raster({"--json", file});
  ASSERT_EQ(first.code, 0) << first.err;
  const auto compared_with = [&](double factor) {
    Json report = report_in(file);
    for (Json& row : report["rows"])
      for (Json& measurement : row)
        if (measurement.is_object())
          for (Json& part : measurement) part = part.get<double>() * factor;
    const std::string old = folder.write("old.json", report.dump());
    return small_raster({"--compare", old});
  };
  EXPECT_EQ(compared_with(1e6).code, 0);
  const Outcome slower = compared_with(1e-6);
  EXPECT_EQ(slower.code, 3);
  EXPECT_NE(slower.out.find("worse than in"), std::string::npos) << slower.out;
  EXPECT_EQ(slower.err, "");
  // CPU time is compared if it exists (parts on a GPU have none), and only parts of at least 5 %.
  EXPECT_NE(slower.out.find(", twice: 16x16, 20, CPU [ms]"), std::string::npos) << slower.out;
  const std::string twice = slower.out.substr(slower.out.find(", twice: "));
  EXPECT_EQ(twice.find("wall [ms]"), std::string::npos) << twice;
  const bool cpu = is_pocl(device_info(find_device()));
  EXPECT_EQ(twice.find("device [ms]") == std::string::npos, cpu) << twice;
  for (const char* said : {"wall [ms]", "motion, device [ms]"})
    EXPECT_NE(slower.out.find(said), std::string::npos) << said;
  EXPECT_NE(slower.out.find(" not evaluated\n"), std::string::npos) << slower.out;
  Json report = report_in(file);  // slower by its best, but one earlier repeat was as slow
  const std::string row = report["rows"].items().begin().key();
  for (Json& one : report["rows"])
    for (Json& measurement : one)
      if (measurement.is_object()) measurement["low"] = 1e-6, measurement["high"] = 1e6;
  report["rows"]["gone"] = report["rows"][row];
  report["rows"].erase(row);
  const Outcome unsure = small_raster({"--compare", folder.write("old.json", report.dump())});
  EXPECT_EQ(unsure.code, 0) << unsure.out;
  for (const std::string& said :
       {std::string("within the quartiles"), "only here: " + row, std::string("old.json: gone\n")})
    EXPECT_NE(unsure.out.find(said), std::string::npos) << said << "\n" << unsure.out;
  const Outcome none =
      small_raster({"--compare", folder.write("no.json", "{\"bench\": \"step\"}")});
  EXPECT_EQ(none.code, 1);
  EXPECT_NE(none.err.find("no.json: it is no report of `gflow bench raster`"), std::string::npos)
      << none.err;
}

}  // namespace
}  // namespace gflow
