// SPDX-License-Identifier: Apache-2.0
// Videos of many kinds, made by the ffmpeg program, against its own frames and times.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include "optim/images/video.hpp"
#include "optim/images/video_frame.hpp"
#include "optim/scene/scene.hpp"
#include "tests/support/scene_files.hpp"

namespace gflow {
namespace {

// What a command prints; "" and a test failure if it fails.
std::string printed(const std::string& command) {
  FILE* const pipe = ::popen(command.c_str(), "r");
  std::string text;
  char part[4096];
  for (size_t n; pipe && (n = std::fread(part, 1, sizeof part, pipe)) > 0;) text.append(part, n);
  EXPECT_TRUE(pipe && ::pclose(pipe) == 0) << command;
  return text;
}

std::string ffmpeg(const std::string& arguments) {
  return printed("ffmpeg -nostdin -v error -y " + arguments);
}

// Six frames of a moving test pattern of 64x48, with `filter`, encoded with `how`.
std::string make(const TemporaryFolder& folder, const std::string& name, const std::string& how,
                 const std::string& filter = "null") {
  const std::string path = folder.file(name);
  ffmpeg("-f lavfi -i testsrc2=size=64x48:rate=12:duration=0.5 -vf '" + filter + "' " + how + " " +
         path);
  return path;
}

struct VideoKind {
  const char *name, *file, *how;
  const char* filter = "null";  // before encoding
  const char* decoder = "";     // of the ffmpeg program
  const char* shown = "null";   // filter that makes what we show
  int width = 64, height = 48;  // shown
  bool alpha = false;
  bool rgba = alpha;  // frames have four channels
};

const char* const kAlphaPattern = "format=rgba,geq=r=r(X\\,Y):g=g(X\\,Y):b=b(X\\,Y):a=4*X";

const VideoKind kKinds[] = {
    {"h264", "a.mp4", "-c:v libx264 -pix_fmt yuv420p"},
    {"h264_bt709", "a.mp4",
     "-c:v libx264 -pix_fmt yuv420p -colorspace bt709 -color_trc bt709 -color_primaries bt709",
     "scale=out_color_matrix=bt709"},
    {"h264_full_range", "a.mp4", "-c:v libx264 -pix_fmt yuv420p -color_range pc",
     "scale=out_range=full"},
    {"h264_444", "a.mkv", "-c:v libx264 -pix_fmt yuv444p"},
    {"yuvj", "a.mov", "-c:v mjpeg -pix_fmt yuvj420p -q:v 2"},
    {"hevc_10_bit_bt2020", "a.mp4",
     "-c:v libx265 -x265-params log-level=none -pix_fmt yuv420p10le -colorspace bt2020nc "
     "-color_trc bt2020-10 -color_primaries bt2020",
     "scale=out_color_matrix=bt2020"},
    {"hevc_hlg", "a.mov",
     "-c:v libx265 -x265-params log-level=none -pix_fmt yuv420p10le -colorspace bt2020nc "
     "-color_trc arib-std-b67 -color_primaries bt2020",
     "scale=out_color_matrix=bt2020,setparams=color_trc=arib-std-b67:color_primaries=bt2020:"
     "colorspace=bt2020nc"},
    {"vp9", "a.webm", "-c:v libvpx-vp9 -pix_fmt yuv420p -deadline realtime"},
    {"av1_or_mpeg2", "a.mpg", "-c:v mpeg2video -pix_fmt yuv420p -r 25"},
    {"prores_422", "a.mov", "-c:v prores_ks -profile:v 3"},
    {"rgb", "a.mkv", "-c:v ffv1 -pix_fmt bgr0"},
    {"grey", "a.avi", "-c:v ffv1 -pix_fmt gray"},
    {"palette", "a.gif", "", "null", "", "null", 64, 48, false, true},
    {"wide_pixels", "a.mp4", "-c:v libx264 -pix_fmt yuv420p", "setsar=2/1", "",
     "scale=iw*sar:ih,setsar=1", 128, 48},
    {"narrow_pixels", "a.mkv", "-c:v libx264 -pix_fmt yuv420p", "setsar=3/4", "",
     "scale=iw*sar:ih,setsar=1", 48, 48},
    {"png_with_alpha", "a.mov", "-c:v png -pix_fmt rgba", kAlphaPattern, "", "null", 64, 48, true},
    {"qtrle_with_alpha", "a.mov", "-c:v qtrle -pix_fmt argb", kAlphaPattern, "", "null", 64, 48,
     true},
    {"prores_with_alpha", "a.mov", "-c:v prores_ks -profile:v 4444 -pix_fmt yuva444p10le",
     kAlphaPattern, "", "null", 64, 48, true},
    {"vp9_with_alpha", "a.webm", "-c:v libvpx-vp9 -pix_fmt yuva420p -auto-alt-ref 0", kAlphaPattern,
     "-c:v libvpx-vp9", "null", 64, 48, true},
};

class VideoOfKind : public testing::TestWithParam<VideoKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, VideoOfKind, testing::ValuesIn(kKinds),
                         [](const auto& kind) { return std::string(kind.param.name); });
void PrintTo(const VideoKind& kind, std::ostream* out) { *out << kind.name; }

TEST_P(VideoOfKind, ShowsTheFramesOfFfmpeg) {
  const VideoKind& kind = GetParam();
  const TemporaryFolder folder;
  const std::string path = make(folder, kind.file, kind.how, kind.filter);
  const int channels = kind.rgba ? 4 : 3;
  const std::string expected =
      ffmpeg(fmt::format("{} -i {} -vf '{}' -f rawvideo -pix_fmt {} -fps_mode passthrough -",
                         kind.decoder, path, kind.shown, channels == 4 ? "rgba" : "rgb24"));
  const size_t bytes = size_t(kind.width) * size_t(kind.height) * size_t(channels);
  ASSERT_EQ(expected.size() % bytes, 0u);
  const size_t count = expected.size() / bytes;
  ASSERT_GE(count, 6u);
  const VideoInfo info = video_info(path);
  EXPECT_EQ(info.width, kind.width);
  EXPECT_EQ(info.height, kind.height);
  EXPECT_EQ(info.alpha, kind.alpha);
  EXPECT_EQ(frame_times(path).size(), count);
  Video video(path);
  for (size_t k = 0; k < count; ++k) {
    const Image image = video.frame(int(k));
    ASSERT_EQ(image.pixels.size(), bytes);
    int worst = 0;
    for (size_t i = 0; i < bytes; ++i)
      worst = std::max(worst, std::abs(image.pixels[i] - int(uint8_t(expected[k * bytes + i]))));
    EXPECT_LE(worst, 2) << "frame " << k;
  }
}

// The corner of a video that is red at the top left and blue at the top right, turned by a tag.
TEST(VideoTurned, ByItsDisplayMatrixIsUpright) {
  const TemporaryFolder folder;
  const std::string straight = folder.file("a.mp4");
  ffmpeg(
      "-f lavfi -i color=red:s=32x48:d=0.3 -f lavfi -i color=blue:s=32x48:d=0.3 "
      "-filter_complex '[0][1]hstack' -c:v libx264 -pix_fmt yuv420p " +
      straight);
  struct Case {
    int degrees, width, height, red_x, red_y;
  };
  for (const Case c : {Case{90, 48, 64, 24, 10}, {180, 64, 48, 54, 24}, {270, 48, 64, 24, 54}}) {
    const std::string path = folder.file(fmt::format("{}.mp4", c.degrees));
    ffmpeg("-i " + straight + " -c copy " + path);
    // The display matrix in the track header: rows (a b u), (c d v), 16.16; tkhd is 92 bytes long.
    std::string bytes = contents(path);
    const size_t matrix = bytes.find("tkhd") + 4 + 40;
    const auto set = [&](size_t at, int value) {
      const uint32_t fixed = uint32_t(value * 65536);
      for (size_t i = 0; i < 4; ++i) bytes[matrix + 4 * at + i] = char(fixed >> (24 - 8 * i));
    };
    const int cosine = c.degrees == 180 ? -1 : 0, sine = c.degrees == 90    ? 1
                                                         : c.degrees == 270 ? -1
                                                                            : 0;
    set(0, cosine), set(1, sine), set(3, -sine), set(4, cosine);
    folder.write(fmt::format("{}.mp4", c.degrees), bytes);
    const VideoInfo info = video_info(path);
    EXPECT_EQ(info.rotation, c.degrees);
    EXPECT_EQ(info.width, c.width);
    EXPECT_EQ(info.height, c.height);
    const Image image = Video(path).frame(1);
    ASSERT_EQ(image.width, c.width);
    const auto red = [&](int x, int y) {
      return image.pixels[3 * size_t(y * image.width + x)] > 200;
    };
    EXPECT_TRUE(red(c.red_x, c.red_y)) << c.degrees;
    EXPECT_FALSE(red(c.width - 1 - c.red_x, c.height - 1 - c.red_y)) << c.degrees;
    const std::string ours(image.pixels.begin(), image.pixels.end());
    const std::string theirs = ffmpeg("-i " + path + " -f rawvideo -pix_fmt rgb24 -");
    EXPECT_EQ(ours, theirs.substr(ours.size(), ours.size())) << c.degrees;
  }
}

std::vector<double> times_of_ffprobe(const std::string& path) {
  std::istringstream lines(
      printed("ffprobe -v error -select_streams v -show_entries frame=best_effort_timestamp_time "
              "-of csv=p=0 " +
              path));
  std::vector<double> times;
  for (std::string line; std::getline(lines, line);)
    if (!line.empty()) times.push_back(std::atof(line.c_str()));
  return times;
}

// B-frames are stored out of order; the last frames come when the file has ended.
TEST(VideoTimes, OfAVariableFrameRateWithBFramesAreThoseOfTheContainer) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.mp4");
  ffmpeg(
      "-f lavfi -i testsrc2=size=64x48:rate=24:duration=0.5 -vf "
      "'setpts=if(lt(N\\,6)\\,N\\,6+3*(N-6))/24/TB' -fps_mode vfr -c:v libx264 -bf 3 " +
      path);
  const std::vector<double> times = frame_times(path), expected = times_of_ffprobe(path);
  ASSERT_EQ(times.size(), expected.size());
  ASSERT_GE(times.size(), 11u);  // FFmpeg 7 leaves the last one out
  for (size_t k = 0; k < times.size(); ++k) EXPECT_NEAR(times[k], expected[k] - expected[0], 1e-6);
  EXPECT_NEAR(times[6], 6. / 24, 1e-4);
  EXPECT_NEAR(times[7] - times[6], 3. / 24, 1e-4);
  EXPECT_TRUE(video_info(path).variable);
  EXPECT_FALSE(video_info(make(folder, "b.mkv", "-c:v libx264")).variable);
}

// An edit list hides the frames between the key frame and the cut.
TEST(VideoTimes, OfATrimmedFileAreThoseOfTheFramesShown) {
  const TemporaryFolder folder;
  const std::string whole = make(folder, "a.mp4", "-c:v libx264 -bf 2 -pix_fmt yuv420p"),
                    path = folder.file("b.mp4");
  ffmpeg("-ss 0.25 -i " + whole + " -c copy " + path);
  const size_t shown = times_of_ffprobe(path).size();
  EXPECT_LT(shown, 6u);
  EXPECT_EQ(frame_times(path).size(), shown);
  EXPECT_EQ(size_t(video_info(path).frames), shown);
  EXPECT_EQ(read_scene(path).notices.size(), 1u);  // that there are no poses
  const std::string first = ffmpeg("-i " + path + " -frames:v 1 -f rawvideo -pix_fmt rgb24 -");
  const Image image = Video(path).frame(0);
  EXPECT_EQ(std::string(image.pixels.begin(), image.pixels.end()), first);
}

TEST(VideoAlpha, IsThatOfTheScene) {
  const TemporaryFolder folder;
  EXPECT_TRUE(
      read_scene(make(folder, "a.mov", "-c:v qtrle -pix_fmt argb", kAlphaPattern)).has_alpha);
  EXPECT_FALSE(read_scene(make(folder, "b.mov", "-c:v qtrle -pix_fmt rgb24")).has_alpha);
  EXPECT_FALSE(read_scene(make(folder, "c.mov", "-c:v qtrle -pix_fmt argb")).has_alpha);  // opaque
}

TEST(VideoAlpha, OfAPaletteIsThatOfTheFrames) {
  const TemporaryFolder folder;
  const std::string path = make(folder, "a.mov", "-c:v png -pix_fmt pal8",
                                "format=rgba,geq=r=r(X\\,Y):g=g(X\\,Y):b=b(X\\,Y):a=gte(X\\,32)*"
                                "255,split[a][b];[a]palettegen=transparency_color=black[p];"
                                "[b][p]paletteuse");
  const Image image = Video(path).frame(0);
  ASSERT_EQ(image.channels, 4);
  EXPECT_EQ(image.pixels[3], 0);
  EXPECT_EQ(image.pixels[4 * 63 + 3], 255);
}

// The index of a file that begins with it states all frames, however many are there.
TEST(VideoFrames, AreNotMoreThanThePacketsOfAFile) {
  const TemporaryFolder folder;
  const std::string path = make(
      folder, "a.mp4", "-c:v libx264 -g 1 -movflags +faststart -pix_fmt yuv420p", "noise=alls=80");
  const std::string whole = contents(path);
  const std::string half = folder.write("half.mp4", whole.substr(0, whole.size() / 2));
  EXPECT_EQ(video_info(path).frames, 6);
  EXPECT_EQ(video_info(path).times.size(), 6u);
  EXPECT_NEAR(video_info(path).times[2], 2 / 12., 1e-4);
  EXPECT_LT(video_info(half).frames, 5);
  EXPECT_GE(video_info(half).frames, 2);
}

// Code values of grey at 1 and 203 cd/m2 and beyond (SMPTE ST 2084).
TEST(VideoHdr, IsToneMappedToTheRangeOfAScreen) {
  const auto shown = [](double code) {
    const auto value = uint16_t(std::lround(65535 * code));
    const uint16_t rgb[3] = {value, value, value};
    uint8_t out[3];
    tone_map_pq(rgb, 1, out);
    EXPECT_NEAR(out[0], out[1], 1);
    EXPECT_NEAR(out[0], out[2], 1);
    return int(out[1]);
  };
  EXPECT_EQ(shown(0), 0);
  // 10 cd/m2 are 4.9 % of white, below the knee: sRGB 0.246.
  EXPECT_NEAR(shown(0.3019), 63, 1);
  int before = -1;
  for (double code = 0; code <= 1; code += 0.01) {
    EXPECT_GE(shown(code), before);
    before = shown(code);
  }
  EXPECT_EQ(shown(0.7518), 255);  // 1000 cd/m2
  EXPECT_GT(shown(0.5807), 200);  // 203 cd/m2
  EXPECT_LT(shown(0.5807), 250);  // leaves room for highlights
}

TEST(VideoHdr, OfAFileIsNeitherDullNorBurnt) {
  const TemporaryFolder folder;
  const std::string path =
      make(folder, "a.mov",
           "-c:v libx265 -x265-params log-level=none -pix_fmt yuv420p10le -colorspace bt2020nc "
           "-color_trc smpte2084 -color_primaries bt2020",
           "scale=out_color_matrix=bt2020,setparams=color_trc=smpte2084:color_primaries=bt2020:"
           "colorspace=bt2020nc");
  EXPECT_NE(video_info(path).colors.find("HDR (PQ)"), std::string::npos);
  EXPECT_EQ(video_info(path).bits, 10);
  const Image image = Video(path).frame(0);
  EXPECT_EQ(image.channels, 3);
}

}  // namespace
}  // namespace gflow
