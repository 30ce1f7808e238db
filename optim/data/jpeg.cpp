// SPDX-License-Identifier: Apache-2.0
#include "optim/data/jpeg.hpp"

#include <csetjmp>
#include <cstdio>
// jpeglib.h takes for granted that FILE is known, and jerror.h that jpeglib.h is.
// clang-format off
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

namespace gflow {
namespace {

// What libjpeg says on the way.
struct Report {
  jpeg_error_mgr manager;  // first: libjpeg has a pointer to it
  std::jmp_buf stop;
  char words[JMSG_LENGTH_MAX] = "";
};

Report& report_of(j_common_ptr decoder) { return *reinterpret_cast<Report*>(decoder->err); }

void keep_words(j_common_ptr decoder) {
  Report& report = report_of(decoder);
  if (!report.words[0]) decoder->err->format_message(decoder, report.words);
}

[[noreturn]] void on_error(j_common_ptr decoder) {
  keep_words(decoder);
  std::longjmp(report_of(decoder).stop, 1);
}

// level -1: the data are corrupt; above it is tracing.
void on_message(j_common_ptr decoder, int level) {
  if (level < 0 && decoder->err->msg_code != JWRN_EXTRANEOUS_DATA) keep_words(decoder);
}

// Nothing in here may need a destructor: an error leaves it by longjmp.
void decode_small(jpeg_decompress_struct& decoder, Report& report, const Bytes& bytes) {
  if (setjmp(report.stop)) return;
  jpeg_create_decompress(&decoder);
  jpeg_mem_src(&decoder, bytes.data(), static_cast<unsigned long>(bytes.size()));
  jpeg_read_header(&decoder, TRUE);
  decoder.scale_num = 1;  // every coefficient is read, one in 64 is used
  decoder.scale_denom = 8;
  jpeg_start_decompress(&decoder);
  const JDIMENSION width = decoder.output_width * JDIMENSION(decoder.output_components);
  JSAMPARRAY row =
      decoder.mem->alloc_sarray(reinterpret_cast<j_common_ptr>(&decoder), JPOOL_IMAGE, width, 1);
  while (decoder.output_scanline < decoder.output_height && !report.words[0])
    jpeg_read_scanlines(&decoder, row, 1);
}

}  // namespace

std::string damage_of_jpeg(const Bytes& bytes) {
  jpeg_decompress_struct decoder{};
  Report report;
  decoder.err = jpeg_std_error(&report.manager);
  report.manager.error_exit = on_error;
  report.manager.emit_message = on_message;
  decode_small(decoder, report, bytes);
  jpeg_destroy_decompress(&decoder);
  return report.words;
}

}  // namespace gflow
