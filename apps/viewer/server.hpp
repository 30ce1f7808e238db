// SPDX-License-Identifier: Apache-2.0
// The viewer's web server: the page, and what it asks for (apps/viewer/README.md). Answers GET and
// HEAD only, writes nothing, and has no path to the file system.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "apps/viewer/view_source.hpp"

namespace gflow {

struct ServerOptions {
  std::string host = "127.0.0.1";  // address to listen on
  int port = 0;                    // 0: a free one
};

// Whether a host name or address means this machine only.
bool is_loopback(const std::string& host);

class ViewServer {
 public:
  // Listens until it is destroyed; answers in threads of its own. Error if the address cannot be
  // used, or if this gflow was built without cpp-httplib.
  ViewServer(std::vector<std::unique_ptr<ViewSource>> sources, const ServerOptions& options);
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  // "http://127.0.0.1:8008/". With the host 0.0.0.0 that of a network card.
  const std::string& address() const { return address_; }

 private:
  struct State;
  std::unique_ptr<State> state_;
  std::string address_;
};

}  // namespace gflow
