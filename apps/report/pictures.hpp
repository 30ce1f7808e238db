// SPDX-License-Identifier: Apache-2.0
// Pictures inside a report.
#pragma once
#include <string>

#include "optim/images/image.hpp"

namespace gflow::report {

// A picture as the address that an <img> takes, with the size that it has on the page [px].
struct Picture {
  std::string address;
  int width = 0, height = 0;
  bool empty() const { return address.empty(); }
};

// The image as a JPEG, no wider than `widest` [px]. Alpha is put over white, grey becomes RGB.
Picture picture_of(const Image& image, int widest);

// The colour wheel of flow images: right is to the right, the rim is full length.
Picture flow_wheel();

// <img>; alt: plain text.
std::string img(const Picture& picture, const std::string& alt);

}  // namespace gflow::report
