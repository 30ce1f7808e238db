// SPDX-License-Identifier: Apache-2.0
// A signal handler may neither wait for a lock nor allocate: paths are in slots of fixed size, and
// a slot belongs to the thread that last changed its state.
#include "runtime/base/unfinished_file.hpp"

#include <sys/wait.h>
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

// Whether the whole folder was removed. Runs rm, since reading a folder allocates memory, which a
// signal handler must not.
bool remove_folder(const char* path) {
  const pid_t child = ::vfork();
  if (child == 0) {
    ::execl("/bin/rm", "rm", "-rf", "--", path, static_cast<char*>(nullptr));
    ::_exit(127);
  }
  int status = -1;
  return child > 0 && ::waitpid(child, &status, 0) == child && status == 0;
}

}  // namespace

UnfinishedFile::UnfinishedFile(const std::string& path) {
  for (size_t i = 0; i < slots.size() && path.size() < PATH_MAX; ++i) {
    if (!slots[i].change(unused, being_named)) continue;
    std::memcpy(slots[i].path, path.c_str(), path.size() + 1);
    slots[i].state = in_use;
    slot_ = int(i);
    break;
  }
  // remove_unfinished_files() sets `ending` before it looks at the slots: either it sees this one,
  // or this thread sees that no file may be begun any more and waits for the end.
  if (!ending) return;
  if (slot_ >= 0) slots[size_t(slot_)].state = unused;
  for (;;) ::pause();
}

UnfinishedFile::~UnfinishedFile() {
  if (slot_ >= 0) slots[size_t(slot_)].state = unused;
}

void remove_unfinished_files() {
  ending = true;
  // Another thread may have named a file and create it only now, or one in a folder: tries for 0.2
  // s, unless that thread releases its slot.
  const auto remains = [](Slot& slot) {
    if (slot.state != being_removed || ::unlink(slot.path) == 0) return false;
    return errno == EISDIR ? !remove_folder(slot.path) : errno == ENOENT;
  };
  for (Slot& slot : slots) slot.change(in_use, being_removed);
  std::array<bool, slots.size()> missing{};
  for (size_t i = 0; i < slots.size(); ++i) missing[i] = remains(slots[i]);
  constexpr timespec pause{0, 1000000};
  for (int tries = 0; tries < 200; ++tries) {
    bool any = false;
    for (size_t i = 0; i < slots.size(); ++i)
      if (missing[i]) any |= missing[i] = remains(slots[i]);
    if (!any) return;
    ::nanosleep(&pause, nullptr);
  }
}

}  // namespace gflow
