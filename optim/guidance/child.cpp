// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/child.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <thread>

#include "optim/guidance/guidance.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/running_program.hpp"

namespace gflow {
namespace {

using Clock = std::chrono::steady_clock;
using Milliseconds = std::chrono::milliseconds;

int left_until(Clock::time_point end) {
  const auto left = std::chrono::duration_cast<Milliseconds>(end - Clock::now()).count();
  return int(std::clamp<long long>(left, 0, 1 << 30));
}

std::string in_seconds(Milliseconds time) { return fmt::format("{:g}", time.count() / 1000.0); }

// In a shell user's terms.
std::string ending(int status) {
  const bool missing = WIFEXITED(status) && WEXITSTATUS(status) == 127;
  return ending_of(status) + (missing ? " (command not found)" : "");
}

struct SpawnSettings {
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  SpawnSettings(int in, int out) {
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, in, STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&files, out, STDOUT_FILENO);
    posix_spawnattr_init(&attributes);
    // A process group of its own, no blocked signals, default handlers.
    posix_spawnattr_setpgroup(&attributes, 0);
    sigset_t none, usual;
    sigemptyset(&none);
    sigemptyset(&usual);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) sigaddset(&usual, signal);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &usual);
    posix_spawnattr_setflags(
        &attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  }
  ~SpawnSettings() {
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&attributes);
  }
};

}  // namespace

Child::Child(const std::string& command) : command_(command) {
  const auto failed = [&](const std::string& what) {
    return GuidanceFailed(fmt::format("cannot start the guidance program `{}`: {}", command, what));
  };
  // Input through a socket, because writing to a closed socket can avoid SIGPIPE (MSG_NOSIGNAL).
  int to[2], from[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, to) != 0)
    throw failed(std::strerror(errno));
  if (pipe2(from, O_CLOEXEC) != 0) {
    const std::string reason = std::strerror(errno);
    close(to[0]), close(to[1]);
    throw failed(reason);
  }
  in_ = to[0];
  out_ = from[0];
  const SpawnSettings settings(to[1], from[1]);
  std::string text = command;
  char shell[] = "sh", flag[] = "-c";
  char* arguments[] = {shell, flag, text.data(), nullptr};
  const int code =
      posix_spawn(&pid_, "/bin/sh", &settings.files, &settings.attributes, arguments, environ);
  close(to[1]), close(from[1]);
  if (code == 0) return;
  close(in_), close(out_);
  throw failed(std::strerror(code));
}

Child::~Child() {
  close(in_);
  ended_within(Milliseconds(1000));
  kill(-pid_, SIGTERM);  // signals the whole group, also if the process itself has ended
  const auto end = Clock::now() + Milliseconds(1000);
  ended_within(Milliseconds(1000));
  if (!ended_) kill(-pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
  // The process group exists as long as one of its processes does.
  bool left = true;
  while ((left = kill(-pid_, 0) == 0) && Clock::now() < end)
    std::this_thread::sleep_for(Milliseconds(2));
  if (left) kill(-pid_, SIGKILL);
  close(out_);
}

bool Child::ended_within(Milliseconds time) {
  const auto end = Clock::now() + time;
  for (;;) {
    // WNOWAIT leaves a zombie, so that the pid is not reused.
    siginfo_t info{};
    if (!ended_ && waitid(P_PID, id_t(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
        info.si_pid == pid_) {
      ended_ = true;
      status_ = info.si_code == CLD_EXITED ? W_EXITCODE(info.si_status, 0) : info.si_status;
    }
    if (ended_ || Clock::now() >= end) break;
    std::this_thread::sleep_for(Milliseconds(2));
  }
  return ended_;
}

void Child::throw_process_ended() {
  const bool known = ended_within(Milliseconds(1000));
  throw GuidanceFailed(fmt::format("the guidance program `{}` {}", command_,
                                   known ? ending(status_) : "closed its output"));
}

void Child::send(const std::string& text, Milliseconds time_out) {
  const auto end = Clock::now() + time_out;
  const std::string line = text + "\n";
  for (size_t sent = 0; sent < line.size();) {
    const ssize_t n =
        ::send(in_, line.data() + sent, line.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n > 0) {
      sent += size_t(n);
      continue;
    }
    if (errno == EINTR) continue;
    if (errno != EAGAIN && errno != EWOULDBLOCK) return;  // it ended; its last output may say why
    pollfd ready{in_, POLLOUT, 0};
    if (poll(&ready, 1, left_until(end)) == 0)
      throw GuidanceFailed(fmt::format(
          "the guidance program `{}` has not read its input for {} s (guidance.timeout)", command_,
          in_seconds(time_out)));
  }
}

std::string Child::receive(Milliseconds time_out) {
  constexpr size_t longest = 1 << 20;
  const auto end = Clock::now() + time_out;
  for (;;) {
    const size_t line_end = received_.find('\n');
    if (line_end != std::string::npos) {
      const std::string line = received_.substr(0, line_end);
      received_.erase(0, line_end + 1);
      return line;
    }
    if (received_.size() > longest)
      throw GuidanceFailed(
          fmt::format("the guidance program `{}` wrote {} bytes without a line break to standard "
                      "output, which is reserved for its answers",
                      command_, received_.size()));
    if (interrupted())
      throw GuidanceFailed(
          fmt::format("interrupted while waiting for the guidance program `{}`", command_));
    // Short waits, because a signal may be delivered to another thread.
    pollfd ready{out_, POLLIN, 0};
    int n = poll(&ready, 1, std::min(left_until(end), 100));
    if (n < 0 && errno == EINTR) continue;
    if (n == 0 && ended_within(Milliseconds(0))) {  // a descendant may still hold the pipe open
      n = poll(&ready, 1, 0);                       // output from before it ended
      if (n == 0) throw_process_ended();
    }
    if (n == 0 && Clock::now() < end) continue;
    if (n == 0)
      throw GuidanceFailed(
          fmt::format("the guidance program `{}` has not answered for {} s (guidance.timeout)",
                      command_, in_seconds(time_out)));
    char bytes[4096];
    const ssize_t count = read(out_, bytes, sizeof bytes);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) throw_process_ended();
    received_.append(bytes, size_t(count));
  }
}

}  // namespace gflow
