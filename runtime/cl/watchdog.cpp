// SPDX-License-Identifier: Apache-2.0
// Time is counted in ticks of the watching thread, not read from a clock: a program that was
// stopped (Ctrl-Z, a debugger, a sleeping laptop) did not wait meanwhile.
#include "runtime/cl/watchdog.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "runtime/base/error.hpp"
#include "runtime/base/terminal.hpp"

namespace gflow {

Watchdog::Watchdog(std::string device, int seconds, std::chrono::milliseconds tick)
    : device_(std::move(device)), seconds_(seconds), tick_(tick) {
  if (seconds_ > 0) thread_ = std::thread([this] { watch(); });
}

Watchdog::~Watchdog() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
  }
  end_.notify_one();
  thread_.join();
}

void Watchdog::watch() {
  // On a terminal, first erases a progress line that may be there.
  const std::string sentence = fmt::format(
      "{}gflow: waiting for {}: no response for {} s; it hangs, or needs more than "
      "GFLOW_DEVICE_TIMEOUT={} seconds (0: no limit); files saved earlier are intact\n",
      erase_line_sequence(), device_, seconds_, seconds_);
  unsigned last = 0;
  std::unique_lock lock(mutex_);
  for (int ticks = 0; !end_.wait_for(lock, tick_, [&] { return ends_; });) {
    const unsigned now = wait_;
    ticks = now && now == last ? ticks + 1 : 0;
    last = now;
    if (ticks * tick_ < std::chrono::seconds(seconds_)) continue;
    std::fputs(sentence.c_str(), stderr);
    std::fflush(stdout);  // a thread that waits in OpenCL does not print
    std::quick_exit(hang_exit_code);
  }
}

int device_timeout() {
  const char* text = std::getenv("GFLOW_DEVICE_TIMEOUT");
  if (!text) return 600;
  int seconds = -1;
  const char* end = text + std::strlen(text);
  const auto [rest, problem] = std::from_chars(text, end, seconds);
  if (problem != std::errc() || rest != end || seconds < 0)
    throw Error(
        fmt::format("the variable GFLOW_DEVICE_TIMEOUT is '{}'; it must be a whole number of "
                    "seconds to wait for the device (0: no limit)",
                    text));
  return seconds;
}

}  // namespace gflow
