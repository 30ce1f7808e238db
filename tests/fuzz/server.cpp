// SPDX-License-Identifier: Apache-2.0
// What a browser, or anybody else on this machine, sends to `gflow view`.
#include "apps/viewer/server.hpp"

#include "optim/model/model.hpp"
#include "tests/fuzz/inputs.hpp"
#include "tests/support/random_model.hpp"
#include "tests/viewer/http.hpp"

namespace gflow::fuzz {
namespace {

constexpr const char* kSecret = "not for the viewer";

// A server of one file. Beside it lies another one that it must not serve.
class Viewer {
 public:
  Viewer() : device_([]() -> std::unique_ptr<Queue> { throw Error("no device"); }) {
    const std::string file = folder() + "/viewed/model.ply";
    fs::create_directories(folder() + "/viewed");
    write_model(file, random_model(2, 1));
    write("viewed/secret", kSecret);
    std::vector<std::unique_ptr<ViewSource>> sources;
    sources.push_back(
        std::make_unique<ViewSource>(file, latest_iteration, Undrawable::left_out, device_));
    server_.emplace(std::move(sources), ServerOptions());
  }
  int port() const { return port_of(server_->address()); }

 private:
  ViewDevice device_;
  std::optional<ViewServer> server_;
};

// An answer is none, an error, or what the page may have; and the server answers the next request.
void server(const uint8_t* bytes, size_t size) {
  may_refuse([&] {
    const Viewer viewer;  // Error: this gflow has no server
    const Answer answer = ask(viewer.port(), {bytes, bytes + size}, 20, true);
    if (answer.body.find(kSecret) != std::string::npos)
      throw std::logic_error("the server sent a file that is not the viewer's");
    if (get(viewer.port(), "/api/runs").status != 200)
      throw std::logic_error("the server does not answer any more");
  });
}

void server_seeds(const std::string& to) {
  const std::string host = " HTTP/1.1\r\nHost: localhost\r\n";
  for (const auto& [name, request] : std::vector<std::pair<std::string, std::string>>{
           {"page", "GET /" + host + "Connection: close\r\n\r\n"},
           {"script", "GET /viewer/main.js" + host + "Accept-Encoding: gzip, br\r\n\r\n"},
           {"model", "GET /api/run/0/model" + host + "If-None-Match: \"1-2-3\"\r\n\r\n"},
           {"info", "HEAD /api/run/0/info" + host + "Range: bytes=0-9,20-\r\n\r\n"},
           {"lines", "GET /api/run/0/metrics?from=3&from=%31" + host + "\r\n"},
           {"path", "GET /viewer/..%2f../viewed/secret" + host + "\r\n"},
           {"body",
            "POST /api/runs" + host +
                "Transfer-Encoding: chunked\r\nExpect: 100-continue\r\n\r\n4\r\nabcd\r\n0\r\n\r\n"},
           {"form", "PUT /x" + host +
                        "Content-Type: multipart/form-data; boundary=b\r\nContent-Length: "
                        "60\r\n\r\n--b\r\nContent-Disposition: form-data; "
                        "name=\"a\"\r\n\r\n1\r\n--b--\r\n"}})
    seed(to, name, request);
}

}  // namespace

std::vector<Target> server_targets() { return {{"server", server, server_seeds, its_size}}; }

}  // namespace gflow::fuzz
