// SPDX-License-Identifier: Apache-2.0
// `gflow view` and `gflow export scene.html` as a user runs them.
#include <nlohmann/json.hpp>

#include "tests/support/command_scene.hpp"
#include "tests/viewer/container.hpp"
#include "tests/viewer/http.hpp"

namespace gflow {
namespace {

class ViewCommand : public CommandTest {};

TEST_F(ViewCommand, ShowsARunUntilItIsInterrupted) {
  const Command command({"view", run(), model(), "--port", "0"});
  ASSERT_TRUE(wait_until([&] { return command.printed().find("/\n") != std::string::npos; }));
  const int port = port_of(command.printed().substr(0, command.printed().find("/\n")));
  const auto runs = nlohmann::json::parse(get(port, "/api/runs").body);
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_EQ(runs[0]["name"], "run");
  EXPECT_EQ(runs[0]["kind"], "run");
  EXPECT_EQ(runs[1]["kind"], "file");
  const auto info = nlohmann::json::parse(get(port, "/api/run/0/info").body);
  EXPECT_EQ(info["iteration"], 3);
  EXPECT_EQ(info["live"], false);
  EXPECT_GT(info["times"].size(), 1u);
  ASSERT_GT(info["cameras"].size(), 0u);
  EXPECT_EQ(info["cameras"][0]["split"], "train");
  EXPECT_EQ(info["cameras"][0]["image"], true);
  EXPECT_EQ(info["cameras"][0]["viewmat"].size(), 16u);
  EXPECT_EQ(info["metrics"], nlohmann::json::parse(contents(run() + "/results.json")));
  const Answer image = get(port, "/api/run/0/image?camera=1");
  EXPECT_EQ(image.status, 200);
  EXPECT_EQ(image.body.substr(1, 3), "PNG");
  const size_t cameras = info["cameras"].size();
  EXPECT_EQ(get(port, "/api/run/0/image?camera=" + std::to_string(cameras)).status, 404);
  const auto metrics = nlohmann::json::parse(get(port, "/api/run/0/metrics?from=0").body);
  EXPECT_EQ(metrics["lines"].size(), size_t(metrics["next"]));
  EXPECT_EQ(get(port, "/api/run/0/model").body, get(port, "/api/run/0/model").body);
  // The cameras beside a model, without images.
  EXPECT_EQ(nlohmann::json::parse(get(port, "/api/run/1/info").body)["cameras"][0]["image"], false);
  command.send(SIGINT);
  const Outcome outcome = command.wait();
  EXPECT_EQ(outcome.code, 130);
  EXPECT_EQ(outcome.err, "gflow: the viewer was stopped\n");
}

// A training that is watched has the same bits as one that is not.
TEST_F(ViewCommand, ShowsATrainingWithoutAnEffectOnIt) {
  const TemporaryFolder folder;
  const std::string watched = folder.path() + "/watched", alone = folder.path() + "/alone";
  const auto train = [&](const std::string& to) {
    return std::vector<std::string>{"train",        scene().path(), "-o",     to,
                                    "--iterations", "60",           "--quiet"};
  };
  std::vector<std::string> arguments = train(watched);
  for (const char* more : {"--view", "--port", "0"}) arguments.push_back(more);
  const Command command(arguments);
  ASSERT_TRUE(wait_until([&] { return command.printed().find("/\n") != std::string::npos; }));
  const int port = port_of(command.printed().substr(0, command.printed().find("/\n")));
  int models = 0;
  bool live = false;
  const auto is_over = [&] {
    const Answer state = get(port, "/api/run/0/state");
    if (state.status == 0) return true;
    live |= bool(nlohmann::json::parse(state.body)["live"]);
    const Answer model = get(port, "/api/run/0/model");
    models += model.status == 200;
    EXPECT_TRUE(model.status == 200 || model.status == 503 || model.status == 0) << model.body;
    return false;
  };
  EXPECT_TRUE(wait_until(is_over));
  EXPECT_TRUE(live);
  EXPECT_GT(models, 0);
  const Outcome outcome = command.wait();
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  ASSERT_EQ(gflow(train(alone)).code, 0);
  const std::string model = "/point_cloud/iteration_60/point_cloud.ply";
  EXPECT_TRUE(contents(watched + model) == contents(alone + model));
}

// An address that one can type, which 0.0.0.0 is not.
TEST_F(ViewCommand, NamesAnAddressOfThisMachineWhenItListensToAll) {
  const Command command({"view", run(), "--host", "0.0.0.0", "--port", "0"});
  ASSERT_TRUE(wait_until([&] { return command.printed().find("/\n") != std::string::npos; }));
  EXPECT_NE(command.printed().find("http://"), std::string::npos);
  EXPECT_EQ(command.printed().find("0.0.0.0"), std::string::npos) << command.printed();
  const int port = port_of(command.printed().substr(0, command.printed().find("/\n")));
  EXPECT_EQ(get(port, "/api/runs").status, 200);
  command.send(SIGINT);
  EXPECT_EQ(command.wait().code, 130);
}

TEST_F(ViewCommand, IsAnOptionOfTrainingWithTheSameAddresses) {
  const TemporaryFolder folder;
  const Outcome outcome =
      gflow({"train", scene().path(), "-o", folder.path() + "/run", "--iterations", "2", "--quiet",
             "--view", "--host", "0.0.0.0", "--port", "0"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("Whoever can reach this address"), std::string::npos) << outcome.out;
}

// Which way is up, for viewers that know no cameras.
TEST_F(ViewCommand, SaysUpOfAnExportedFile) {
  const TemporaryFolder folder;
  const std::string ply = folder.file("now.ply");
  ASSERT_EQ(gflow({"export", run(), "-o", ply}).code, 0);
  const auto header_of = [](const std::string& path) {
    const Command command({"view", path, "--port", "0"});
    EXPECT_TRUE(wait_until([&] { return command.printed().find("/\n") != std::string::npos; }));
    const int port = port_of(command.printed().substr(0, command.printed().find("/\n")));
    const Container container = container_of(get(port, "/api/run/0/model").body);
    command.send(SIGINT);
    command.wait();
    return container.header;
  };
  const std::vector<double> up = header_of(run())["up"], of_file = header_of(ply)["up"];
  for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(of_file[k], up[k], 1e-5);
  std::string text = contents(ply);
  const size_t at = text.find("comment up ");
  ASSERT_NE(at, std::string::npos);
  text.replace(at, text.find('\n', at) - at, "comment up 1 0 0");
  EXPECT_EQ(header_of(folder.write("other.ply", text))["up"], (std::vector<double>{1, 0, 0}));
}

TEST_F(ViewCommand, RefusesWhatItCannotShow) {
  const TemporaryFolder folder;
  folder.write("text.txt", "no splats");
  folder.write("scene.html", "<!DOCTYPE html>");
  expect_refused({"view", folder.path()}, {"not a run"});
  expect_refused({"view", folder.file("scene.html")}, {"scene.html", "in a browser"});
  expect_refused({"view", folder.file("text.txt")}, {"text.txt"});
  expect_refused({"view", folder.path() + "/none"}, {"none", "no such run"});
  expect_refused({"view", run(), "--port", "70000"}, {"--port"});
  expect_refused({"view", run(), "--host", "no.such.host.invalid"}, {"no.such.host.invalid"});
}

TEST_F(ViewCommand, ExportsOneFileWithTheModel) {
  const TemporaryFolder folder;
  const std::string html = folder.file("scene.html");
  EXPECT_EQ(gflow({"export", run(), "-o", html}).err, "");
  const std::string page = contents(html);
  EXPECT_EQ(page.rfind("<!DOCTYPE html>", 0), 0u);
  EXPECT_NE(page.find("id=\"gflow-model\""), std::string::npos);
  const auto facts = nlohmann::json::parse(gflow({"info", model(), "--json"}).out);
  EXPECT_LT(page.size(), 200 * size_t(facts["gaussians"]) + 150'000);
  expect_refused({"export", run(), "-o", html, "--times", "0.5"}, {"html", "--times"});
  expect_refused({"export", run(), "-o", html, "--format", "ply"}, {"html", "ply"});
}

}  // namespace
}  // namespace gflow
