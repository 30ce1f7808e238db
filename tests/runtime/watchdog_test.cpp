// SPDX-License-Identifier: Apache-2.0
// A device that does not answer ends the program, in one sentence; one that does is let alone.
#include "runtime/watchdog.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>

#include "environment.hpp"
#include "runtime/error.hpp"

namespace gflow {
namespace {

void sleep_seconds(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

TEST(Watchdog, EndsAProgramWhoseDeviceHangs) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(
      {
        Watchdog dog("Vendor / Device", 1);
        dog.wait([] { sleep_seconds(60); });
      },
      ::testing::ExitedWithCode(Watchdog::hang_exit_code),
      "gflow: waiting for Vendor / Device: nothing came back for 1 s.*GFLOW_DEVICE_TIMEOUT=1");
}

TEST(Watchdog, LetsManyShortWaitsAndLongWorkBetweenThemPass) {
  Watchdog dog("Vendor / Device", 1);
  for (int i = 0; i < 30; ++i) dog.wait([] { sleep_seconds(.1); });  // three seconds in all
  sleep_seconds(2.5);                                                // work of the program's own
  EXPECT_EQ(dog.wait([] { return 7; }), 7);
}

TEST(Watchdog, IsOverAsSoonAsAWaitThrew) {
  Watchdog dog("Vendor / Device", 1);
  EXPECT_THROW(dog.wait([] { throw Error("lost"); }), Error);
  sleep_seconds(2.5);
}

TEST(Watchdog, HasATimeThatTheEnvironmentChooses) {
  EXPECT_EQ(device_timeout(), 600);
  for (const auto& [text, seconds] : {std::pair{"0", 0}, {"7", 7}}) {
    const Environment set("GFLOW_DEVICE_TIMEOUT", text);
    EXPECT_EQ(device_timeout(), seconds);
  }
  for (const char* text : {"", "-1", "1.5", "10s", "99999999999999999999"}) {
    const Environment set("GFLOW_DEVICE_TIMEOUT", text);
    EXPECT_THROW(device_timeout(), Error) << text;
  }
}

}  // namespace
}  // namespace gflow
