// SPDX-License-Identifier: Apache-2.0
// Style and script of reports (apps/report/page), embedded by kernels/embed.cmake.
#pragma once
#include <map>
#include <string>

namespace gflow {

// Text by file name, such as "report.css".
const std::map<std::string, std::string>& report_files();

}  // namespace gflow
