// SPDX-License-Identifier: Apache-2.0
// Uses libjpeg and not cv::imdecode: it is a third faster because it writes RGB at once, and its
// warnings can be caught.
#include <csetjmp>
#include <cstdio>
// jpeglib.h needs FILE to be declared, and jerror.h needs jpeglib.h: the order matters.
// clang-format off
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

#include <fmt/format.h>

#include <cstdlib>
#include <memory>

#include "optim/images/decoded_image.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace {

// Error handler for libjpeg; keeps its first message.
struct JpegReport {
  jpeg_error_mgr manager;  // must be first: libjpeg's pointer to it is cast back
  std::jmp_buf stop;
  char words[JMSG_LENGTH_MAX] = "";
};

JpegReport& report_of(j_common_ptr decoder) { return *reinterpret_cast<JpegReport*>(decoder->err); }

void keep_words(j_common_ptr decoder) {
  JpegReport& report = report_of(decoder);
  if (!report.words[0]) decoder->err->format_message(decoder, report.words);
}

[[noreturn]] void on_error(j_common_ptr decoder) {
  keep_words(decoder);
  std::longjmp(report_of(decoder).stop, 1);
}

// level -1 means corrupt data; higher levels are traces. Extraneous bytes between segments are
// ignored, because some cameras write them.
void on_message(j_common_ptr decoder, int level) {
  if (level < 0 && decoder->err->msg_code != JWRN_EXTRANEOUS_DATA) keep_words(decoder);
}

// CMYK to RGB. CMYK JPEGs store inverted inks (255: no ink).
void mix(const JSAMPLE* inks, uint8_t* rgb, int width) {
  for (int x = 0; x < width; ++x, inks += 4, rgb += 3)
    for (int c = 0; c < 3; ++c) rgb[c] = uint8_t((inks[c] * inks[3] + 127) / 255);
}

// No local object may need a destructor: errors leave this function by longjmp.
void decode(jpeg_decompress_struct& decoder, JpegReport& report, const Bytes& bytes,
            DecodedImage& to) {
  if (setjmp(report.stop)) return;
  jpeg_create_decompress(&decoder);
  jpeg_mem_src(&decoder, bytes.data(), static_cast<unsigned long>(bytes.size()));
  jpeg_read_header(&decoder, TRUE);
  const bool grey = decoder.num_components == 1, inks = decoder.num_components == 4;
  decoder.out_color_space = grey ? JCS_GRAYSCALE : inks ? JCS_CMYK : JCS_RGB;
  jpeg_start_decompress(&decoder);
  to.width = int(decoder.output_width);
  to.height = int(decoder.output_height);
  to.channels = grey ? 1 : 3;
  to.bits = 8;
  to.pixels.resize(size_t(to.height) * to.row());
  JSAMPARRAY of_inks = decoder.mem->alloc_sarray(reinterpret_cast<j_common_ptr>(&decoder),
                                                 JPOOL_IMAGE, 4 * decoder.output_width, 1);
  while (decoder.output_scanline < decoder.output_height && !report.words[0]) {
    JSAMPROW row = to.pixels.data() + decoder.output_scanline * to.row();
    if (jpeg_read_scanlines(&decoder, inks ? of_inks : &row, 1) == 1 && inks)
      mix(of_inks[0], row, to.width);
  }
}

// The same for encoding. `bytes` is allocated by libjpeg.
void encode(jpeg_compress_struct& encoder, JpegReport& report, int width, int height,
            const uint8_t* rgb, int quality, unsigned char** bytes, unsigned long* size) {
  if (setjmp(report.stop)) return;
  jpeg_create_compress(&encoder);
  jpeg_mem_dest(&encoder, bytes, size);
  encoder.image_width = JDIMENSION(width);
  encoder.image_height = JDIMENSION(height);
  encoder.input_components = 3;
  encoder.in_color_space = JCS_RGB;
  jpeg_set_defaults(&encoder);
  jpeg_set_quality(&encoder, quality, TRUE);
  encoder.optimize_coding = TRUE;
  jpeg_start_compress(&encoder, TRUE);
  while (encoder.next_scanline < encoder.image_height) {
    JSAMPROW row = const_cast<JSAMPROW>(rgb + size_t{3} * encoder.next_scanline * size_t(width));
    jpeg_write_scanlines(&encoder, &row, 1);
  }
  jpeg_finish_compress(&encoder);
}

}  // namespace

DecodedImage decode_jpeg(const Bytes& bytes) {
  jpeg_decompress_struct decoder{};
  JpegReport report;
  DecodedImage result;
  decoder.err = jpeg_std_error(&report.manager);
  report.manager.error_exit = on_error;
  report.manager.emit_message = on_message;
  decode(decoder, report, bytes, result);
  jpeg_destroy_decompress(&decoder);
  result.complaint = report.words;
  if (!result.complaint.empty()) result.pixels.clear();  // libjpeg invents the missing pixels
  return result;
}

Bytes encode_jpeg(int width, int height, const uint8_t* rgb, int quality) {
  jpeg_compress_struct encoder{};
  JpegReport report;
  encoder.err = jpeg_std_error(&report.manager);
  report.manager.error_exit = on_error;
  report.manager.emit_message = on_message;
  unsigned char* start = nullptr;
  unsigned long size = 0;
  encode(encoder, report, width, height, rgb, quality, &start, &size);
  jpeg_destroy_compress(&encoder);
  const std::unique_ptr<unsigned char, void (*)(void*)> owned(start, std::free);
  if (report.words[0] || !start)
    throw Error(
        fmt::format("cannot encode a JPEG of {} x {} pixels: {}", width, height, report.words));
  return {start, start + size};
}

}  // namespace gflow
