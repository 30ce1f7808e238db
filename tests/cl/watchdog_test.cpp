// SPDX-License-Identifier: Apache-2.0
// A device that does not answer ends the program with one sentence; a device that answers is
// unaffected.
#include "runtime/cl/watchdog.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <thread>
#include <utility>

#include "runtime/cl/buffer.hpp"
#include "runtime/primitives/scan.hpp"
#include "tests/support/device.hpp"
#include "tests/support/environment.hpp"

namespace gflow {
namespace {

using std::chrono::milliseconds;

// Checks 20 times a second for waits of at most one second: a short stall of the machine costs one
// check.
Watchdog quick_dog() { return {"Vendor / Device", 1, milliseconds(50)}; }

TEST(Watchdog, LetsManyShortWaitsAndLongWorkBetweenThemPass) {
  Watchdog dog = quick_dog();
  const auto doze = [] { std::this_thread::sleep_for(milliseconds(100)); };
  for (int i = 0; i < 15; ++i) dog.wait(doze);
  for (int i = 0; i < 15; ++i) doze();  // host work
  EXPECT_EQ(dog.wait([] { return 7; }), 7);
}

TEST(Watchdog, IsOverAsSoonAsAWaitThrew) {
  Watchdog dog = quick_dog();
  EXPECT_THROW(dog.wait([] { throw Error("lost"); }), Error);
  std::this_thread::sleep_for(milliseconds(1500));
}

TEST(Watchdog, WaitsForEverWhereThatIsAsked) {
  Watchdog dog("Vendor / Device", 0, milliseconds(50));
  dog.wait([] { std::this_thread::sleep_for(milliseconds(1500)); });
}

TEST(Watchdog, HasATimeThatTheEnvironmentChooses) {
  for (const auto& [text, seconds] : {std::pair{"0", 0}, {"7", 7}}) {
    const Environment set("GFLOW_DEVICE_TIMEOUT", text);
    EXPECT_EQ(device_timeout(), seconds);
  }
  for (const char* text : {"", "-1", "1.5", "10s", "99999999999999999999"}) {
    const Environment set("GFLOW_DEVICE_TIMEOUT", text);
    EXPECT_THROW(device_timeout(), Error) << text;
  }
}

// Every way to wait, on a queue that is blocked by an event that never completes.
TEST(Watchdog, EndsAProgramThatWaitsForADeviceThatHangs) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const Environment set("GFLOW_DEVICE_TIMEOUT", "1");
  struct Hung {
    Queue queue = test_queue();
    Scan scan{queue};
    Buffer<cl_uint> in{queue, {1, 2, 3}, "in"}, out{"out"};
    cl::UserEvent never{queue.context};
    Hung() {
      scan.exclusive(queue, in, out, 3);
      queue.finish();
      const std::vector<cl::Event> before{never};
      queue.handle.enqueueBarrierWithWaitList(&before);
    }
  };
  const std::pair<const char*, std::function<void(Hung&)>> ways[] = {
      {"finish", [](Hung& h) { h.queue.finish(); }},
      {"read", [](Hung& h) { h.in.read(h.queue); }},
      {"write",
       [](Hung& h) {
         h.in.write(h.queue, {4, 5, 6});
       }},
      {"total", [](Hung& h) { h.scan.fetch_total(h.queue), h.scan.fetched_total(); }},
      {"total not asked for",
       [](Hung& h) { h.scan.fetch_total(h.queue), h.scan.fetch_total(h.queue); }}};
  for (const auto& [name, wait] : ways) {
    SCOPED_TRACE(name);
    EXPECT_EXIT(
        {
          Hung hung;
          wait(hung);
        },
        ::testing::ExitedWithCode(Watchdog::hang_exit_code),
        "gflow: waiting for .*: no response for 1 s.*GFLOW_DEVICE_TIMEOUT=1");
  }
}

}  // namespace
}  // namespace gflow
