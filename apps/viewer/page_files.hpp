// SPDX-License-Identifier: Apache-2.0
// The files of the viewer's page (apps/viewer/page), embedded by kernels/embed.cmake.
#pragma once
#include <map>
#include <string>

namespace gflow {

// Text by file name, such as "index.html".
const std::map<std::string, std::string>& page_files();

}  // namespace gflow
