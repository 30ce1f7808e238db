// SPDX-License-Identifier: Apache-2.0
// Checks of options, and what a wrong command line is answered with. Unlike CLI11's own, they leave
// no ranges and lists in the help and say what would be right in one sentence.
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace gflow {

// The value is one of the words.
CLI::Validator choice_of(std::vector<std::string> words);
// The value is a number from low to high.
CLI::Validator number_in(double low, double high);
// The value is 0, which leaves it to gflow, or a number from low to high.
CLI::Validator zero_or_in(double low, double high);

// The value is not empty, as "$FOLDER" is where no such variable is set: what belongs into that
// folder would be written to the root of the file system.
CLI::Validator path_given();

// An entry of a list with commas. Of one that is empty (`--devices ,`) CLI11 takes what comes next.
CLI::Validator list_entry();

// The sentence for a command line that `app` refused with `problem`: it names the nearest command
// or option when the one given does not exist.
std::string sentence_for(const CLI::App& app, const CLI::ParseError& problem);

}  // namespace gflow
