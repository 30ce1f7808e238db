// SPDX-License-Identifier: Apache-2.0
// Every file reader, and the viewer's server, as a function of bytes, for the fuzzer and for its
// past findings (tests/data/fuzz). A reader may reject its input by an Error and in no other way.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace gflow::fuzz {

// Upper bound of the contents of a file: its size, more because it is compressed, or, for a video,
// whatever FFmpeg makes of it.
enum class Holds { its_size, packed, anything };

struct Target {
  const char* name;
  void (*read)(const uint8_t* bytes, size_t size);
  // Writes valid inputs as files into a folder.
  void (*make_seeds)(const std::string& folder);
  // For the file that the bytes become; it may depend on the byte that selects it.
  Holds (*holds)(const uint8_t* bytes, size_t size);
};
Holds its_size(const uint8_t*, size_t);
Holds packed_file(const uint8_t*, size_t);
Holds any_video(const uint8_t*, size_t);

const std::vector<Target>& targets();

// Allowed memory for reading these bytes [bytes]: twice the file and 64 MB; for a compressed file
// twice its possible contents and 64 MB (optim/formats/README.md). No bound for a video: FFmpeg's
// frames have the size that the video states, up to the limit in optim/images/video.cpp.
size_t memory_allowed(const Target& target, const uint8_t* bytes, size_t size);

// Inputs of slightly more than `size` bytes, for problems that 64 kB cannot show: the seeds of a
// folder, with one token repeated millions of times where a sequence of any length is allowed.
// Calls see(description, input).
using SeeLongFile = std::function<void(const std::string& what, const std::string& input)>;
void for_long_files(const std::string& seeds, size_t size, const SeeLongFile& see);

// The targets of each source file.
std::vector<Target> splat_targets();
std::vector<Target> file_targets();
std::vector<Target> scene_targets();
std::vector<Target> run_targets();
std::vector<Target> server_targets();

}  // namespace gflow::fuzz
