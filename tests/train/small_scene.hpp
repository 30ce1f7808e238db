// SPDX-License-Identifier: Apache-2.0
// The small scene and its training, for tests.
#pragma once
#include <gtest/gtest.h>

#include "device.hpp"
#include "io/temporary_folder.hpp"
#include "tests/train/small_training.hpp"
