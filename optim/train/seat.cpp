// SPDX-License-Identifier: Apache-2.0
// The first byte of a message says what it is: m, e (end) or f (failure).
#include "optim/train/seat.hpp"

#include <fmt/format.h>

namespace gflow {

std::shared_ptr<const Messages> Seat::exchange(const std::string& message) {
  if (over_) throw TrainingEnded("the devices no longer train together");
  const auto said = swap("m" + message);
  auto messages = std::make_shared<Messages>();
  for (const std::string& one : *said) {
    if (one[0] == 'm') {
      messages->push_back(one.substr(1));
      continue;
    }
    over_ = true;
    if (one[0] == 'e') throw TrainingEnded("the training has ended");
    throw Error(one.substr(1));
  }
  return messages;
}

void Seat::close(char kind, const std::string& sentence) noexcept {
  if (over_) return;
  over_ = true;
  try {
    swap(kind == 'f' ? fmt::format("f{}: {}", name(), sentence) : "e");
  } catch (...) {  // whoever is left has been told, or is gone
  }
}

}  // namespace gflow
