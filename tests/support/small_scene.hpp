// SPDX-License-Identifier: Apache-2.0
// The small scene of the tests and its training.
#pragma once
#include <gtest/gtest.h>

#include "apps/stress/training/small_training.hpp"
#include "tests/support/device.hpp"
#include "tests/support/temporary_folder.hpp"
