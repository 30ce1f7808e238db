// SPDX-License-Identifier: Apache-2.0
// A temporary folder for the files of a test, and checks of error messages.
#pragma once
#include <gtest/gtest.h>

#include <functional>
#include <initializer_list>
#include <string>

#include "optim/reference/folder.hpp"
#include "runtime/base/error.hpp"

// Expects f to throw a gflow::Error whose message contains all the parts.
inline void expect_error(const std::function<void()>& f, std::initializer_list<std::string> parts) {
  try {
    f();
  } catch (const gflow::Error& error) {
    for (const std::string& part : parts)
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos)
          << "'" << part << "' is not in: " << error.what();
    return;
  }
  ADD_FAILURE() << "no error";
}
