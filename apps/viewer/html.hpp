// SPDX-License-Identifier: Apache-2.0
// The viewer's page as one file that needs no server: style, modules and model inside it.
#pragma once
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace gflow {

// A module and all that it imports as one script. `files`: text by name. Rules of the modules:
//   import { a, b } from './name.js';      at the beginning of a line
//   export function f(), export const, export class: declarations at the beginning of a line
// and no cycles. Error that names the file if one breaks them.
std::string bundled(const std::map<std::string, std::string>& files, const std::string& entry);

// index.html of `files` with its style, its modules, the worker sort.worker.js, and the model:
//   <script type="application/octet-stream" id="gflow-info" data-encoding="gzip">  base64 of JSON
//   <script type="application/octet-stream" id="gflow-model" data-encoding="gzip">  base64
//   <script type="application/octet-stream" id="gflow-scripts" data-encoding="gzip">  base64
//     of {"worker": text of the element gflow-worker, "page": module}, which the page adds to
//     itself
// and gflow-end, without which the page says that it is truncated.
std::string page_with_model(const std::map<std::string, std::string>& files,
                            const std::string& model, const nlohmann::ordered_json& info);

// A gzip stream (RFC 1952).
std::string gzipped(const std::string& bytes);

}  // namespace gflow
