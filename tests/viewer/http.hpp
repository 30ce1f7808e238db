// SPDX-License-Identifier: Apache-2.0
// A web client for tests, which can also send what no browser would.
#pragma once
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

namespace gflow {

struct Answer {
  int status = 0;  // 0: no answer
  std::string head, body;
};

// Sends bytes to a port of this machine and reads until the other side closes, or is silent for
// `patience` seconds. `ends`: tells it that no more bytes will come.
inline Answer ask(int port, const std::string& bytes, double patience = 20, bool ends = false) {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  const timeval limit{time_t(patience), suseconds_t(1e6 * (patience - double(time_t(patience))))};
  ::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(uint16_t(port));
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  Answer answer;
  std::string all;
  if (::connect(socket, reinterpret_cast<sockaddr*>(&to), sizeof to) == 0) {
    size_t sent = 0;
    while (sent < bytes.size()) {
      const ssize_t n = ::send(socket, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (n <= 0) break;
      sent += size_t(n);
    }
    if (ends) ::shutdown(socket, SHUT_WR);
    char piece[65536];
    for (ssize_t n; (n = ::recv(socket, piece, sizeof piece, 0)) > 0;) all.append(piece, size_t(n));
  }
  ::close(socket);
  const size_t end = all.find("\r\n\r\n");
  if (all.rfind("HTTP/1.1 ", 0) != 0 || end == std::string::npos) return answer;
  return {std::stoi(all.substr(9, 3)), all.substr(0, end), all.substr(end + 4)};
}

inline Answer get(int port, const std::string& path, const std::string& headers = "",
                  const std::string& method = "GET", const std::string& host = "localhost") {
  return ask(port, method + " " + path + " HTTP/1.1\r\nHost: " + host + "\r\n" + headers +
                       "Connection: close\r\n\r\n");
}

// The port in "http://127.0.0.1:8008/".
inline int port_of(const std::string& address) {
  const size_t colon = address.rfind(':');
  return colon == std::string::npos ? 0 : std::atoi(address.c_str() + colon + 1);
}

}  // namespace gflow
