// SPDX-License-Identifier: Apache-2.0
// Validators of options, and messages for wrong command lines. Unlike CLI11's own validators, they
// add no ranges or lists to the help, and their messages name the allowed values.
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "optim/formats/splat_table.hpp"

namespace gflow {

// Accepts one of the words.
CLI::Validator choice_of(std::vector<std::string> words);
// Accepts a number from low to high.
CLI::Validator number_in(double low, double high);
// Accepts 0, which lets gflow choose, or a number from low to high.
CLI::Validator zero_or_in(double low, double high);

// Rejects an empty value, such as "$FOLDER" with an unset variable: the output would go to the root
// of the file system.
CLI::Validator path_given();

// An entry of a comma-separated list. For an empty list (`--devices ,`) CLI11 would take the next
// argument.
CLI::Validator list_entry();

// Adds --strict: a splat file with Gaussians that cannot be drawn is rejected.
void add_strict(CLI::App& command, Undrawable& undrawable);

// The message for a command line that `app` rejected with `problem`. Names the nearest command or
// option if the given one does not exist.
std::string sentence_for(const CLI::App& app, const CLI::ParseError& problem);

}  // namespace gflow
