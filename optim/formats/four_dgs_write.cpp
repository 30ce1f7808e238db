// SPDX-License-Identifier: Apache-2.0
// File layout: magic, Header, Quantization, Window Table, Camera, Chunks each followed by its SH
// bands, one Chunk Index per chunk, Footer, magic. A chunk holds the Gaussians of one time
// interval, so that a player can fetch what it shows. The interval of a Gaussian is the smallest
// one that contains its window, out of the duration halved up to five times.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <zlib.h>

#include <cstring>
#include <map>
#include <numeric>
#include <tuple>

#include "optim/formats/four_dgs.hpp"
#include "optim/formats/four_dgs_grid.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"
#include "shared/sh.h"

namespace gflow {
namespace {

using namespace four_dgs;

constexpr int kDeepest = 5;
// Weight of a coefficient's own error against that of the colours seen: viewers use other eye
// positions than `eyes`.
constexpr double kStray = 0.01;
constexpr int kSweeps = 3;

// The content of a record or a part of it; assumes a little-endian host.
class Content {
 public:
  template <class T>
  Content& put(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  template <class T, size_t n>
  Content& put(const std::array<T, n>& values) {
    for (const T& value : values) put(value);
    return *this;
  }
  Content& text(std::string_view text) {
    put(uint32_t(text.size()));
    return raw(text);
  }
  Content& raw(std::string_view bytes) {
    bytes_.append(bytes);
    return *this;
  }
  // Keys and values as one block, preceded by its length.
  Content& map(const std::map<std::string, std::string>& entries) {
    Content block;
    for (const auto& [key, value] : entries) block.text(key).text(value);
    return text(block.bytes_);
  }
  // Appends a record; returns its offset and length.
  std::pair<uint64_t, uint64_t> record(Opcode opcode, const Content& content) {
    const uint64_t at = bytes_.size();
    put(opcode).put(uint64_t(content.bytes_.size())).raw(content.bytes_);
    return {at, bytes_.size() - at};
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

std::string deflated(const std::string& bytes) {
  uLongf size = compressBound(bytes.size());
  std::string out(size, '\0');
  if (compress2(reinterpret_cast<Bytef*>(out.data()), &size,
                reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(), 6) != Z_OK)
    throw Error("cannot compress a .4dgs file: out of memory");
  out.resize(size);
  return out;
}

// Zigzag symbols of 1, 2 or 4 bytes, stored as byte planes, lowest bytes first.
std::pair<uint8_t, std::string> symbols_of(const std::vector<int64_t>& values) {
  std::vector<uint64_t> symbols;
  uint64_t all = 0;
  for (const int64_t v : values) {
    symbols.push_back((uint64_t(v) << 1) ^ uint64_t(v >> 63));
    all |= symbols.back();
  }
  const uint8_t width = all < 1u << 8 ? 1 : all < 1u << 16 ? 2 : 4;
  std::string planes;
  for (int byte = 0; byte < width; ++byte)
    for (const uint64_t symbol : symbols) planes += char(symbol >> 8 * byte & 255);
  return {width, planes};
}

// Appends one attribute stream of values [n, channels]: constant if all rows are equal, else raw or
// delta, whichever is smaller.
void put_stream(Content& out, uint8_t id, const std::vector<int32_t>& values, uint8_t channels) {
  const size_t size = values.size();
  const auto all_equal = [&] {
    for (size_t i = channels; i < size; ++i)
      if (values[i] != values[i - channels]) return false;
    return true;
  };
  std::vector<int64_t> plain(values.begin(), values.end()), differences = plain;
  Mode mode = raw;
  if (all_equal()) {
    mode = constant;
    plain.resize(channels);
  }
  auto [width, symbols] = symbols_of(plain);
  std::string payload = deflated(symbols);
  if (mode == raw) {
    bool fits = true;  // a difference of two 32-bit integers may need 33 bits
    for (size_t i = size; i-- > channels;) {
      differences[i] -= differences[i - channels];
      fits = fits && differences[i] == int32_t(differences[i]);
    }
    const auto [delta_width, delta_symbols] = symbols_of(differences);
    std::string delta_payload = fits ? deflated(delta_symbols) : "";
    if (fits && delta_payload.size() < payload.size()) {
      mode = delta;
      width = delta_width;
      payload = std::move(delta_payload);
    }
  }
  out.put(id).put(width).put(mode).put(kDeflate).put(channels);
  out.put(uint32_t(size / channels)).put(uint64_t(payload.size())).raw(payload);
}

// Quantization steps for a scene, fine enough for rendering and coarse enough for 32-bit symbols.
Grid grid_for(const MovingSplats& scene) {
  std::vector<double> sizes{1e-3};
  if (!scene.splats.empty()) sizes.clear();
  for (const MovingSplat& s : scene.splats)
    sizes.push_back(std::cbrt(s.scales[0] * s.scales[1] * s.scales[2]));
  std::nth_element(sizes.begin(), sizes.begin() + long(sizes.size() / 2), sizes.end());
  Grid grid;
  grid.position = std::max(0.02 * sizes[sizes.size() / 2], 1e-12);
  grid.scale = grid.life = 0.005;
  grid.rotation = 0.001;
  grid.color = grid.opacity = 1.0 / 510;
  // The motion error is at most half a position step while the Gaussian is visible.
  grid.motion = grid.position * std::min(2.0, 4 / scene.duration);
  grid.time = std::ldexp(scene.duration, -14);
  for (size_t k = 0; k < 3; ++k) {
    double lowest = std::numeric_limits<double>::infinity();
    for (const MovingSplat& s : scene.splats) lowest = std::min(lowest, s.mean[k]);
    grid.origin[k] = scene.splats.empty() ? 0 : lowest;
  }
  return grid;
}

[[noreturn]] void too_far(size_t i) {
  throw Error(
      fmt::format("Gaussian {} is too far away, too fast, too large or not finite: it is outside "
                  "of the .4dgs grid, whose range depends on the sizes of the Gaussians",
                  i));
}

int32_t bin_of(double value, double step, size_t i) {
  const double bin = std::round(value / step);
  if (!(std::fabs(bin) < 1 << 30)) too_far(i);
  return int32_t(bin);
}

// Quantized SH of a Gaussian, and a correction of its degree 0 colour. The format's SH step of 1/32
// is coarse, and it limits degree 0 colours to [0, 1], which model colours may exceed. Bytes are
// therefore chosen by coordinate descent to minimise the squared error of the colours seen from
// `eyes`. The error that all eyes share is moved to the degree 0 colour, whose step is fine. If
// that colour is clamped, the coefficients compensate for the clamping instead.
struct Harmonics {
  std::vector<uint8_t> bytes;  // [3, K - 1]
  std::array<double, 3> shift{};
  double largest_change = 0;  // of a coefficient clamped to [-4, 4]
};

Harmonics harmonics_of(const MovingSplats& scene, size_t i) {
  const MovingSplat& s = scene.splats[i];
  const size_t rest = size_t((scene.sh_degree + 1) * (scene.sh_degree + 1) - 1);
  Harmonics out;
  out.bytes.resize(3 * rest);
  if (rest == 0) return out;
  const double seen_at = std::clamp(s.mean_t, s.begin, s.end) - s.mean_t;
  std::vector<ShBasis> views;
  std::array<double, 15> mean{};
  for (const auto& eye : scene.eyes) {
    std::array<double, 3> d;
    for (size_t k = 0; k < 3; ++k) d[k] = s.mean[k] + s.velocity[k] * seen_at - eye[k];
    const double length = std::hypot(d[0], d[1], d[2]);
    if (!(length > 0)) continue;
    views.push_back(sh_basis(scene.sh_degree, make_real3(d[0], d[1], d[2]) * (1 / length)));
  }
  for (const ShBasis& view : views)
    for (size_t k = 0; k < rest; ++k) mean[k] += view.y[k + 1] / double(views.size());
  for (size_t c = 0; c < 3; ++c) {
    const double cut = std::clamp(s.color[c], 0.0, 1.0) - s.color[c];
    const std::array<double, 15> common = cut == 0 ? mean : std::array<double, 15>{};
    std::array<double, 15> error{};              // of the coefficients
    std::vector<double> off(views.size(), cut);  // error of the colours, shared part removed
    uint8_t* const bytes = &out.bytes[c * rest];
    const auto change = [&](size_t k, double by) {
      error[k] += by;
      for (size_t v = 0; v < views.size(); ++v) off[v] += by * (views[v].y[k + 1] - common[k]);
    };
    for (size_t k = 0; k < rest; ++k) {
      const double sh = double(scene.sh_rest[(3 * s.sh_row + c) * rest + k]);
      if (!std::isfinite(sh)) too_far(i);
      const double bin = std::clamp((sh - kShLowest) / kShStep, 0.0, 255.0);
      bytes[k] = uint8_t(std::round(bin));
      change(k, (bytes[k] - bin) * kShStep);
    }
    for (int sweep = 0; sweep < kSweeps && !views.empty(); ++sweep)
      for (size_t k = 0; k < rest; ++k) {
        const double stray = kStray * double(views.size());
        double slope = stray * error[k], curvature = stray;
        for (size_t v = 0; v < views.size(); ++v) {
          const double y = views[v].y[k + 1] - common[k];
          slope += y * off[v];
          curvature += y * y;
        }
        const double best = bytes[k] - std::round(slope / curvature / kShStep);
        const auto to = uint8_t(std::clamp(best, 0.0, 255.0));
        change(k, (to - bytes[k]) * kShStep);
        bytes[k] = to;
      }
    for (size_t k = 0; k < rest; ++k) {
      out.shift[c] -= error[k] * common[k];
      out.largest_change = std::max(out.largest_change, std::fabs(error[k]));
    }
  }
  return out;
}

// Visibility window. Stored as f64 but rounded to f32: players keep windows as f32 and compare them
// with f64 intervals, so both must be the same number.
struct Window {
  float begin, end;
  bool operator<(const Window& o) const { return std::tie(begin, end) < std::tie(o.begin, o.end); }
};
Window window_of(const MovingSplat& s) { return {float(s.begin), float(s.end)}; }

// Quantized values of one Gaussian per stream.
using Bins = std::array<std::array<int32_t, 3>, attribute_count>;

Bins bins_of(const MovingSplats& scene, const Grid& grid, size_t i, int32_t window_index,
             const std::array<double, 3>& color_shift) {
  const MovingSplat& s = scene.splats[i];
  Bins bins{};
  for (const double value :
       {s.mean[0], s.mean[1], s.mean[2], s.velocity[0], s.velocity[1], s.velocity[2], s.mean_t})
    if (!(std::fabs(value) < kLargest / 2)) too_far(i);  // margin for rounding to the grid
  const bool never_fades = std::isinf(s.life);
  const int32_t life_bin = never_fades ? 0 : bin_of(std::log(s.life), grid.life, i);
  const double time_step = grid.time_step(never_fades, life_bin);
  const double begin = window_of(s).begin, end = window_of(s).end;
  const double motion_step = grid.motion_step(never_fades, life_bin, end - begin, scene.cutoff);
  bins[life][0] = life_bin;
  bins[flags][0] = never_fades ? kNeverFades : 0;
  bins[window][0] = window_index;
  bins[mean_t][0] = bin_of(s.mean_t, time_step, i);
  // The position compensates for the rounding of velocity and mean_t: the path is exact, up to a
  // position step, at mean_t or at the end of the window nearest to it.
  const double own = bins[mean_t][0] * time_step, exact = std::clamp(s.mean_t, begin, end);
  for (size_t k = 0; k < 3; ++k) {
    const int32_t v = bins[motion][k] = bin_of(s.velocity[k], motion_step, i);
    const double place =
        s.mean[k] + s.velocity[k] * (exact - s.mean_t) - v * motion_step * (exact - own);
    bins[position][k] = bin_of(place - grid.origin[k], grid.position, i);
    bins[scale][k] = bin_of(std::log(std::max(s.scales[k], 1e-30)), grid.scale, i);
  }
  // Colours are stored as green, red - green, blue - green.
  std::array<int32_t, 3> rgb;
  for (size_t k = 0; k < 3; ++k)
    rgb[k] = bin_of(std::clamp(s.color[k] + color_shift[k], 0.0, 1.0), grid.color, i);
  bins[color] = {rgb[1], rgb[0] - rgb[1], rgb[2] - rgb[1]};
  bins[opacity][0] = bin_of(std::clamp(s.opacity, 0.0, 1.0), grid.opacity, i);
  // Quaternions are stored as x y z w without the largest component, which is made positive.
  const std::array<double, 4> q{s.quat[1], s.quat[2], s.quat[3], s.quat[0]};
  size_t largest = 0;
  double norm = 0;
  for (size_t k = 0; k < 4; ++k) {
    norm += q[k] * q[k];
    if (std::fabs(q[k]) > std::fabs(q[largest])) largest = k;
  }
  const double unit = std::copysign(1 / std::sqrt(norm), q[largest]);
  bins[rotation_index][0] = int32_t(largest);
  for (size_t k = 0, to = 0; k < 4; ++k)
    if (k != largest) bins[rotation][to++] = bin_of(q[k] * unit, grid.rotation, i);
  return bins;
}

// Largest error of a Gaussian's degree 0 colour after quantization.
double color_change(const MovingSplat& s, const Grid& grid, const Bins& bins) {
  const double green = bins[color][0];
  const std::array<double, 3> stored{green + bins[color][1], green, green + bins[color][2]};
  double largest = 0;
  for (size_t k = 0; k < 3; ++k)
    largest =
        std::max(largest, std::fabs(stored[k] * grid.color - std::clamp(s.color[k], 0.0, 1.0)));
  return largest;
}

// Storage interval of a Gaussian: how often the duration is halved, and the index of the part.
// Ignores rounding of times.
std::pair<int, int64_t> interval_of(const MovingSplat& s, double duration) {
  constexpr double rounding = 1e-5;  // fraction of a part, which is duration / 2^level
  const double begin = window_of(s).begin, end = window_of(s).end;
  for (int level = kDeepest; level > 0; --level) {
    const double parts = std::ldexp(1 / duration, level);
    const auto first = int64_t(std::floor(begin * parts + rounding));
    if (end * parts <= double(first + 1) + rounding) return {level, first};
  }
  return {0, 0};
}

// Morton code. Neighbours in the stream are close in space, so their differences are small.
uint64_t along_a_curve(const std::array<int32_t, 3>& bin, int shift) {
  uint64_t code = 0;
  for (int bit = 20; bit >= 0; --bit)
    for (const int32_t b : bin) code = code << 1 | (uint64_t(std::max(b, 0)) >> shift >> bit & 1);
  return code;
}

struct Written {
  double begin = 0, end = 0;
  std::pair<uint64_t, uint64_t> where;  // offset, length
  uint32_t count = 0;
  std::vector<std::pair<uint64_t, uint64_t>> bands;
};

Written put_chunk(Content& file, const MovingSplats& scene, const std::vector<Bins>& bins,
                  const std::vector<Harmonics>& harmonics, int level,
                  const std::vector<size_t>& members) {
  Written chunk_written;
  chunk_written.count = uint32_t(members.size());
  chunk_written.begin = std::numeric_limits<double>::infinity();
  for (const size_t i : members) {
    const Window window = window_of(scene.splats[i]);
    chunk_written.begin = std::min(chunk_written.begin, double(window.begin));
    chunk_written.end = std::max(chunk_written.end, double(window.end));
  }
  Content streams;
  for (uint8_t attribute = 0; attribute < attribute_count; ++attribute) {
    std::vector<int32_t> values;
    for (const size_t i : members)
      values.insert(values.end(), bins[i][attribute].begin(),
                    bins[i][attribute].begin() + kChannels[attribute]);
    put_stream(streams, attribute, values, kChannels[attribute]);
  }
  Content content;
  content.put(chunk_written.begin).put(chunk_written.end).put(uint32_t(level));
  content.put(chunk_written.count).text("").put(uint64_t(streams.bytes().size()));
  content.put(uint64_t(streams.bytes().size())).raw(streams.bytes());
  chunk_written.where = file.record(chunk, content);

  const size_t rest = size_t((scene.sh_degree + 1) * (scene.sh_degree + 1) - 1);
  for (uint8_t band = 1; band <= scene.sh_degree; ++band) {
    std::vector<int32_t> values;
    for (const size_t i : members)
      for (size_t c = 0; c < 3; ++c)
        for (size_t k = 0; k < band_size(band); ++k)
          values.push_back(harmonics[i].bytes[c * rest + band_first(band) + k]);
    Content stream;
    stream.put(band);
    put_stream(stream, sh_band, values, uint8_t(3 * band_size(band)));
    chunk_written.bands.push_back(file.record(sh_band, stream));
  }
  return chunk_written;
}

Content header_of(const MovingSplats& scene) {
  std::array<double, 6> box{};
  for (size_t k = 0; k < 3 && !scene.splats.empty(); ++k) {
    box[k] = box[3 + k] = scene.splats[0].mean[k];
    for (const MovingSplat& s : scene.splats) {
      box[k] = std::min(box[k], s.mean[k]);
      box[3 + k] = std::max(box[3 + k], s.mean[k]);
    }
  }
  Content content;
  content.text("").text("gflow").put(scene.duration).put(uint64_t(scene.splats.size()));
  content.put(scene.cutoff).text(kModel).put(box).put(uint8_t(scene.sh_degree)).put(uint8_t(0));
  std::map<std::string, std::string> about{{"color_space", "srgb-rec709-display"},
                                           {"visibility_profile", "gaussian"}};
  if (scene.fps > 0) about["fps"] = fmt::format("{:g}", scene.fps);
  if (scene.up) about["up"] = fmt::format("{:.6g}", fmt::join(*scene.up, " "));
  return content.map(about);
}

// color_off, sh_off: largest errors of degree 0 colours and SH coefficients.
Content quantization_of(const Grid& grid, double color_off, double sh_off) {
  Content content;
  content.text(kScheme);
  Grid::fields(grid, [&](double value) { content.put(value); });
  const auto number = [](double value) { return fmt::format("{}", value); };
  // Largest errors: half a step each, or as measured. The omitted quaternion component may be off
  // by three times as much as the others.
  return content.put(uint8_t(grid.sh))
      .map({{"pos", number(grid.position / 2)},
            {"scale_rel", number(std::expm1(grid.scale / 2))},
            {"rot", number(1.5 * grid.rotation)},
            {"rgb", number(color_off)},
            {"alpha", number(grid.opacity / 2)},
            {"motion", number(grid.motion / 2)},
            {"time", number(grid.time / 2)},
            {"sigma_rel", number(std::expm1(grid.life / 2))},
            {"sh", number(sh_off)}});
}

}  // namespace

void write_four_dgs(const std::string& path, const MovingSplats& scene) {
  if (!(scene.duration > 0) || !(scene.cutoff > 0 && scene.cutoff <= 1))
    throw Error(
        fmt::format("cannot write {}: a .4dgs file needs a duration above 0 and a cutoff in "
                    "(0, 1], but they are {} and {}",
                    path, scene.duration, scene.cutoff));
  const Grid grid = grid_for(scene);
  std::map<Window, int32_t> index_of;
  for (const MovingSplat& s : scene.splats) index_of[window_of(s)] = 0;
  int32_t index = 0;
  Content table;
  table.put(uint32_t(index_of.size()));
  for (auto& [window, at] : index_of) {
    at = index++;
    table.put(double(window.begin)).put(double(window.end));
  }
  std::vector<Bins> bins;
  std::vector<Harmonics> harmonics;
  int32_t furthest = 1;
  double color_off = 0, sh_off = 0;
  for (size_t i = 0; i < scene.splats.size(); ++i) {
    const MovingSplat& s = scene.splats[i];
    harmonics.push_back(harmonics_of(scene, i));
    bins.push_back(bins_of(scene, grid, i, index_of.at(window_of(s)), harmonics[i].shift));
    color_off = std::max(color_off, color_change(s, grid, bins[i]));
    sh_off = std::max(sh_off, harmonics[i].largest_change);
    for (const int32_t b : bins[i][position]) furthest = std::max(furthest, b);
  }
  int shift = 0;
  while (furthest >> shift >> 21) ++shift;
  std::map<std::pair<int, int64_t>, std::vector<size_t>> intervals;
  for (size_t i = 0; i < scene.splats.size(); ++i)
    intervals[interval_of(scene.splats[i], scene.duration)].push_back(i);

  Content file;
  file.raw(kMagic);
  file.record(header, header_of(scene));
  file.record(quantization, quantization_of(grid, color_off, sh_off));
  file.record(windows, table);
  const Viewpoint& view = scene.viewpoint;
  Content eye;
  eye.put(view.fov_y).put(view.position).put(view.target).put(uint32_t(0)).text("linear");
  file.record(camera, eye.put(uint8_t(0)));
  std::vector<Written> chunks;
  for (auto& [interval, members] : intervals) {
    std::vector<std::pair<uint64_t, size_t>> order;
    for (const size_t i : members) order.emplace_back(along_a_curve(bins[i][position], shift), i);
    std::sort(order.begin(), order.end());
    for (size_t k = 0; k < order.size(); ++k) members[k] = order[k].second;
    chunks.push_back(put_chunk(file, scene, bins, harmonics, interval.first, members));
  }
  const uint64_t summary = file.bytes().size();
  for (const Written& c : chunks) {
    Content entry;
    entry.put(c.begin).put(c.end).put(c.where.first).put(c.where.second).put(c.count);
    entry.put(uint32_t(c.bands.size()));
    for (size_t band = 0; band < c.bands.size(); ++band)
      entry.put(uint8_t(band + 1)).put(c.bands[band].first).put(c.bands[band].second);
    file.record(chunk_index, entry);
  }
  const auto crc = uint32_t(crc32(0, reinterpret_cast<const Bytef*>(file.bytes().data()) + summary,
                                  uInt(file.bytes().size() - summary)));
  Content last;
  file.record(footer, chunks.empty() ? last.put(uint64_t(0)).put(uint64_t(0)).put(uint32_t(0))
                                     : last.put(summary).put(uint64_t(0)).put(crc));
  file.raw(kMagic);
  write_file_atomically(path, file.bytes());
}

}  // namespace gflow
