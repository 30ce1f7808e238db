// SPDX-License-Identifier: Apache-2.0
#include "optim/train/team.hpp"

#include <fmt/format.h>

#include <cstring>

namespace gflow {
namespace {

// Messages as one: each after its length.
std::string joined(const Messages& messages) {
  std::string text;
  for (const std::string& message : messages) {
    const uint64_t size = message.size();
    text.append(reinterpret_cast<const char*>(&size), sizeof size);
    text += message;
  }
  return text;
}

void append_parts(const std::string& text, Messages& messages) {
  for (size_t at = 0; at < text.size();) {
    uint64_t size;
    std::memcpy(&size, text.data() + at, sizeof size);
    messages.push_back(text.substr(at + sizeof size, size));
    at += sizeof size + size;
  }
}

}  // namespace

class Team::SeatHere : public Seat {
 public:
  SeatHere(Team& team, size_t device) : team_(team), device_(device) {}
  size_t index() const override { return team_.first_ + device_; }
  size_t devices() const override { return team_.devices_; }
  std::string name() const override {
    const ProcessPlace& place = team_.place_;
    if (!place.gather) return fmt::format("device {}", device_);
    const std::string rank = fmt::format("rank {} on machine {}", place.process, place.machine);
    return team_.here_.size() > 1 ? fmt::format("device {} of {}", device_, rank) : rank;
  }

 protected:
  std::shared_ptr<const Messages> swap(std::string message) override {
    return team_.swap(device_, std::move(message));
  }

 private:
  Team& team_;
  size_t device_;
};

Team::Team(size_t devices, ProcessPlace place)
    : place_(std::move(place)), devices_(devices), here_(devices) {
  for (size_t i = 0; i < devices; ++i) seats_.push_back(std::make_unique<SeatHere>(*this, i));
  if (!place_.gather) return;
  const std::vector<std::string> counts = place_.gather(std::to_string(devices));
  devices_ = 0;
  for (size_t process = 0; process < counts.size(); ++process) {
    if (process == place_.process) first_ = devices_;
    devices_ += std::stoul(counts[process]);
  }
}

Messages Team::swap_with_others() {
  if (!place_.gather) return here_;
  const std::string mine = joined(here_);
  sent_ += mine.size();
  Messages messages;
  for (const std::string& process : place_.gather(mine)) append_parts(process, messages);
  return messages;
}

// The last device of this process that comes does it for all of them.
std::shared_ptr<const Messages> Team::swap(size_t device, std::string message) {
  std::unique_lock<std::mutex> lock(mutex_);
  here_[device] = std::move(message);
  const size_t turn = turn_;
  if (++arrived_ == here_.size()) {
    try {
      result_ = std::make_shared<const Messages>(swap_with_others());
    } catch (const std::exception& problem) {
      failed_ = problem.what();
    }
    arrived_ = 0;
    ++turn_;
    all_here_.notify_all();
  } else {
    all_here_.wait(lock, [&] { return turn_ != turn; });
  }
  if (!failed_.empty()) throw Error(failed_);
  return result_;
}

}  // namespace gflow
