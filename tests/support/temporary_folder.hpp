// SPDX-License-Identifier: Apache-2.0
// A folder for the files a test makes, and expectations on error sentences.
#pragma once
#include <gtest/gtest.h>

#include <functional>
#include <initializer_list>
#include <string>

#include "optim/reference/folder.hpp"
#include "runtime/base/error.hpp"

// f throws a gflow::Error whose sentence has all of the parts.
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
