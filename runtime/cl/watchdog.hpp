// SPDX-License-Identifier: Apache-2.0
// Ends the program if the device hangs. A kernel that never ends, or a driver that lost its queue,
// would block it for ever; so the queue's waits for finish, reads, writes and events are watched.
#pragma once
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

namespace gflow {

// One per queue. If a wait takes too long, it prints one sentence on stderr and ends the program by
// std::quick_exit with hang_exit_code, since nothing that waits for the device can be destroyed.
class Watchdog {
 public:
  static constexpr int hang_exit_code = 4;

  // `device`: its name for the sentence. `seconds`: the longest wait; 0: unlimited. `tick`: how
  // often the wait is checked.
  Watchdog(std::string device, int seconds,
           std::chrono::milliseconds tick = std::chrono::seconds(1));
  ~Watchdog();
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;

  // Runs f, which waits for the device. For one thread at a time.
  template <class F>
  auto wait(F&& f) -> decltype(f()) {
    const Waiting waiting(*this);
    return std::forward<F>(f)();
  }

 private:
  struct Waiting {
    explicit Waiting(Watchdog& dog) : dog(dog) { dog.wait_ = ++dog.waits_; }
    ~Waiting() { dog.wait_ = 0; }
    Watchdog& dog;
  };
  void watch();

  const std::string device_;
  const int seconds_;
  const std::chrono::milliseconds tick_;
  unsigned waits_ = 0;             // number of waits so far
  std::atomic<unsigned> wait_{0};  // number of the current wait; 0: none
  std::mutex mutex_;
  std::condition_variable end_;
  bool ends_ = false;
  std::thread thread_;
};

// The longest wait [s]: GFLOW_DEVICE_TIMEOUT, else 600; 0: unlimited. Error if it is not an integer
// >= 0.
int device_timeout();

}  // namespace gflow
