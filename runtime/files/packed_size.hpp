// SPDX-License-Identifier: Apache-2.0
// Bounds on the size of unpacked files: a few kB can expand to gigabytes.
#pragma once
#include <cstddef>
#include <string>

namespace gflow {

// The size that any compressed file may have unpacked, however short it is: an image of one colour,
// flow where nothing moves and arrays of one value take next to nothing [bytes].
inline constexpr size_t always_plausible = size_t{64} << 20;

// To be called before memory is allocated for a file of `stored` bytes that announces `unpacked`:
// Error from `always` plus a hundred times `stored` on. Scenes, flow and arrays are packed 1 to 10
// times; deflate cannot do more than 1032.
void require_plausible_size(size_t unpacked, size_t stored, const std::string& path,
                            size_t always = always_plausible);

}  // namespace gflow
