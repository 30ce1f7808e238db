// SPDX-License-Identifier: Apache-2.0
// The viewer's server answers what its page asks for and nothing else.
#include "apps/viewer/server.hpp"

#include "apps/viewer/page_files.hpp"
#include "tests/support/lively_model.hpp"
#include "tests/viewer/container.hpp"
#include "tests/viewer/http.hpp"

namespace gflow {
namespace {

using nlohmann::json;

class ViewerServer : public testing::Test {
 protected:
  ViewerServer() {
    write_model(folder_.file("first.ply"), model_);
    for (const char* name : {"first.ply"})
      sources_.push_back(std::make_unique<ViewSource>(folder_.file(name), latest_iteration,
                                                      Undrawable::left_out, device_));
    server_ = std::make_unique<ViewServer>(std::move(sources_), ServerOptions{});
    port_ = port_of(server_->address());
  }
  Answer get(const std::string& path, const std::string& headers = "",
             const std::string& method = "GET", const std::string& host = "localhost") const {
    return gflow::get(port_, path, headers, method, host);
  }
  Answer model() const { return get("/api/run/0/model"); }

  TemporaryFolder folder_;
  HostModel model_ = lively_model(MotionModelKind::spacetime);
  ViewDevice device_{[] { return std::unique_ptr<Queue>(new Queue(test_queue())); }};
  std::vector<std::unique_ptr<ViewSource>> sources_;
  std::unique_ptr<ViewServer> server_;
  int port_ = 0;
};

TEST_F(ViewerServer, SendsThePageAndWhatItShows) {
  EXPECT_EQ(server_->address().rfind("http://127.0.0.1:", 0), 0u);
  for (const auto& [name, text] : page_files()) {
    const Answer answer = get("/viewer/" + name);
    EXPECT_EQ(answer.status, 200) << name;
    EXPECT_EQ(answer.body, text) << name;
  }
  EXPECT_EQ(get("/").body, page_files().at("index.html"));
  const json runs = json::parse(get("/api/runs").body);
  ASSERT_EQ(runs.size(), 1u);
  EXPECT_EQ(runs[0]["name"], "first.ply");
  EXPECT_EQ(runs[0]["live"], false);
  EXPECT_EQ(json::parse(get("/api/run/0/info").body)["kind"], "file");
  EXPECT_EQ(container_of(model().body).arrays.at("velocities"), model_.groups.at("velocities"));
  EXPECT_EQ(get("/api/run/0/image?camera=0").status, 404);  // a file has none
}

TEST_F(ViewerServer, SendsAModelAgainOnlyWhenItHasChanged) {
  const Answer first = model();
  const size_t at = first.head.find("ETag: ");
  ASSERT_NE(at, std::string::npos);
  const std::string tag = first.head.substr(at + 6, first.head.find('\r', at) - at - 6);
  const Answer again = get("/api/run/0/model", "If-None-Match: " + tag + "\r\n");
  EXPECT_EQ(again.status, 304);
  EXPECT_EQ(again.body, "");
  EXPECT_EQ('"' + std::string(json::parse(get("/api/run/0/state").body)["model"]) + '"', tag);
  model_.groups["means"][0] += 1;
  write_model(folder_.file("first.ply"), model_);
  const Answer changed = get("/api/run/0/model", "If-None-Match: " + tag + "\r\n");
  EXPECT_EQ(changed.status, 200);
  EXPECT_EQ(container_of(changed.body).arrays.at("means"), model_.groups.at("means"));
  std::filesystem::remove(folder_.file("first.ply"));
  const Answer gone = model();
  EXPECT_EQ(gone.status, 503);
  EXPECT_NE(std::string(json::parse(gone.body)["error"]), "");
}

TEST_F(ViewerServer, AnswersGetAndHeadOnly) {
  const Answer head = get("/", "", "HEAD");
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.body, "");
  for (const char* method : {"POST", "PUT", "DELETE", "PATCH", "OPTIONS"})
    EXPECT_EQ(get("/api/runs", "", method).status, 405) << method;
}

// Also no name from outside that leads to this machine (DNS rebinding).
TEST_F(ViewerServer, HasNothingElse) {
  for (const char* path :
       {"/viewer/", "/viewer/../CMakeLists.txt", "/viewer/%2e%2e/%2e%2e/etc/passwd", "/etc/passwd",
        "//etc/passwd", "/viewer/main.js/..", "/api", "/api/run", "/api/run/", "/api/run/0",
        "/api/run/0/", "/api/run/1/info", "/api/run/-1/info", "/api/run/0x0/info",
        "/api/run/99999999999999999999/info", "/api/run/0/model/", "/api/run/0/config.toml"})
    EXPECT_EQ(get(path).status, 404) << path;
  EXPECT_EQ(get("/", "", "GET", "evil.example").status, 403);
  EXPECT_EQ(get("/", "", "GET", "127.0.0.1.evil.example").status, 403);
  EXPECT_EQ(get("/", "", "GET", "127.0.0.1:80").status, 200);
  EXPECT_EQ(get("/api/run/0/metrics?from=1e9").status, 400);
  EXPECT_EQ(get("/api/run/0/image?camera=-1").status, 400);
  EXPECT_EQ(get("/api/run/0/model", "Range: bytes=0-10,5-20\r\n").status, 416);
}

TEST_F(ViewerServer, SurvivesRequestsThatNoBrowserSends) {
  const std::string many(9000, 'a');
  for (const std::string& bytes :
       {std::string("\r\n\r\n"), std::string("GET\r\n\r\n"), std::string(3000, '\0'),
        "GET /" + many + " HTTP/1.1\r\n\r\n", "GET / HTTP/1.1\r\n" + many + ": x\r\n\r\n",
        std::string("GET / HTTP/9.9\r\n\r\n"),
        std::string("GET /%zz%00 HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"),
        std::string("POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: "
                    "99999999999\r\nConnection: close\r\n\r\n"),
        std::string(
            "GET / HTTP/1.1\r\nHost: localhost\r\nRange: bytes=9-1\r\nConnection: close\r\n\r\n")})
    EXPECT_NE(ask(port_, bytes, 0.3).status, 200) << bytes.substr(0, 40);
  EXPECT_EQ(get("/").status, 200);
}

TEST_F(ViewerServer, SaysThatAPortIsTaken) {
  expect_error(
      [&] {
        ViewServer({}, {"127.0.0.1", port_});
      },
      {"port " + std::to_string(port_), "another program uses it", "--port"});
}

TEST(ViewerHosts, OfThisMachineOnlyAreLoopback) {
  for (const char* host : {"localhost", "127.0.0.1", "127.1.2.3", "::1"})
    EXPECT_TRUE(is_loopback(host)) << host;
  for (const char* host : {"0.0.0.0", "192.168.0.1", "", "127.evil.example", "127.0.0.1.example"})
    EXPECT_FALSE(is_loopback(host)) << host;
}

}  // namespace
}  // namespace gflow
