// SPDX-License-Identifier: Apache-2.0
// A kernel that never ends, or a driver that forgot its queue, would hold a program for ever: the
// queue's waits for finish, reads, writes and events are watched (numerics section 3, "device lost
// / hang").
#pragma once
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

namespace gflow {

// One per queue. When one wait lasts too long, it says so in one sentence on stderr and ends the
// program by std::quick_exit with hang_exit_code: nothing that waits for the device can be
// destroyed.
class Watchdog {
 public:
  static constexpr int hang_exit_code = 4;

  // `device`: its name for the sentence. `seconds`: the longest wait; 0: any. `tick`: how often it
  // looks.
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
  unsigned waits_ = 0;             // so far
  std::atomic<unsigned> wait_{0};  // number of the one going on; 0: none
  std::mutex mutex_;
  std::condition_variable end_;
  bool ends_ = false;
  std::thread thread_;
};

// The longest wait [s]: the variable GFLOW_DEVICE_TIMEOUT, else 600. Error when it is no whole
// number from 0 on.
int device_timeout();

}  // namespace gflow
