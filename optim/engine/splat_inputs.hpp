// SPDX-License-Identifier: Apache-2.0
// Checks of Gaussians and cameras that come from outside as arrays: the file of `gflow splat`, the
// arguments of Python's gflow.rasterization(). Each throws an Error that names the input.
#pragma once
#include <string>
#include <vector>

#include "runtime/cl/device.hpp"
#include "shared/types.h"

namespace gflow {

// Where inputs come from, as errors name it: "reading in.npz: array 'means' has ...".
struct InputSource {
  std::string doing;  // "reading in.npz"
  std::string word;   // what it calls an input: "array"

  std::string input(const std::string& key) const { return doing + ": " + word + " '" + key + "'"; }
};

// Values of an input that the caller keeps alive.
struct InputValues {
  const float* data;
  size_t size;

  InputValues(const float* data, size_t size) : data(data), size(size) {}
  InputValues(const std::vector<float>& values) : data(values.data()), size(values.size()) {}
};

// Values of n Gaussians: scales are at least 0, opacities from 0 to 1. Non-finite values are
// allowed, because they only affect their own Gaussian.
void require_scales(InputValues values, size_t n, const std::string& key,
                    const InputSource& source);
void require_opacities(InputValues values, size_t n, const std::string& key,
                       const InputSource& source);

// Every value is finite; of an input whose values reach every pixel.
void require_finite(InputValues values, const std::string& key, const InputSource& source);

// An image side or two: whole numbers from 1 to 65535 [px].
void require_image_size(double width, double height, const std::string& key,
                        const InputSource& source);

// The device can hold the images of one view and, for a backward pass, their cotangents. On a CPU
// the same memory also holds the arrays read and written.
void require_room_for_images(const DeviceInfo& device, size_t pixels, bool flow, bool backward,
                             const std::string& key, const InputSource& source);

// The camera of a viewmat [4, 4] (world to camera: rotation and translation) and K [3, 3] (fx 0 cx,
// 0 fy cy, 0 0 1) [px], both row by row. near_plane in scene units.
PinholeCamera camera_of(InputValues viewmat, const std::string& viewmat_key, InputValues K,
                        const std::string& K_key, int width, int height, float near_plane,
                        const InputSource& source);

// Marks Gaussians with a non-finite value; `values` has as many values for each of broken.size().
void mark_broken(InputValues values, std::vector<char>& broken);
// Indices of the marked ones.
std::vector<int32_t> broken_rows(const std::vector<char>& broken);

}  // namespace gflow
