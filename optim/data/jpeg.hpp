// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>

#include "optim/io/atomic_file.hpp"

namespace gflow {

// Why the pixels of a JPEG are not all in it, or "": the decoder that OpenCV uses invents those
// that are missing and says so on stderr only. Bytes that mean nothing between its parts are no
// damage. Every coefficient is read, so it takes time as decoding does.
std::string damage_of_jpeg(const Bytes& bytes);

}  // namespace gflow
