// SPDX-License-Identifier: Apache-2.0
// Resampling by OpenCV; files are decoded by decoded_image.hpp.
#include "optim/images/image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <set>

#include "optim/images/decoded_image.hpp"
#include "optim/images/image_header.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/packed_size.hpp"

namespace gflow {
namespace {

// A cv::Mat over the image's memory. const_cast is safe because OpenCV does not write to inputs.
cv::Mat as_mat(const Image& image) {
  return cv::Mat(image.height, image.width, CV_8UC(image.channels),
                 const_cast<uint8_t*>(image.pixels.data()));
}

Image from_mat(const cv::Mat& mat) {
  Image image{mat.cols, mat.rows, mat.channels(), {}};
  const cv::Mat packed = mat.isContinuous() ? mat : mat.clone();
  image.pixels.assign(packed.data, packed.data + packed.total() * packed.elemSize());
  return image;
}

// Converts colours straight into the result, without another copy of a large image.
Image converted(const cv::Mat& mat, int channels, int conversion) {
  Image image{mat.cols, mat.rows, channels, {}};
  image.pixels.resize(mat.total() * size_t(channels));
  cv::Mat header(image.height, image.width, CV_8UC(channels), image.pixels.data());
  cv::cvtColor(mat, header, conversion);
  return image;
}

void check_pixels(const Image& image, const std::string& doing) {
  const size_t n = size_t(image.width) * size_t(image.height) * size_t(image.channels);
  const bool channels = image.channels == 1 || image.channels == 3 || image.channels == 4;
  if (image.width < 1 || image.height < 1 || !channels || image.pixels.size() != n)
    throw Error(fmt::format("cannot {}: {}x{} pixels with {} channels do not match {} bytes", doing,
                            image.width, image.height, image.channels, image.pixels.size()));
}

DecodedImage decode_as(ImageFormat format, const Bytes& bytes) {
  switch (format) {
    case ImageFormat::png:
      return decode_png(bytes);
    case ImageFormat::jpeg:
      return decode_jpeg(bytes);
    case ImageFormat::webp:
      return decode_webp(bytes);
    case ImageFormat::tiff:
      return decode_tiff(bytes);
  }
  return {};
}

// `bytes` must have passed check_image_bytes, which returned the format.
DecodedImage decode(const Bytes& bytes, ImageFormat format, const std::string& path) {
  DecodedImage decoded = decode_as(format, bytes);
  const std::string& why = decoded.complaint;
  if (decoded.pixels.empty())
    throw Error(fmt::format("cannot read image {}: it is damaged ({})", path, why));
  static std::mutex mutex;
  static std::set<std::string> told;  // an image may be decoded many times
  const std::lock_guard<std::mutex> lock(mutex);
  if (!why.empty() && told.insert(path).second)
    warn(fmt::format("image {} may be damaged ({}); using it anyway", path, why));
  return decoded;
}

DecodedImage read_decoded(const std::string& path) {
  const Bytes bytes = read_file(path);
  return decode(bytes, check_image_bytes(bytes, path).format, path);
}

// A cv::Mat over the image's memory.
cv::Mat as_mat(DecodedImage& decoded) {
  const int depth = decoded.bits == 16 ? CV_16U : CV_8U;
  return cv::Mat(decoded.height, decoded.width, CV_MAKETYPE(depth, decoded.channels),
                 decoded.pixels.data());
}

cv::Mat as_8_bits(DecodedImage& decoded) {
  const cv::Mat mat = as_mat(decoded);
  if (decoded.bits == 8) return mat;
  cv::Mat result;
  mat.convertTo(result, CV_8U, 1 / 257.);  // 65535 -> 255, rounded
  return result;
}

// Applies sample(in, out). Colours of an image with alpha are premultiplied, so that the hidden
// colours of transparent pixels do not bleed in.
template <class Sample>
Image resampled(const Image& image, Sample sample) {
  cv::Mat result;
  if (image.channels != 4) {
    sample(as_mat(image), result);
    return from_mat(result);
  }
  cv::Mat mat;
  as_mat(image).convertTo(mat, CV_32F);
  mat.forEach<cv::Vec4f>([](cv::Vec4f& p, const int*) {
    for (int c = 0; c < 3; ++c) p[c] *= p[3];
  });
  sample(mat, result);
  result.forEach<cv::Vec4f>([](cv::Vec4f& p, const int*) {
    for (int c = 0; c < 3; ++c) p[c] = p[3] > 0 ? p[c] / p[3] : 0;
  });
  result.convertTo(result, CV_8U);
  return from_mat(result);
}

}  // namespace

Image read_image(const std::string& path) {
  DecodedImage decoded = read_decoded(path);
  if (decoded.bits == 8 && decoded.channels > 1)
    return {decoded.width, decoded.height, decoded.channels, std::move(decoded.pixels)};
  const cv::Mat mat = as_8_bits(decoded);
  return mat.channels() == 1 ? converted(mat, 3, cv::COLOR_GRAY2RGB) : from_mat(mat);
}

Image read_grey(const std::string& path) {
  DecodedImage decoded = read_decoded(path);
  const cv::Mat mat = as_8_bits(decoded);
  if (mat.channels() == 1) return from_mat(mat);
  if (mat.channels() == 4) {
    cv::Mat parts[4];
    cv::split(mat, parts);
    const auto is_even = [](const cv::Mat& part) {
      double least = 0, most = 0;
      cv::minMaxLoc(part, &least, &most);
      return least == most;
    };
    if (is_even(parts[0]) && is_even(parts[1]) && is_even(parts[2])) return from_mat(parts[3]);
  }
  return converted(mat, 1, mat.channels() == 4 ? cv::COLOR_RGBA2GRAY : cv::COLOR_RGB2GRAY);
}

Image over_background(Image image, std::array<uint8_t, 3> background) {
  if (image.channels != 4) return image;
  Image rgb{image.width, image.height, 3, {}};
  const size_t n = image.pixels.size() / 4;
  rgb.pixels.resize(3 * n);
  for (size_t i = 0; i < n; ++i) {
    const int alpha = image.pixels[4 * i + 3];
    for (size_t c = 0; c < 3; ++c)
      rgb.pixels[3 * i + c] =
          uint8_t((image.pixels[4 * i + c] * alpha + background[c] * (255 - alpha) + 127) / 255);
  }
  return rgb;
}

Image resized(const Image& image, int width, int height) {
  check_pixels(image, "resize an image");
  if (width == image.width && height == image.height) return image;
  const bool shrinks = width <= image.width && height <= image.height;
  const int filter = shrinks ? cv::INTER_AREA : cv::INTER_LINEAR;
  return resampled(image, [&](const cv::Mat& in, cv::Mat& out) {
    cv::resize(in, out, cv::Size(width, height), 0, 0, filter);
  });
}

Image remapped(const Image& image, int width, int height, const std::vector<float>& from) {
  check_pixels(image, "resample an image");
  // OpenCV's pixel centres are at integers.
  const cv::Mat map =
      cv::Mat(height, width, CV_32FC2, const_cast<float*>(from.data())) - cv::Scalar(0.5, 0.5);
  return resampled(image, [&](const cv::Mat& in, cv::Mat& out) {
    cv::remap(in, out, map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  });
}

void write_png(const std::string& path, const Image& image) {
  check_pixels(image, "write " + path);
  write_file_atomically(
      path, encode_png({image.width, image.height, image.channels, 8, image.pixels.data()}));
}

std::vector<uint8_t> jpeg_of(const Image& image, int quality) {
  check_pixels(image, "encode a JPEG");
  if (image.channels != 3)
    throw Error(
        fmt::format("cannot encode a JPEG: the image has {} channels, not 3", image.channels));
  return encode_jpeg(image.width, image.height, image.pixels.data(), quality);
}

void write_png16(const std::string& path, int width, int height,
                 const std::vector<uint16_t>& values) {
  if (width < 1 || height < 1 || values.size() != size_t(width) * size_t(height))
    throw Error(fmt::format("cannot write {}: {}x{} pixels do not match {} values", path, width,
                            height, values.size()));
  write_file_atomically(
      path, encode_png({width, height, 1, 16, reinterpret_cast<const uint8_t*>(values.data())}));
}

GreyLevels read_grey_levels(const std::string& path) {
  DecodedImage decoded = read_decoded(path);
  if (decoded.channels != 1)
    throw Error(fmt::format("{} has colours or alpha, expected grey levels of 8 or 16 bits", path));
  cv::Mat levels;
  as_mat(decoded).convertTo(levels, CV_16U);
  return {levels.cols, levels.rows, {levels.begin<uint16_t>(), levels.end<uint16_t>()}};
}

FlowField read_kitti_flow(const std::string& path) {
  const Bytes bytes = read_file(path);
  const ImageHeader header = check_image_bytes(bytes, path);
  // Three channels of 16 bits. The default plausibility bound applies: flow is less compressible
  // than images of one colour.
  require_plausible_size(6 * size_t(header.width) * size_t(header.height), bytes.size(), path);
  DecodedImage decoded = decode(bytes, header.format, path);
  const cv::Mat mat = as_mat(decoded);
  if (mat.type() != CV_16UC3)
    throw Error(fmt::format("cannot read flow {}: KITTI flow is a 16-bit RGB PNG", path));
  FlowField flow = zero_flow(mat.cols, mat.rows);
  for (int y = 0, i = 0; y < mat.rows; ++y)
    for (int x = 0; x < mat.cols; ++x, ++i) {
      const auto rgb = mat.at<cv::Vec3w>(y, x);
      flow.valid[size_t(i)] = rgb[2] > 0;
      if (!rgb[2]) continue;
      flow.uv[2 * size_t(i)] = (float(rgb[0]) - 32768.f) / 64.f;
      flow.uv[2 * size_t(i) + 1] = (float(rgb[1]) - 32768.f) / 64.f;
    }
  return flow;
}

}  // namespace gflow
