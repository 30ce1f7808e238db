// SPDX-License-Identifier: Apache-2.0
// A signal handler may neither wait for a lock nor allocate: paths lie in slots of fixed size, and
// each slot belongs to whoever changed its state last.
#include "optim/io/unfinished_file.hpp"

#include <time.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstring>

namespace gflow {
namespace {

enum SlotState : int { unused, being_named, in_use, being_removed };

struct Slot {
  std::atomic<int> state{unused};
  char path[PATH_MAX] = {};

  bool change(int from, int to) { return state.compare_exchange_strong(from, to); }
};
std::array<Slot, 64> slots;
std::atomic<bool> ending{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may not wait for a lock");
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler may not wait for a lock");

}  // namespace

UnfinishedFile::UnfinishedFile(const std::string& path) {
  while (ending) ::pause();  // no file is begun any more
  if (path.size() >= PATH_MAX) return;
  for (size_t i = 0; i < slots.size(); ++i) {
    if (!slots[i].change(unused, being_named)) continue;
    std::memcpy(slots[i].path, path.c_str(), path.size() + 1);
    slots[i].state = in_use;
    slot_ = int(i);
    return;
  }
}

UnfinishedFile::~UnfinishedFile() {
  if (slot_ >= 0) slots[size_t(slot_)].change(in_use, unused);
}

void remove_unfinished_files() {
  ending = true;
  // Another thread may have named a file and make it only now: for a moment it is looked for again.
  std::array<bool, 64> missing{};
  bool any = false;
  for (size_t i = 0; i < slots.size(); ++i)
    if (slots[i].change(in_use, being_removed))
      any |= missing[i] = ::unlink(slots[i].path) != 0 && errno == ENOENT;
  constexpr timespec pause{0, 1000000};
  for (int tries = 0; any && tries < 20; ++tries) {
    ::nanosleep(&pause, nullptr);
    any = false;
    for (size_t i = 0; i < slots.size(); ++i)
      if (missing[i]) any |= missing[i] = ::unlink(slots[i].path) != 0;
  }
}

}  // namespace gflow
