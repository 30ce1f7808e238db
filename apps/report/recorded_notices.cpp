// SPDX-License-Identifier: Apache-2.0
#include "apps/report/recorded_notices.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "optim/runs/run_names.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/json_text.hpp"
#include "runtime/files/text_file.hpp"

namespace gflow::report {

std::vector<std::string> read_notices(const RunFolder& run) {
  const auto json =
      nlohmann::ordered_json::parse(read_text_or_empty(run.path(kRunNotices)), nullptr, false);
  std::vector<std::string> sentences;
  if (json.is_array())
    for (const auto& sentence : json)
      if (sentence.is_string()) sentences.push_back(sentence);
  return sentences;
}

void write_notices(const RunFolder& run, const std::vector<std::string>& sentences) {
  try {
    write_file_atomically(run.path(kRunNotices),
                          json_text(nlohmann::ordered_json(sentences), 1) + "\n");
  } catch (const Error& problem) {
    warn(fmt::format("the run's warnings are not kept for later reports: {}", problem.what()));
  }
}

}  // namespace gflow::report
