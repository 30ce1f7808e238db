// SPDX-License-Identifier: Apache-2.0
// Reads the file from front to back. The chunk index is only for players that fetch parts.
#include <fmt/format.h>
#include <zlib.h>

#include <cstring>
#include <optional>

#include "optim/formats/four_dgs.hpp"
#include "optim/formats/four_dgs_grid.hpp"
#include "optim/formats/splat_table.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/packed_size.hpp"

namespace gflow {
namespace {

using namespace four_dgs;

constexpr uint64_t kMostSplats = uint64_t{1} << 25;  // more than any real scene has
// Memory per Gaussian while its chunk is read, without SH [bytes].
constexpr uint64_t kSplatBytes = sizeof(MovingSplat) + 4 * 24;

// A range of the file, read from its beginning. Errors name the file.
class Reader {
 public:
  Reader(const std::string& path, std::string_view bytes)
      : path_(path), file_size_(bytes.size()), rest_(bytes) {}

  [[noreturn]] void refuse(const std::string& why) const {
    throw Error(fmt::format("cannot read {}: {}", path_, why));
  }
  size_t size() const { return rest_.size(); }
  // Call before allocating: constant streams let a small file describe a huge scene.
  void require_plausible(uint64_t memory) const {
    require_plausible_size(memory, file_size_, path_);
  }
  Reader of(std::string_view bytes) const {
    Reader part = *this;
    part.rest_ = bytes;
    return part;
  }

  std::string_view take(uint64_t length, const char* what) {
    if (length > rest_.size())
      refuse(fmt::format("it is truncated or damaged: {} needs {} bytes, {} are left", what, length,
                         rest_.size()));
    const std::string_view taken = rest_.substr(0, length);
    rest_.remove_prefix(length);
    return taken;
  }
  template <class T>
  T get(const char* what) {
    T value;
    std::memcpy(&value, take(sizeof value, what).data(), sizeof value);
    return value;
  }
  double finite(const char* what) {
    const double value = get<double>(what);
    if (!std::isfinite(value)) refuse(fmt::format("it is damaged: {} is {}", what, value));
    return value;
  }
  std::string text(const char* what) { return std::string(take(get<uint32_t>(what), what)); }

 private:
  const std::string& path_;
  size_t file_size_;
  std::string_view rest_;
};

std::string inflated(const Reader& in, std::string_view bytes, uint64_t size) {
  in.require_plausible(size);
  std::string out(size + 1, '\0');  // one byte more, to detect a stream that is too long
  uLongf got = out.size();
  uLong used = bytes.size();
  if (uncompress2(reinterpret_cast<Bytef*>(out.data()), &got,
                  reinterpret_cast<const Bytef*>(bytes.data()), &used) != Z_OK ||
      got != size)
    in.refuse(
        fmt::format("it is damaged: a compressed part does not decompress to its {} bytes", size));
  out.resize(size);
  return out;
}

// Values of an attribute stream, [count, channels]; a constant stream has one row.
struct Stream {
  uint8_t id = 0;
  size_t channels = 0;
  bool is_constant = false;
  std::vector<int32_t> values;

  const int32_t* row(size_t i) const { return &values[is_constant ? 0 : i * channels]; }
};

// Reads a stream. Skips it if wanted(id), its expected number of channels, is 0: later versions may
// have more streams.
template <class Wanted>
std::optional<Stream> read_stream(Reader& in, uint32_t count, Wanted&& wanted) {
  Stream stream;
  const char* const what = "an attribute stream";
  stream.id = in.get<uint8_t>(what);
  const auto width = in.get<uint8_t>(what), mode = in.get<uint8_t>(what);
  const auto codec = in.get<uint8_t>(what);
  stream.channels = in.get<uint8_t>(what);
  const auto elements = in.get<uint32_t>(what);
  const std::string_view payload = in.take(in.get<uint64_t>(what), what);
  const size_t channels = wanted(stream.id);
  if (channels == 0) return std::nullopt;
  const auto name = fmt::format("its stream {} ", stream.id);
  if (codec == kZstd)
    in.refuse(name + "is compressed with zstd, but gflow only reads deflate, the format's default");
  if (codec != kDeflate) in.refuse(fmt::format("{}has unknown codec {}", name, codec));
  if ((width != 1 && width != 2 && width != 4) || mode > constant || elements != count ||
      stream.channels != channels)
    in.refuse(
        fmt::format("{}is damaged: {} x {} symbols of {} bytes, mode {}, but its chunk has {} x {}",
                    name, elements, stream.channels, width, mode, count, channels));
  stream.is_constant = mode == constant;
  const size_t symbols = (stream.is_constant ? 1 : size_t(count)) * channels;
  if (count == 0) return stream;
  const std::string planes = inflated(in, payload, symbols * width);
  stream.values.reserve(symbols);
  for (size_t i = 0; i < symbols; ++i) {
    uint32_t symbol = 0;
    for (size_t byte = 0; byte < width; ++byte)
      symbol |= uint32_t(uint8_t(planes[byte * symbols + i])) << 8 * byte;
    int64_t value = int64_t(symbol >> 1) ^ -int64_t(symbol & 1);
    if (mode == delta && i >= channels) value += stream.values[i - channels];
    if (value != int32_t(value)) in.refuse(name + "is damaged: a value has more than 32 bits");
    stream.values.push_back(int32_t(value));
  }
  return stream;
}

class FileReader {
 public:
  FileReader(const std::string& path, std::string_view bytes) : bytes_(bytes), in_(path, bytes) {}

  MovingSplats read() {
    read_magic();
    while (true) {
      const size_t at = bytes_.size() - in_.size();
      const auto opcode = in_.get<uint8_t>("a record");
      const auto length = in_.get<uint64_t>("a record");
      Reader content = in_.of(in_.take(length, "a record"));
      if (!has_header_ && opcode != header) in_.refuse("it is damaged: it has no header");
      if (opcode == header) read_header(content);
      if (opcode == quantization) read_grid(content);
      if (opcode == windows) read_windows(content);
      if (opcode == chunk) read_chunk(content);
      if (opcode == sh_band) read_band(content);
      if (opcode == footer) {
        read_footer(content, at);
        return std::move(scene_);
      }
    }
  }

 private:
  void read_magic() {
    const std::string_view magic = in_.take(kMagic.size(), "its magic");
    const char version = magic[kVersionByte];
    if (magic.substr(0, kVersionByte) != kMagic.substr(0, kVersionByte))
      in_.refuse("it is not a .4dgs file");
    if (version != kMagic[kVersionByte])
      in_.refuse(fmt::format("it is .4dgs version '{}', but gflow only reads version 1", version));
    if (magic != kMagic) in_.refuse("it is damaged: its line endings were converted");
  }

  void read_header(Reader& in) {
    if (has_header_) in.refuse("it is damaged: it has two headers");
    has_header_ = true;
    in.text("its header");  // profile
    in.text("its header");  // name of the writer
    scene_.duration = in.finite("its duration");
    declared_ = in.get<uint64_t>("its header");
    scene_.cutoff = in.finite("its cutoff");
    const std::string model = in.text("its header");
    if (model != kModel)
      in.refuse(
          fmt::format("its temporal model is '{}', but gflow only reads '{}'", model, kModel));
    for (int k = 0; k < 6; ++k) in.get<double>("its header");  // bounding box
    scene_.sh_degree = in.get<uint8_t>("its header");
    if (scene_.sh_degree > 3)
      in.refuse(fmt::format("its spherical harmonics have degree {}, but gflow only reads 0 to 3",
                            scene_.sh_degree));
    if (!(scene_.cutoff > 0 && scene_.cutoff <= 1) ||
        !(scene_.duration >= 0 && scene_.duration < kLargest))
      in.refuse(
          fmt::format("it is damaged: cutoff {}, duration {} s", scene_.cutoff, scene_.duration));
    if (declared_ > kMostSplats)
      in.refuse(fmt::format("its header states {} Gaussians, but gflow reads at most {}", declared_,
                            kMostSplats));
    const auto bands = uint64_t(scene_.sh_degree) + 1;
    const uint64_t rest = 3 * (bands * bands - 1);
    in.require_plausible(declared_ * (kSplatBytes + 4 * rest));
    scene_.splats.reserve(declared_);  // growing would need twice the memory
    scene_.sh_rest.reserve(declared_ * rest);
  }

  // For records that must occur once, before the first chunk.
  void expect_first(const Reader& in, bool is_first, const char* what) const {
    if (!is_first) in.refuse(fmt::format("it is damaged: it has two {}", what));
    if (has_chunks_) in.refuse(fmt::format("it is damaged: its {} comes after Gaussians", what));
  }

  void read_grid(Reader& in) {
    expect_first(in, !grid_, "quantization");
    const std::string scheme = in.text("its quantization");
    if (scheme != kScheme)
      in.refuse(
          fmt::format("its quantization is '{}', but gflow only reads '{}'", scheme, kScheme));
    grid_.emplace();
    Grid::fields(*grid_, [&](double& value) { value = in.finite("its quantization"); });
    if (!(grid_->time > 0))
      in.refuse(fmt::format("it is damaged: its time step is {}", grid_->time));
  }

  void read_windows(Reader& in) {
    expect_first(in, windows_.empty(), "window table");
    const auto count = in.get<uint32_t>("its window table");
    if (in.size() / 16 < count)
      in.refuse(fmt::format("it is damaged: {} windows in {} bytes", count, in.size()));
    for (uint32_t i = 0; i < count; ++i) {
      const double begin = in.get<double>("a window");
      windows_.push_back({begin, in.get<double>("a window")});
      if (std::isnan(begin) || std::isnan(windows_.back()[1]))
        in.refuse("it is damaged: a time window is NaN");
    }
  }

  void read_chunk(Reader& in) {
    finish_chunk();
    has_chunks_ = true;
    if (!grid_) in.refuse("it is damaged: Gaussians come before its quantization");
    const auto begin = in.get<double>("a chunk"), end = in.get<double>("a chunk");
    if (std::isnan(begin) || std::isnan(end)) in.refuse("it is damaged: a chunk's interval is NaN");
    in.get<uint32_t>("a chunk");  // level
    const auto count = in.get<uint32_t>("a chunk");
    const std::string compression = in.text("a chunk");
    const auto size = in.get<uint64_t>("a chunk");
    std::string_view streams = in.take(in.get<uint64_t>("a chunk"), "a chunk");
    std::string unfolded;
    if (compression == "deflate")
      streams = unfolded = inflated(in, streams, size);
    else if (!compression.empty())
      in.refuse(fmt::format("a chunk is compressed with '{}', but gflow only reads 'deflate'",
                            compression));
    if (streams.size() != size)
      in.refuse(fmt::format("it is damaged: a chunk of {} bytes has {}", size, streams.size()));
    if (count > declared_ - scene_.splats.size())
      in.refuse(fmt::format(
          "it is damaged: its chunks have more than the {} Gaussians of its header", declared_));
    std::array<std::optional<Stream>, attribute_count> found;
    for (Reader rest = in.of(streams); rest.size() > 0;) {
      auto stream = read_stream(rest, count, [](uint8_t id) -> size_t {
        return id < attribute_count ? kChannels[id] : 0;
      });
      if (stream) found[stream->id] = std::move(stream);
    }
    for (size_t id = 0; id < attribute_count; ++id)
      if (!found[id] && count > 0)
        in.refuse(fmt::format("it is damaged: a chunk has no stream {}", id));
    first_ = scene_.splats.size();
    scene_.splats.resize(first_ + count);
    for (size_t i = 0; i < count; ++i)
      decode(in, scene_.splats[first_ + i], [&](Attribute a) { return found[a]->row(i); });
    for (size_t i = first_; i < scene_.splats.size(); ++i) {
      MovingSplat& s = scene_.splats[i];
      s.sh_row = i;
      s.begin = std::max(s.begin, begin);  // a Gaussian is visible only within its chunk's interval
      s.end = std::min(s.end, end);
    }
  }

  template <class Bins>
  void decode(const Reader& in, MovingSplat& s, Bins&& bins) const {
    const int32_t index = *bins(window);
    const size_t tables = std::max<size_t>(windows_.size(), 1);
    if (index < 0 || size_t(index) >= tables)
      in.refuse(fmt::format("it is damaged: a Gaussian has window {} of {}", index, tables));
    if (!windows_.empty()) {
      s.begin = windows_[size_t(index)][0];
      s.end = windows_[size_t(index)][1];
    }
    const bool never_fades = *bins(flags) & kNeverFades;
    const int32_t life_bin = *bins(life);
    if (!never_fades) s.life = grid_->life_of(life_bin);
    const double motion_step =
        grid_->motion_step(never_fades, life_bin, s.end - s.begin, scene_.cutoff);
    s.mean_t = *bins(mean_t) * grid_->time_step(never_fades, life_bin);
    for (size_t k = 0; k < 3; ++k) {
      s.mean[k] = grid_->origin[k] + bins(position)[k] * grid_->position;
      s.velocity[k] = bins(motion)[k] * motion_step;
      s.scales[k] = std::exp(bins(scale)[k] * grid_->scale);
    }
    // Clamped, because the highest bin may be above 1.
    const double green = bins(color)[0];
    for (size_t k = 0; k < 3; ++k) {
      const double bin = k == 1 ? green : green + bins(color)[k == 0 ? 1 : 2];
      s.color[k] = std::clamp(bin * grid_->color, 0.0, 1.0);
    }
    s.opacity = std::clamp(*bins(opacity) * grid_->opacity, 0.0, 1.0);
    const int32_t largest = *bins(rotation_index);
    if (largest < 0 || largest > 3)
      in.refuse(fmt::format(
          "it is damaged: a quaternion's largest component is {}, expected 0 to 3", largest));
    double left = 1;  // the square of the largest component
    std::array<double, 4> xyzw{};
    for (size_t k = 0, from = 0; k < 4; ++k) {
      if (int32_t(k) == largest) continue;
      xyzw[k] = std::clamp(bins(rotation)[from++] * grid_->rotation, -1.0, 1.0);
      left -= xyzw[k] * xyzw[k];
    }
    xyzw[size_t(largest)] = std::sqrt(std::max(left, 0.0));
    s.quat = {xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
    double norm = 0;
    for (const double q : s.quat) norm += q * q;
    for (double& q : s.quat) q /= std::sqrt(norm);
    const auto sound = [](double value) { return std::fabs(value) < kLargest; };
    bool good = norm > 0 && (never_fades || s.life > 0) && sound(s.mean_t) && sound(s.opacity);
    for (size_t k = 0; k < 3; ++k)
      good = good && sound(s.mean[k]) && sound(s.velocity[k]) && sound(s.color[k]) &&
             std::isfinite(s.scales[k]) && s.scales[k] > 0;
    if (!good) in.refuse("it is damaged: a Gaussian has an invalid value");
  }

  // A record with one SH band of the preceding chunk.
  void read_band(Reader& in) {
    const auto band = in.get<uint8_t>("spherical harmonics");
    if (band != bands_ + 1 || band > scene_.sh_degree)
      in.refuse(
          fmt::format("it is damaged: band {} of spherical harmonics of degree {} follows band {}",
                      band, scene_.sh_degree, bands_));
    bands_ = band;
    const size_t count = scene_.splats.size() - first_, size = band_size(band);
    // The stream's id repeats the opcode and is ignored.
    const auto stream =
        read_stream(in, uint32_t(count), [&](uint8_t) -> size_t { return 3 * size; });
    const size_t rest = size_t((scene_.sh_degree + 1) * (scene_.sh_degree + 1) - 1);
    scene_.sh_rest.resize(3 * rest * scene_.splats.size());
    for (size_t i = 0; i < count; ++i)
      for (size_t k = 0; k < 3 * size; ++k) {
        const int32_t byte = stream->row(i)[k];
        if (byte < 0 || byte > 255)
          in.refuse(
              fmt::format("it is damaged: a spherical harmonic is {}, expected 0 to 255", byte));
        scene_.sh_rest[(3 * (first_ + i) + k / size) * rest + band_first(band) + k % size] =
            float(kShLowest + byte * kShStep);
      }
  }

  // A chunk must have all SH bands of its degree.
  void finish_chunk() {
    if (scene_.splats.size() > first_ && bands_ != scene_.sh_degree)
      in_.refuse(
          fmt::format("it is damaged: a chunk has {} bands of spherical harmonics, expected {}",
                      bands_, scene_.sh_degree));
    bands_ = 0;
  }

  void read_footer(Reader& in, size_t at) {
    finish_chunk();
    const auto summary = in.get<uint64_t>("its footer");
    in.get<uint64_t>("its footer");
    const auto crc = in.get<uint32_t>("its footer");
    if (in_.take(kMagic.size(), "its end") != kMagic || in_.size() > 0)
      in_.refuse("it is damaged: it does not end like a .4dgs file");
    if (summary > at) in_.refuse("it is damaged: its index is beyond its end");
    if (crc != 0 && summary != 0 &&
        crc !=
            crc32(0, reinterpret_cast<const Bytef*>(bytes_.data()) + summary, uInt(at - summary)))
      in_.refuse("it is damaged: the checksum of its index is wrong");
    if (scene_.splats.size() != declared_)
      in_.refuse(fmt::format("it is damaged: its header states {} Gaussians, but it has {}",
                             declared_, scene_.splats.size()));
  }

  std::string_view bytes_;
  Reader in_;
  MovingSplats scene_;
  bool has_header_ = false, has_chunks_ = false;
  uint64_t declared_ = 0;
  std::optional<Grid> grid_;
  std::vector<std::array<double, 2>> windows_;
  size_t first_ = 0;  // index of the first Gaussian of the last chunk
  int bands_ = 0;     // SH bands of the last chunk read so far
};

}  // namespace

bool is_four_dgs(const std::string& first_bytes) {
  return first_bytes.substr(0, kVersionByte) == kMagic.substr(0, kVersionByte);
}

MovingSplats read_four_dgs(const std::string& path) {
  const Bytes bytes = read_file(path);
  return FileReader(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()}).read();
}

PlyTable splats_at(const MovingSplats& scene, double time) {
  struct Seen {
    const MovingSplat* splat;
    double weight;
  };
  std::vector<Seen> seen;
  for (const MovingSplat& s : scene.splats) {
    const double tau = (time - s.mean_t) / s.life, weight = std::exp(-tau * tau / 2);
    if (s.begin <= time && time < s.end && weight >= scene.cutoff) seen.push_back({&s, weight});
  }
  SplatTable table(seen.size(), scene.sh_degree, Normals::none);
  for (size_t i = 0; i < seen.size(); ++i) {
    const MovingSplat& s = *seen[i].splat;
    const SplatRow row = table.row(i);
    for (size_t k = 0; k < 3; ++k) {
      row.mean[k] = float(s.mean[k] + s.velocity[k] * (time - s.mean_t));
      row.log_scales[k] = float(std::log(s.scales[k]));
      row.sh0[k] = sh0_of_color(s.color[k]);
    }
    for (size_t k = 0; k < 4; ++k) row.quat[k] = float(s.quat[k]);
    *row.logit_opacity = logit_of_opacity(s.opacity * seen[i].weight);
    std::copy_n(scene.sh_rest.begin() + long(table.rest * s.sh_row), table.rest, row.sh_rest);
  }
  return std::move(table.table);
}

}  // namespace gflow
