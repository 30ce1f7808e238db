// SPDX-License-Identifier: Apache-2.0
// Bounds what a compressed file may ask for: a few kB expand to gigabytes.
#pragma once
#include <cstddef>
#include <string>

namespace gflow {

// What any compressed file may hold, however short it is: a picture of one colour, a flow where
// nothing moves and arrays of one value take next to nothing [bytes].
inline constexpr size_t always_plausible = size_t{64} << 20;

// Before memory is taken for what a file of `stored` bytes says that it holds: Error from
// `always` and a hundred times the file on. Scenes, flow and arrays are packed 1 to 10 times, and
// deflate cannot do more than 1032.
void require_plausible_size(size_t unpacked, size_t stored, const std::string& path,
                            size_t always = always_plausible);

}  // namespace gflow
