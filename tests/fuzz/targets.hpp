// SPDX-License-Identifier: Apache-2.0
// Every reader of files as a function of bytes, for the fuzzer and for the cases it once found
// (tests/data/fuzz). A reader may refuse with an Error and nothing else.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
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
  // Of the file that the bytes become: one of those below, or by the file they choose.
  Holds (*holds)(const uint8_t* bytes, size_t size);
};
Holds its_size(const uint8_t*, size_t);
Holds packed_file(const uint8_t*, size_t);
Holds any_video(const uint8_t*, size_t);

const std::vector<Target>& targets();

// What reading these bytes may take [bytes]: twice the file and 64 MB, or of a compressed file
// twice what it may hold and 64 MB (optim/formats/README.md). No bound for a video: FFmpeg's frames
// are as large as it says, up to what optim/images/video.cpp allows.
size_t memory_allowed(const Target& target, const uint8_t* bytes, size_t size);

// What 64 kB cannot show: inputs of `size` bytes and a little, which are the seeds in a folder with
// millions of the same words where something of any length may stand. Calls see(what it is, input).
using SeeLongFile = std::function<void(const std::string& what, const std::string& input)>;
void for_long_files(const std::string& seeds, size_t size, const SeeLongFile& see);

// Of these, a file each.
std::vector<Target> splat_targets();
std::vector<Target> file_targets();
std::vector<Target> scene_targets();
std::vector<Target> run_targets();

}  // namespace gflow::fuzz
