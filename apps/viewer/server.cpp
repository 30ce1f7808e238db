// SPDX-License-Identifier: Apache-2.0
#include "apps/viewer/server.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/viewer/page_files.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/json_text.hpp"

#ifdef GFLOW_WITH_HTTPLIB
#include <httplib.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <utility>
#endif

namespace gflow {
namespace {

// An address under which other machines may reach one that listens on all; this machine's own if
// it has no other.
std::string reachable_address(bool is_v6) {
  std::string found = is_v6 ? "::1" : "127.0.0.1";
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return found;
  const std::unique_ptr<ifaddrs, void (*)(ifaddrs*)> guard(all, ::freeifaddrs);
  for (const ifaddrs* one = all; one; one = one->ifa_next) {
    if (!one->ifa_addr || one->ifa_addr->sa_family != AF_INET) continue;
    char text[INET_ADDRSTRLEN];
    const auto* address = reinterpret_cast<const sockaddr_in*>(one->ifa_addr);
    if (!::inet_ntop(AF_INET, &address->sin_addr, text, sizeof text) || is_loopback(text)) continue;
    return text;
  }
  return found;
}

}  // namespace

bool is_loopback(const std::string& host) {
  in_addr v4;
  if (::inet_pton(AF_INET, host.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  return host == "localhost" || host == "::1";
}

#ifdef GFLOW_WITH_HTTPLIB
namespace {

using Json = nlohmann::ordered_json;
using httplib::Request;
using httplib::Response;

constexpr size_t kThreads = 16, kWaiting = 64;  // connections served at once, and waiting
constexpr time_t kSeconds = 5;                  // without a byte of a request or an answer

// A bounded number of connections: while it is reached, no other one is accepted.
class BoundedTasks : public httplib::TaskQueue {
 public:
  using Task = std::function<void()>;
  // void in old versions of the library, bool in new ones.
  using Accepted = decltype(std::declval<httplib::TaskQueue&>().enqueue(Task()));

  BoundedTasks() {
    for (size_t i = 0; i < kThreads; ++i) threads_.emplace_back([this] { work(); });
  }
  Accepted enqueue(Task task) override {
    {
      std::unique_lock<std::mutex> lock(mutex_);
      changed_.wait(lock, [&] { return tasks_.size() < kWaiting; });
      tasks_.push_back(std::move(task));
    }
    changed_.notify_all();
    return Accepted(true);
  }
  void shutdown() override {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      over_ = true;
    }
    changed_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

 private:
  void work() {
    for (;;) {
      Task task;
      {
        std::unique_lock<std::mutex> lock(mutex_);
        changed_.wait(lock, [&] { return over_ || !tasks_.empty(); });
        if (tasks_.empty()) return;
        task = std::move(tasks_.front());
        tasks_.pop_front();
      }
      changed_.notify_all();
      task();
    }
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Task> tasks_;
  bool over_ = false;
  std::vector<std::thread> threads_;
};

// A number of few digits.
std::optional<size_t> small_number(const std::string& text) {
  const auto digit = [](unsigned char c) { return std::isdigit(c) != 0; };
  if (text.empty() || text.size() > 9 || !std::all_of(text.begin(), text.end(), digit))
    return std::nullopt;
  return size_t(std::stoul(text));
}

void answer_json(Response& response, const Json& json, int status = 200) {
  response.status = status;
  response.set_content(json_text(json), "application/json");
}
void answer_error(Response& response, int status, const std::string& sentence) {
  answer_json(response, {{"error", printable(sentence)}}, status);
}

std::string type_of(const std::string& file) {
  const std::string ending = file.substr(std::min(file.rfind('.'), file.size()));
  return ending == ".html"  ? "text/html; charset=utf-8"
         : ending == ".css" ? "text/css; charset=utf-8"
                            : "text/javascript; charset=utf-8";
}

// The host of "127.0.0.1:8008" or "[::1]:8008".
std::string host_of(const std::string& field) {
  if (!field.empty() && field[0] == '[')
    return field.substr(1, std::max<size_t>(field.find(']'), 1) - 1);
  return field.substr(0, field.find(':'));
}

}  // namespace

struct ViewServer::State {
  std::vector<std::unique_ptr<ViewSource>> sources;
  bool loopback = true;
  httplib::Server server;
  std::thread thread;

  void answer(const Request& request, Response& response);
  void answer_source(const std::string& path, const Request& request, Response& response);
  void answer_of(ViewSource& source, const std::string& what, const Request& request,
                 Response& response);
};

void ViewServer::State::answer_of(ViewSource& source, const std::string& what,
                                  const Request& request, Response& response) {
  const auto number = [&](const char* name) {
    return small_number(request.has_param(name) ? request.get_param_value(name) : "0");
  };
  if (what == "info") return answer_json(response, source.info());
  if (what == "state") return answer_json(response, source.state());
  if (what == "metrics") {
    const auto from = number("from");
    if (!from) return answer_error(response, 400, "'from' is not a number of a line");
    return answer_json(response, source.metrics(*from));
  }
  if (what == "image") {
    const auto camera = number("camera");
    if (!camera) return answer_error(response, 400, "'camera' is not a number of a camera");
    const std::vector<uint8_t> png = source.image(*camera);
    response.status = 200;
    response.set_header("Cache-Control", "max-age=3600");
    return response.set_content(reinterpret_cast<const char*>(png.data()), png.size(), "image/png");
  }
  if (what != "model") return answer_error(response, 404, "there is nothing of this name");
  const ViewSource::Packed model = source.model();
  const std::string tag = '"' + model.tag + '"';
  response.set_header("ETag", tag);
  if (request.get_header_value("If-None-Match").find(tag) != std::string::npos) {
    response.status = 304;
    return;
  }
  response.status = 200;
  response.set_content_provider(
      model.bytes->size(), "application/octet-stream",
      [bytes = model.bytes](size_t offset, size_t length, httplib::DataSink& sink) {
        constexpr size_t piece = size_t{1} << 18;
        return sink.write(bytes->data() + offset, std::min(length, piece));
      });
}

void ViewServer::State::answer_source(const std::string& path, const Request& request,
                                      Response& response) {
  const size_t slash = path.find('/');
  const auto index = small_number(path.substr(0, slash));
  if (!index || *index >= sources.size() || slash == std::string::npos)
    return answer_error(response, 404, "there is no run of this number");
  answer_of(*sources[*index], path.substr(slash + 1), request, response);
}

void ViewServer::State::answer(const Request& request, Response& response) {
  response.set_header("X-Content-Type-Options", "nosniff");
  response.set_header("Cross-Origin-Resource-Policy", "same-origin");
  response.set_header("Referrer-Policy", "no-referrer");
  response.set_header("Content-Security-Policy",
                      "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' blob: "
                      "data:; worker-src 'self' blob:; connect-src 'self' blob: data:; media-src "
                      "blob:; frame-ancestors 'none'");
  if (request.method != "GET" && request.method != "HEAD") {
    response.set_header("Allow", "GET, HEAD");
    return answer_error(response, 405, "only GET and HEAD are answered");
  }
  // A page of another site whose name leads to this machine must not read what is here.
  if (loopback && !is_loopback(host_of(request.get_header_value("Host"))))
    return answer_error(response, 403, "this server answers to the names of this machine only");
  if (!request.ranges.empty()) return answer_error(response, 416, "only whole files are sent");
  response.set_header("Cache-Control", "no-cache");

  const std::string& path = request.path;
  const std::string page = "/viewer/", run = "/api/run/";
  const std::string file = path == "/"                ? "index.html"
                           : path.rfind(page, 0) == 0 ? path.substr(page.size())
                                                      : "";
  if (const auto found = page_files().find(file); found != page_files().end()) {
    response.status = 200;
    return response.set_content(found->second, type_of(file));
  }
  if (path == "/api/runs") {
    Json list = Json::array();
    for (size_t i = 0; i < sources.size(); ++i)
      list.push_back({{"id", i},
                      {"name", sources[i]->name()},
                      {"path", sources[i]->path()},
                      {"kind", sources[i]->is_run() ? "run" : "file"},
                      {"live", sources[i]->is_live()}});
    return answer_json(response, list);
  }
  if (path.rfind(run, 0) == 0) return answer_source(path.substr(run.size()), request, response);
  answer_error(response, 404, "there is nothing of this name");
}

ViewServer::ViewServer(std::vector<std::unique_ptr<ViewSource>> sources,
                       const ServerOptions& options)
    : state_(std::make_unique<State>()) {
  State& state = *state_;
  state.sources = std::move(sources);
  state.loopback = is_loopback(options.host);
  httplib::Server& server = state.server;
  server.new_task_queue = [] { return new BoundedTasks; };
  server.set_payload_max_length(1024);
  server.set_read_timeout(kSeconds);
  server.set_write_timeout(kSeconds);
  server.set_keep_alive_timeout(2);
  server.set_keep_alive_max_count(200);
  server.set_tcp_nodelay(true);
  // Not the library's SO_REUSEPORT, with which two servers could have the same port.
  server.set_socket_options([](socket_t socket) {
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
  server.set_pre_routing_handler([&state](const Request& request, Response& response) {
    try {
      state.answer(request, response);
    } catch (const NotYet& problem) {
      answer_error(response, 503, problem.what());
    } catch (const NoSuchView& problem) {
      answer_error(response, 404, problem.what());
    } catch (const std::bad_alloc&) {
      answer_error(response, 500, "out of memory");
    } catch (const std::exception& problem) {
      answer_error(response, 500, problem.what());
    }
    return httplib::Server::HandlerResponse::Handled;
  });
  int port = options.port;
  errno = 0;
  if (port == 0)
    port = server.bind_to_any_port(options.host);
  else if (!server.bind_to_port(options.host, port))
    port = -1;
  if (port < 0) {
    const bool taken = errno == EADDRINUSE;
    throw Error(fmt::format(
        "cannot listen on port {} of {}: {}", options.port, options.host,
        taken ? "another program uses it; choose one with --port, or --port 0 for any free one"
        : errno == EACCES || errno == EADDRNOTAVAIL
            ? std::strerror(errno)
            : "this is not an address of this machine, or the port is not available"));
  }
  const bool is_v6 = options.host.find(':') != std::string::npos;
  const bool all = options.host == "0.0.0.0" || options.host == "::";
  const std::string host = all ? reachable_address(is_v6) : options.host;
  address_ = fmt::format(host.find(':') != std::string::npos ? "http://[{}]:{}/" : "http://{}:{}/",
                         host, port);
  state.thread = std::thread([&server] { server.listen_after_bind(); });
}

ViewServer::~ViewServer() {
  // stop() is without effect before the thread listens.
  while (!state_->server.is_running() && state_->server.is_valid())
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  state_->server.stop();
  state_->thread.join();
}

#else

struct ViewServer::State {};

ViewServer::ViewServer(std::vector<std::unique_ptr<ViewSource>>, const ServerOptions&) {
  throw Error(
      "this gflow was built without a web server: build it with cpp-httplib "
      "(libcpp-httplib-dev), or write a file with gflow export RUN -o scene.html");
}
ViewServer::~ViewServer() = default;

#endif

}  // namespace gflow
