// SPDX-License-Identifier: Apache-2.0
#include "runtime/files/packed_size.hpp"

#include <fmt/format.h>

#include "runtime/base/error.hpp"

namespace gflow {

void require_plausible_size(size_t unpacked, size_t stored, const std::string& path,
                            size_t always) {
  constexpr size_t most = 100;
  if (unpacked > always && (unpacked - always) / most >= stored)
    throw Error(
        fmt::format("cannot read {}: its {} bytes would decompress to {} MB, {} times as much, "
                    "which exceeds the limit",
                    path, stored, unpacked >> 20, unpacked / (stored > 0 ? stored : 1)));
}

}  // namespace gflow
