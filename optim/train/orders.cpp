// SPDX-License-Identifier: Apache-2.0
#include "optim/train/orders.hpp"

#include <cstring>

#include "runtime/files/atomic_file.hpp"
#include "runtime/files/temporary_folder.hpp"

namespace gflow {

std::string order_to_step(int number, float rate_scale) {
  const StepOrder order{number, rate_scale};
  return "s" + std::string(reinterpret_cast<const char*>(&order), sizeof order);
}

StepOrder step_of_order(const std::string& order) {
  StepOrder step;
  std::memcpy(&step, order.data() + 1, sizeof step);
  return step;
}

bool is_state(const std::string& order) { return order[0] == 'a'; }

std::string order_of_state(const Arrays& arrays) {
  const ScratchFolder folder("state");
  write_npz(folder.file("state.npz"), arrays, Packing::stored);
  const Bytes bytes = read_file(folder.file("state.npz"));
  return "a" + std::string(bytes.begin(), bytes.end());
}

Arrays arrays_of_order(const std::string& order) {
  const ScratchFolder folder("state");
  const std::string path = folder.file("state.npz");
  write_file_atomically(path, Bytes(order.begin() + 1, order.end()));
  return read_npz(path);
}

}  // namespace gflow
