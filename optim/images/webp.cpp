// SPDX-License-Identifier: Apache-2.0
#include <webp/decode.h>

#include <algorithm>

#include "optim/images/decoded_image.hpp"

namespace gflow {

std::string webp_header(ByteSource& source, ImageHeader& header) {
  // The headers of the container and of the image in it.
  uint8_t start[64];
  const size_t n = std::min(source.size(), sizeof start);
  WebPBitstreamFeatures features{};
  if (!source.read(0, start, n) || WebPGetFeatures(start, n, &features) != VP8_STATUS_OK)
    return "its WebP header is truncated or damaged";
  if (features.has_animation) return "it is an animated WebP, expected a single image";
  header.width = features.width;
  header.height = features.height;
  header.has_alpha = features.has_alpha != 0;
  return "";
}

DecodedImage decode_webp(const Bytes& bytes) {
  MemorySource source(bytes);
  ImageHeader header;
  DecodedImage result;
  result.complaint = webp_header(source, header);
  if (!result.complaint.empty()) return result;
  result.width = header.width;
  result.height = header.height;
  result.channels = header.has_alpha ? 4 : 3;
  result.bits = 8;
  result.pixels.resize(result.row() * size_t(result.height));
  const auto decode = header.has_alpha ? WebPDecodeRGBAInto : WebPDecodeRGBInto;
  if (!decode(bytes.data(), bytes.size(), result.pixels.data(), result.pixels.size(),
              int(result.row()))) {
    result.pixels.clear();
    result.complaint = "WebP data cannot be decoded";
  }
  return result;
}

}  // namespace gflow
