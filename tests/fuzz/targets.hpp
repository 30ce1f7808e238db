// SPDX-License-Identifier: Apache-2.0
// Every reader of files as a function of bytes, for the fuzzer and for the cases it once found
// (tests/data/fuzz). A reader may refuse with an Error and nothing else.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace gflow::fuzz {

// How much may be in a file: its size, more as it is compressed, or, in a video, what FFmpeg makes
// of it.
enum class Holds { its_size, packed, anything };

struct Target {
  const char* name;
  void (*read)(const uint8_t* bytes, size_t size);
  // Valid inputs to begin from, written as files into a folder.
  void (*make_seeds)(const std::string& folder);
  Holds holds = Holds::its_size;
};

const std::vector<Target>& targets();

// What the file holds that was made of the bytes last: of a target of several files that is packed
// where one is, its size where that one is text or plain numbers.
extern Holds last_file;

// What reading so many bytes may take [bytes]: twice the file and 64 MB, or of a compressed file
// twice what it may hold and 64 MB (optim/io/README.md). Of the file that was read last.
size_t memory_allowed(const Target& target, size_t size);

// Of these, a file each.
std::vector<Target> splat_targets();
std::vector<Target> file_targets();
std::vector<Target> scene_targets();
std::vector<Target> run_targets();

}  // namespace gflow::fuzz
