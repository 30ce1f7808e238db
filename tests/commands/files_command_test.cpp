// SPDX-License-Identifier: Apache-2.0
// Reading and writing files as a user does: export, import, info, splat.
#include <nlohmann/json.hpp>

#include "optim/formats/splat_table.hpp"
#include "runtime/files/file_lock.hpp"
#include "tests/support/command_scene.hpp"

namespace gflow {
namespace {

class FilesCommand : public CommandTest {};

// Keys as in the oracle's scenes; two Gaussians before a camera at the origin.
TEST_F(FilesCommand, ExportWritesOneTimeThatInfoAndImportAndTrainRead) {
  const TemporaryFolder folder;
  const std::string ply = folder.file("now.ply"), splat = folder.file("now.splat");
  EXPECT_EQ(gflow({"export", run(), "-o", ply, "--times", "0.25"}).err, "");
  EXPECT_EQ(gflow({"export", model(), "-o", splat, "--format", "splat", "--times", "0.25"}).err,
            "");
  const auto moving = nlohmann::json::parse(gflow({"info", run(), "--json"}).out);
  EXPECT_EQ(moving["motion"], "spacetime");
  EXPECT_EQ(moving["iterations"], 3);
  const auto still = nlohmann::json::parse(gflow({"info", ply, "--json"}).out);
  EXPECT_EQ(still["motion"], "none");
  EXPECT_EQ(still["format"], "ply");
  EXPECT_GT(still["gaussians"], 0);
  EXPECT_EQ(gflow({"import", splat, "-o", folder.file("back.ply")}).err, "");
  const auto back = nlohmann::json::parse(gflow({"info", folder.file("back.ply"), "--json"}).out);
  EXPECT_EQ(back["gaussians"], still["gaussians"]);
  const Outcome again = gflow({"train", scene().path(), "-o", folder.file("run"), "--iterations",
                               "1", "--init", splat, "--set", "init.dynamic=0", "--quiet"});
  EXPECT_EQ(again.code, 0) << again.err;
  const auto first =
      nlohmann::json::parse(gflow({"info", folder.file("run/input.ply"), "--json"}).out);
  EXPECT_EQ(first["gaussians"], still["gaussians"]);
}

// The origin of positions: as a comment in gflow's file, in doubles in the result.
TEST_F(FilesCommand, ImportKeepsThePlaceInTheWorld) {
  const TemporaryFolder folder;
  const std::string ply = folder.file("now.ply"), out = folder.path() + "/out.ply";
  ASSERT_EQ(gflow({"export", run(), "-o", ply}).code, 0);
  const std::string plain = contents(ply);
  const auto with_origin = [&](const std::string& origin) {
    return folder.write("far.ply", "ply\ncomment origin " + origin + plain.substr(3));
  };
  ASSERT_EQ(gflow({"import", with_origin("6e6 0 -2000"), "-o", out}).code, 0);
  const PlyTable before = read_ply(ply), after = read_ply(out);
  ASSERT_EQ(after.rows, before.rows);
  for (size_t i = 0; i < after.rows; ++i)
    for (const auto& [name, axis, away] : {std::tuple("x", 0, 6e6), {"y", 1, 0.}, {"z", 2, -2e3}}) {
      const auto at = [&, name = name](const PlyTable& table) {
        return double(table.values[i * table.names.size() + size_t(table.column(name))]);
      };
      EXPECT_NEAR(at(after) + after.origin[size_t(axis)], at(before) + away, 1e-6);
    }
  expect_refused({"import", with_origin("nan 0 0"), "-o", out}, {"far.ply", "origin nan"});
}

// Two processes at a time would mix their images.
TEST_F(FilesCommand, OneProcessWritesAFolder) {
  const TemporaryFolder folder;
  const FolderLock lock(folder.path());
  expect_refused({"render", run(), "-o", folder.path(), "--quiet"},
                 {folder.path(), "is being written by another process"});
  expect_refused({"export", run(), "-o", folder.path(), "--format", "ply-sequence", "--quiet"},
                 {folder.path(), "is being written by another process"});
}

// Its settings are not written yet.
TEST_F(FilesCommand, ATrainingThatBeginsIsSeen) {
  const TemporaryFolder folder;
  const FileLock lock(folder.path() + "/.lock", folder.path());
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"train", "-o", folder.path(), "--resume"},
        {"eval", folder.path()},
        {"render", folder.path(), "-o", folder.path() + "/r"}})
    expect_refused(words, {folder.path(), "is being written by process"});
}

TEST_F(FilesCommand, ExportTakesTheFormatFromTheEnding) {
  const TemporaryFolder folder;
  const auto exported = [&](const std::string& name) {
    const std::string path = folder.path() + "/" + name;
    const Outcome outcome = gflow({"export", run(), "-o", path, "--quiet"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return contents(path).substr(0, 4);
  };
  EXPECT_EQ(exported("a.ply"), "ply\n");
  EXPECT_EQ(exported("b.PLY"), "ply\n");
  EXPECT_EQ(exported("a.splatv").substr(0, 2), "Kg");
  exported("a.splat");
  exported("a.4dgs");
  const auto kind = [&](const std::string& name) {
    return nlohmann::json::parse(gflow({"info", folder.file(name), "--json"}).out)["format"];
  };
  EXPECT_EQ(kind("a.splat"), "splat");
  EXPECT_EQ(kind("a.4dgs"), "4dgs");
  const auto refused = [&](const std::string& name, const std::vector<std::string>& more,
                           std::initializer_list<std::string> parts) {
    std::vector<std::string> arguments{"export", run(), "-o", folder.path() + "/" + name};
    arguments.insert(arguments.end(), more.begin(), more.end());
    expect_refused(arguments, parts);
    EXPECT_FALSE(fs::exists(folder.path() + "/" + name)) << name;
  };
  refused("x.spz", {}, {"x.spz", "cannot write .spz files", ".splatv"});
  refused("x.foo", {"--format", "ply"}, {"x.foo", "cannot write .foo files"});
  refused("x", {}, {"the format is unknown", "--format"});
  refused("x.splat", {"--format", "ply"}, {"extension means splat", "--format is ply;"});
  refused("x.ply", {"--format", "ply-sequence"},
          {"extension means ply", "--format is ply-sequence"});
}

TEST_F(FilesCommand, ExportWritesWhatIsSelected) {
  const TemporaryFolder folder;
  const std::string whole = folder.path() + "/whole.html", small = folder.path() + "/small.html",
                    ply = folder.path() + "/a.ply";
  ASSERT_EQ(gflow({"export", run(), "-o", whole}).code, 0);
  const Outcome compact =
      gflow({"export", run(), "-o", small, "--compact", "--min-opacity", "0.01"});
  ASSERT_EQ(compact.code, 0) << compact.err;
  EXPECT_NE(compact.out.find("PSNR of"), std::string::npos) << compact.out;
  EXPECT_LT(fs::file_size(small), fs::file_size(whole));
  const Outcome half =
      gflow({"export", run(), "-o", ply, "--crop", "0", "-1e6", "-1e6", "1e6", "1e6", "1e6"});
  ASSERT_EQ(half.code, 0) << half.err;
  EXPECT_EQ(half.out.substr(0, 8), "selected");
  const HostModel left = read_model(ply);
  ASSERT_GT(left.count, 0u);
  for (size_t i = 0; i < left.count; ++i)
    EXPECT_GE(double(left.groups.at("means")[3 * i]) + left.shape.origin[0], 0);
  fs::remove(ply);
  expect_refused({"export", run(), "-o", ply, "--crop", "1", "0", "0", "0", "1", "1"},
                 {"--crop", "x from 1 to 0 is empty"});
  expect_refused({"export", run(), "-o", ply, "--max-size", "1e-9"}, {"none of its", "--max-size"});
  expect_refused({"export", run(), "-o", ply, "--compact"}, {"--compact", "html", "ply"});
  EXPECT_FALSE(fs::exists(ply));
}

TEST_F(FilesCommand, ExportWritesASequenceOfTheStepsOfTheScene) {
  const TemporaryFolder folder;
  EXPECT_EQ(
      gflow({"export", run(), "--format", "ply-sequence", "-o", folder.file("a"), "--quiet"}).code,
      0);
  for (const char* name : {"a/frame_0001.ply", "a/frame_0005.ply"})
    EXPECT_TRUE(fs::exists(folder.file(name))) << name;
  EXPECT_EQ(folder.count(), 5u);
  folder.write("a/notes.txt", "");
  expect_refused({"export", run(), "--format", "ply-sequence", "-o", folder.file("a")},
                 {"frames 1 to 5", "notes.txt"});
  fs::remove(folder.file("a/notes.txt"));
  // As after a full disk.
  fs::remove(folder.file("a/frame_0005.ply"));
  EXPECT_EQ(
      gflow({"export", run(), "--format", "ply-sequence", "-o", folder.file("a"), "--quiet"}).code,
      0);
  EXPECT_EQ(folder.count(), 5u);
  expect_refused(
      {"export", run(), "--format", "ply-sequence", "-o", folder.file("a"), "--times", "0,1"},
      {"frames 1 to 2", "frame_000"});
  EXPECT_EQ(gflow({"export", run(), "--format", "splatv", "-o", folder.file("a.splatv")}).code, 0);
  EXPECT_EQ(contents(folder.file("a.splatv")).substr(0, 2), "Kg");
}

TEST_F(FilesCommand, ExportTakesAllTimesOfTheSceneAsRenderDoes) {
  const TemporaryFolder folder;
  const auto exported = [&](const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"export", run(), "-o", folder.path() + "/" + name,
                                       "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return gflow(arguments);
  };
  for (const std::string format : {"ply-sequence", "4dgs", "splatv"})
    EXPECT_EQ(exported(format, {"--format", format, "--times", "all"}).code, 0) << format;
  EXPECT_EQ(folder.count(), 5u + 2);
  expect_refused({"export", run(), "-o", folder.path() + "/a.ply", "--times", "all"},
                 {"a single time", "every time step", "ply-sequence"});
  expect_refused(
      {"export", model(), "-o", folder.path() + "/a", "--format", "ply-sequence", "--times", "all"},
      {"--steps or --times"});
}

TEST_F(FilesCommand, AnIterationIsChosenOfARunOnly) {
  expect_refused({"info", model(), "--iteration", "3"}, {"--iteration 3", "run folder"});
  expect_refused({"info", scene().path(), "--iteration", "3"}, {"--iteration 3", "run folder"});
  expect_refused({"render", model(), "-o", "/nowhere/out", "--iteration", "3"}, {"--iteration 3"});
  expect_refused({"eval", run(), "--iteration", "4"}, {"iteration 4", "available: 3"});
  expect_refused({"eval", run(), "--iteration", "x"}, {"--iteration", "'x'"});
}

TEST_F(FilesCommand, AMovingFileGoesOutAndItsMomentsComeIn) {
  const TemporaryFolder folder;
  const std::string moving = folder.file("a.4dgs"), now = folder.file("now.ply");
  const Outcome written =
      gflow({"export", run(), "--format", "4dgs", "-o", moving, "--fps", "10", "--quiet"});
  EXPECT_EQ(written.code, 0);
  EXPECT_NE(written.out.find("0.5 s"), std::string::npos) << written.out;  // 5 steps
  const auto info = nlohmann::json::parse(gflow({"info", moving, "--json"}).out);
  EXPECT_EQ(info["format"], "4dgs");
  EXPECT_EQ(info["seconds"], 0.5);
  EXPECT_GT(info["gaussians"], 0);
  EXPECT_EQ(gflow({"import", moving, "-o", now, "--time", "0.2"}).code, 0);
  EXPECT_EQ(nlohmann::json::parse(gflow({"info", now, "--json"}).out)["motion"], "none");
  expect_refused({"import", moving, "-o", now, "--time", "0.5"}, {"--time 0.5", "0.5 s"});
  expect_refused({"import", now, "-o", folder.file("b.ply"), "--time", "0"}, {"--time", "is ply"});
  expect_refused({"import", moving, "-o", now, "--time", ""}, {"--time", "not a number"});
  for (const char* fps : {"1e-300", "1e-5", "-1", "2000"}) {
    expect_refused({"export", run(), "-o", moving, "--fps", fps}, {"--fps", "0.01 to 1000"});
    expect_refused({"render", run(), "-o", folder.path() + "/r", "--fps", fps},
                   {"--fps", "0.01 to 1000"});
  }
  EXPECT_EQ(gflow({"export", run(), "-o", moving, "--fps", "0.01", "--quiet"}).code, 0);
  EXPECT_EQ(nlohmann::json::parse(gflow({"info", moving, "--json"}).out)["seconds"], 500);
  EXPECT_EQ(gflow({"render", run(), "-o", folder.path() + "/r", "--fps", "0.01"}).code, 0);
  expect_refused({"render", moving, "-o", folder.file("r")}, {"a.4dgs", "gflow import"});
  expect_refused({"export", run(), "--format", "4dgs", "-o", moving, "--times", "0,1"},
                 {"all times", "--steps"});
  expect_refused({"export", model(), "--format", "4dgs", "-o", moving}, {"; give --steps\n"});
}

TEST_F(FilesCommand, FilesInAndOutSayWhatIsWrong) {
  const TemporaryFolder folder;
  const std::string out = folder.file("out.ply");
  expect_refused({"export", run(), "-o", out, "--times", "0,1"}, {"--format ply", "a single time"});
  expect_refused({"export", run(), "-o", out, "--steps", "3"}, {"--steps", "ply-sequence"});
  expect_refused({"export", run(), "-o", folder.path() + "/a.splatv", "--times", "0"},
                 {"all times"});
  expect_refused({"export", model(), "-o", folder.path() + "/a", "--format", "ply-sequence"},
                 {"--steps or --times"});
  expect_refused({"export", folder.file("none.ply"), "-o", out},
                 {"cannot read ", "none.ply: there is no such run folder or splat file"});
  expect_refused({"import", model(), "-o", out}, {"dynamic model", "gflow export"});
  expect_refused({"import", folder.write("a.splat", "what?"), "-o", out}, {"a.splat", "32 bytes"});
  expect_refused({"info", folder.write("b.xyz", "what?")}, {"b.xyz", ".spz", "not a video"});
  expect_refused({"train", scene().path(), "-o", folder.file("run"), "--init", model()},
                 {"has motion", "gflow export"});
  EXPECT_FALSE(fs::exists(out));
}

TEST_F(FilesCommand, AFileThatIsNoVideoIsNotTriedAsOne) {
  const TemporaryFolder folder;
  const std::string zip = folder.write("scene.zip", "PK\x03\x04 and more");
  for (const std::string& path : {zip, folder.write("a.SOG", "PK\x03\x04 and more"),
                                  folder.write("a.ksplat", "what?"), folder.write("a.glb", "glTF")})
    EXPECT_EQ(gflow({"info", path}).err.find("video"), std::string::npos) << path;
  expect_refused({"info", zip}, {zip, "zip archive; unpack it first"});
  expect_refused({"train", zip, "-o", folder.file("run")}, {zip, "zip archive; unpack it first"});
}

TEST_F(FilesCommand, InfoTellsWhatAnySceneIs) {
  const auto info = nlohmann::json::parse(gflow({"info", scene().path(), "--json"}).out);
  EXPECT_EQ(info["layout"], "n3v");
  EXPECT_EQ(info["steps"], 5);
  EXPECT_EQ(info["times"], nlohmann::json::array({0, 0.25, 0.5, 0.75, 1}));
  EXPECT_EQ(info["masks"], "none");
  EXPECT_EQ(info["depth"], "none");
  EXPECT_EQ(info["lens"], "no distortion");
  EXPECT_NE(info["points_file"].get<std::string>().find("points"), std::string::npos);
  EXPECT_GT(info["points_in_view"], 0.9);
  const std::string text = gflow({"info", scene().path(), "--set", "scene.max_steps=2"}).out;
  EXPECT_NE(text.find("layout             n3v\n"), std::string::npos) << text;
  EXPECT_NE(text.find("times              0, 1\n"), std::string::npos) << text;
  expect_refused({"info", scene().path(), "--set", "loss.l1=2"}, {"loss.l1=2", "[scene]"});
}

TEST_F(FilesCommand, SplatDrawsAnArchive) {
  const TemporaryFolder folder;
  Arrays input = small_npz();
  input["v_rgb"] = Array{{12, 16, 3}, std::vector<float>(12 * 16 * 3, 1.f)};
  write_npz(folder.file("in.npz"), input);
  const Outcome outcome = gflow({"splat", folder.file("in.npz"), "-o", folder.file("out.npz")});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const Arrays output = read_npz(folder.file("out.npz"));
  EXPECT_EQ(output.at("rgb").shape, (std::vector<size_t>{12, 16, 3}));
  EXPECT_EQ(output.at("alpha").shape, (std::vector<size_t>{12, 16}));
  EXPECT_EQ(output.at("g_rgb_means").shape, (std::vector<size_t>{2, 3}));
}

TEST_F(FilesCommand, AFileWithoutGaussiansIsNeitherDrawnNorExported) {
  const TemporaryFolder folder, out;
  const std::string none = folder.file("none.ply");
  write_ply(none, SplatTable(0, 0).table);
  expect_refused({"render", none, "-o", out.file("drawn")},
                 {none, "contains no Gaussians", "cameras.json"});
  for (const char* name : {"out.ply", "out.splat"})
    expect_refused({"export", none, "-o", out.file(name)}, {none, "none of its 0 Gaussians"});
  EXPECT_EQ(out.count(), 0u);
}

TEST_F(FilesCommand, AFileWithoutGaussiansIsNotImported) {
  const TemporaryFolder folder;
  write_ply(folder.file("none.ply"), SplatTable(0, 0).table);
  expect_refused({"import", folder.file("none.ply"), "-o", folder.file("out.ply")},
                 {"none.ply", "contains no Gaussians"});
  EXPECT_FALSE(fs::exists(folder.file("out.ply")));
}

TEST_F(FilesCommand, NothingIsWrittenOverWhatItIsMadeFrom) {
  const TemporaryFolder folder;
  const std::string ply = folder.file("a.ply"), npz = folder.file("in.npz");
  fs::copy_file(model(), ply);
  write_npz(npz, small_npz());
  fs::create_symlink("a.ply", folder.file("link.ply"));
  const std::string before = contents(ply), archive = contents(npz);
  expect_refused({"export", ply, "-o", ply}, {"a.ply", "the input file"});
  expect_refused({"export", ply, "-o", folder.file("link.ply")}, {"link.ply", "the input file"});
  expect_refused({"import", ply, "-o", folder.path() + "/./a.ply"}, {"the input file"});
  expect_refused({"splat", npz, "-o", npz}, {"in.npz", "the input file"});
  EXPECT_TRUE(contents(ply) == before);
  EXPECT_TRUE(contents(npz) == archive);
}

TEST_F(FilesCommand, NothingIsWrittenOverTheFilesOfARun) {
  const TemporaryFolder folder;
  const std::string still = folder.file("still.ply"), npz = folder.file("in.npz");
  ASSERT_EQ(gflow({"export", run(), "-o", still}).code, 0);
  write_npz(npz, small_npz());
  const std::string checkpoint = run() + "/checkpoints/iteration_3.npz";
  const auto all = [&] {
    return contents(checkpoint) + contents(model()) + contents(run() + "/input.ply") +
           contents(run() + "/config.toml");
  };
  const std::string before = all();
  expect_refused({"export", run(), "-o", model()}, {"reserved for the files of the run", run()});
  expect_refused({"export", run(), "-o", run() + "/input.ply"}, {"input.ply"});
  expect_refused({"export", run(), "-o", run() + "/checkpoints", "--format", "ply-sequence"},
                 {"it belongs to a run"});
  expect_refused({"import", still, "-o", run() + "/point_cloud/other.ply"}, {"other.ply"});
  expect_refused({"import", still, "-o", checkpoint}, {"end its name in .ply"});
  expect_refused({"splat", npz, "-o", checkpoint}, {"reserved for the files of the run"});
  for (const std::string& path : {checkpoint, run() + "/config.toml"})
    for (const std::vector<std::string>& command :
         {std::vector<std::string>{"stress", "--only", "5", "--json", path},
          {"bench", "raster", "--pixels", "16x16", "--gaussians", "20", "--json", path},
          {"bench", "pareto", "--markdown", path}})
      expect_refused(command, {path, "reserved for the files of the run"});
  EXPECT_TRUE(all() == before);
  // Other files may be put beside them.
  const std::string own = run() + "/still.splat";
  EXPECT_EQ(gflow({"export", run(), "-o", own}).code, 0);
  EXPECT_EQ(gflow({"export", run(), "-o", own}).code, 0);
  fs::remove(own);
}

TEST_F(FilesCommand, ANameThatIsNotUtf8IsNoObstacle) {
  const TemporaryFolder folder;
  const std::string name = folder.path() + "/a\xff.ply";
  fs::copy_file(model(), name);
  const Outcome outcome = gflow({"info", "--json", name});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("a\xef\xbf\xbd.ply"), std::string::npos) << outcome.out;
}

TEST_F(FilesCommand, ARunOfASceneWhoseNameIsNotUtf8GoesOn) {
  const TemporaryFolder folder;
  const std::string odd = folder.path() + "/caf\xe9 %41", out = folder.path() + "/run";
  fs::copy(scene().path(), odd, fs::copy_options::recursive);
  const std::vector<std::string> few = {"--iterations", "2", "--quiet", "--set", "init.count=50"};
  std::vector<std::string> words = {"train", odd, "-o", out};
  words.insert(words.end(), few.begin(), few.end());
  ASSERT_EQ(gflow(words).code, 0);
  EXPECT_EQ(gflow({"eval", out}).code, 0);
  EXPECT_EQ(gflow({"train", "-o", out, "--resume", "--quiet"}).code, 0);
}

TEST_F(FilesCommand, WhatATerminalObeysIsNotWrittenToIt) {
  const TemporaryFolder folder;
  const std::string odd = folder.path() + "/\x1b]2;title\x07";
  const Outcome outcome = gflow({"export", run(), "-o", odd, "--format", "ply"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("\\x1b]2;title\\x07"), std::string::npos) << outcome.out;
  EXPECT_EQ(gflow({"info", odd}).out.find('\x1b'), std::string::npos);
}

TEST_F(FilesCommand, ScalesThatNoFloatHoldsAreTold) {
  const TemporaryFolder folder;
  const std::string still = folder.file("still.ply");
  ASSERT_EQ(gflow({"export", run(), "-o", still}).code, 0);
  PlyTable table = read_ply(still);
  table.values[size_t(table.column("scale_1"))] = 89;
  write_ply(still, table);
  const Outcome outcome = gflow({"render", still, "-o", folder.path() + "/out", "--times", "0"});
  EXPECT_NE(outcome.err.find("1 of the Gaussians"), std::string::npos) << outcome.err;
}

TEST_F(FilesCommand, GaussiansThatCannotBeDrawnAreLeftOutUnlessStrict) {
  const TemporaryFolder folder;
  const std::string still = folder.file("still.ply"), out = folder.path() + "/out";
  ASSERT_EQ(gflow({"export", run(), "-o", still}).code, 0);
  PlyTable table = read_ply(still);
  table.values[size_t(table.column("x"))] = std::nanf("");
  write_ply(still, table);
  const size_t rest = table.rows - 1;
  const std::vector<std::vector<std::string>> commands = {
      {"info", still},
      {"import", still, "-o", out + ".ply"},
      {"export", still, "-o", out + ".splat"},
      {"render", still, "-o", out, "--times", "0"},
      {"train", scene().path(), "-o", out + "_run", "--iterations", "1", "--init", still, "--set",
       "init.dynamic=0"}};
  for (std::vector<std::string> command : commands) {
    command.push_back("--quiet");
    const Outcome outcome = gflow(command);
    EXPECT_EQ(outcome.code, 0) << command[0];
    const size_t warning = outcome.err.find("1 of the " + std::to_string(table.rows));
    EXPECT_NE(warning, std::string::npos) << command[0] << outcome.err;
    EXPECT_EQ(outcome.err.find("left out"), outcome.err.rfind("left out")) << command[0];
    if (command[0] == "train") command[3] = out + "_other";
    command.push_back("--strict");
    expect_refused(command, {still, "1 of its " + std::to_string(table.rows), "NaN or Inf in x"});
  }
  EXPECT_EQ(read_ply(out + ".ply").rows, rest);
  EXPECT_FALSE(fs::exists(out + "_other"));
}

TEST_F(FilesCommand, SplatNamesGaussiansThatAreBroken) {
  const TemporaryFolder folder;
  Arrays input = small_npz();
  std::get<std::vector<float>>(input.at("scales").values)[5] = std::nanf("");
  write_npz(folder.file("in.npz"), input);
  const Outcome outcome = gflow({"splat", folder.file("in.npz"), "-o", folder.file("out.npz")});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("1 of the Gaussians"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("the first has index 1"), std::string::npos) << outcome.err;
  const Arrays output = read_npz(folder.file("out.npz"));
  EXPECT_EQ(output.at("broken").as_int(), std::vector<int32_t>{1});
  for (const float value : output.at("rgb").as_float()) EXPECT_TRUE(std::isfinite(value));
}

TEST_F(FilesCommand, SplatTellsWhatIsTooLargeForFloats) {
  const TemporaryFolder folder;
  Arrays input = small_npz();
  std::get<std::vector<float>>(input.at("colors").values)[0] = 1e38f;
  input["v_rgb"] = Array{{12, 16, 3}, std::vector<float>(12 * 16 * 3, 1e30f)};
  write_npz(folder.file("in.npz"), input);
  const Outcome outcome = gflow({"splat", folder.file("in.npz"), "-o", folder.file("out.npz")});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("are NaN or Inf: values in "), std::string::npos) << outcome.err;
}

TEST_F(FilesCommand, SplatRefusesArchivesThatAreBroken) {
  const TemporaryFolder folder;
  const std::string out = folder.path() + "/out.npz";
  expect_refused({"splat", folder.path() + "/none.npz", "-o", out}, {"none.npz"});
  folder.write("text.npz", "this is no archive");
  expect_refused({"splat", folder.file("text.npz"), "-o", out}, {"text.npz"});
  Arrays input = small_npz();
  const float nan = std::nanf("");
  input["background"] = Array{{3}, std::vector<float>{0, nan, 0}};
  write_npz(folder.file("nan.npz"), input);
  expect_refused({"splat", folder.file("nan.npz"), "-o", out}, {"nan.npz", "'background'"});
  input.erase("background");
  input["v_rgb"] = Array{{12, 16, 3}, std::vector<float>(12 * 16 * 3, nan)};
  write_npz(folder.file("v.npz"), input);
  expect_refused({"splat", folder.file("v.npz"), "-o", out}, {"v.npz", "'v_rgb'", "NaN or Inf"});
  input.erase("v_rgb");
  const Array whole = input["size"];
  input["size"] = Array{{2}, std::vector<double>{16.5, nan}};
  write_npz(folder.file("size.npz"), input);
  expect_refused({"splat", folder.file("size.npz"), "-o", out}, {"size.npz", "whole number"});
  input["size"] = whole;
  input.erase("scales");
  write_npz(folder.file("less.npz"), input);
  expect_refused({"splat", folder.file("less.npz"), "-o", out}, {"less.npz", "scales"});
  input = small_npz();
  for (const Array& means : {floats({}, {0.5f}), floats({6}, std::vector<float>(6))}) {
    input["means"] = means;
    write_npz(folder.file("flat.npz"), input);
    expect_refused({"splat", folder.file("flat.npz"), "-o", out},
                   {"flat.npz", "'means'", means.shape_text(), "expected (N, 3)"});
  }
  input = small_npz();
  input["opacities"] = Array{{3}, std::vector<float>(3, 0.5f)};
  write_npz(folder.file("odd.npz"), input);
  expect_refused({"splat", folder.file("odd.npz"), "-o", out}, {"odd.npz", "opacities"});
  input = small_npz();
  input["viewmat"] = floats({4, 4}, {1, 0, 0, NAN, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
  write_npz(folder.file("nan.npz"), input);
  expect_refused({"splat", folder.file("nan.npz"), "-o", out},
                 {"nan.npz", "viewmat", "NaN or Inf"});
  for (const float scale : {0.f, 2.f, -1.f}) {  // flat, stretched, mirrored
    input = small_npz();
    input["viewmat"] = floats({4, 4}, {scale, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
    write_npz(folder.file("pose.npz"), input);
    expect_refused({"splat", folder.file("pose.npz"), "-o", out},
                   {"pose.npz", "'viewmat'", "rotation"});
  }
  input = small_npz();
  std::vector<float> values = input["opacities"].as_float();
  values[1] = -2.5f;
  input["opacities"] = Array{input["opacities"].shape, values};
  write_npz(folder.file("logit.npz"), input);
  expect_refused({"splat", folder.file("logit.npz"), "-o", out},
                 {"logit.npz", "'opacities' has -2.5 for Gaussian 1", "logits"});
  input = small_npz();
  values = input["scales"].as_float();
  values[5] = -4;
  input["scales"] = Array{input["scales"].shape, values};
  write_npz(folder.file("log.npz"), input);
  expect_refused({"splat", folder.file("log.npz"), "-o", out},
                 {"log.npz", "'scales' has -4 for Gaussian 1", "logarithms"});
  input = small_npz();
  input["K"] = floats({3, 3}, {-16, 0, 8, 0, 16, 6, 0, 0, 1});
  write_npz(folder.file("flip.npz"), input);
  expect_refused({"splat", folder.file("flip.npz"), "-o", out}, {"flip.npz", "focal length"});
  input["K"] = floats({3, 3}, {16, .5f, 8, 0, 16, 6, 0, 0, 1});
  write_npz(folder.file("skew.npz"), input);
  expect_refused({"splat", folder.file("skew.npz"), "-o", out},
                 {"skew.npz", "skew is not supported"});
  input = small_npz();
  input["size"] = Array{{2}, std::vector<double>{65535, 65535}};  // 48 GiB of rgb alone
  write_npz(folder.file("large.npz"), input);
  expect_refused({"splat", folder.file("large.npz"), "-o", out},
                 {"large.npz", "need 98301.0 MiB, three times that ", " has "});
  // Half of the memory for the images, 24 bytes per pixel: no space for their copies.
  const double side = std::floor(std::sqrt(double(test_queue().info.global_memory) / 48));
  input["size"] = Array{{2}, std::vector<double>{side, side}};
  write_npz(folder.file("large.npz"), input);
  expect_refused({"splat", folder.file("large.npz"), "-o", out},
                 {"large.npz", " MiB, three times that "});
  EXPECT_FALSE(fs::exists(out));
  input = small_npz();
  input["v_flow"] = Array{{12, 16, 2}, std::vector<float>(12 * 16 * 2, 1.f)};
  write_npz(folder.file("still.npz"), input);
  expect_refused({"splat", folder.file("still.npz"), "-o", out}, {"still.npz", "means_t2"});
  EXPECT_FALSE(fs::exists(out));
}

}  // namespace
}  // namespace gflow
