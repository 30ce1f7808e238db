// SPDX-License-Identifier: Apache-2.0
// A device's place among those that train one model together. All make the same calls in the same
// order; device 0 leads: it alone decides which step is next, and writes.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"

namespace gflow {

// What each device says in one exchange, in the order of the devices.
using Messages = std::vector<std::string>;

// The leader has ended the training.
struct TrainingEnded : Error {
  using Error::Error;
};

class Seat {
 public:
  virtual ~Seat() = default;

  virtual size_t index() const = 0;    // of this device
  virtual size_t devices() const = 0;  // number of all
  // "rank 1 on machine host" or "device 1 of rank 0 on machine host", for messages.
  virtual std::string name() const = 0;

  bool leads() const { return index() == 0; }
  // The device that renders view `view` of `batch`. The leader has the last one, which it reports.
  size_t owner(size_t view, size_t batch) const { return (batch - 1 - view) % devices(); }

  // Says one message and returns those of all devices. Waits for them. Error with the sentence of a
  // device that has failed; TrainingEnded if the leader has called end().
  std::shared_ptr<const Messages> exchange(const std::string& message);
  // Only the leader's message counts.
  std::string from_leader(const std::string& message = "") { return exchange(message)->front(); }

  // The last exchange of this device, instead of the next one, if the training is not over: the
  // leader has finished, or this device cannot go on. Never throws.
  void end() noexcept { close('e', ""); }
  void fail(const std::string& sentence) noexcept { close('f', sentence); }

 protected:
  virtual std::shared_ptr<const Messages> swap(std::string message) = 0;

 private:
  void close(char kind, const std::string& sentence) noexcept;
  bool over_ = false;
};

}  // namespace gflow
