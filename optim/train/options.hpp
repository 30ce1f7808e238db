// SPDX-License-Identifier: Apache-2.0
// Every setting of a training run: plain structs, the default at the member. What a setting means,
// its unit and its range stand once, in fields() below the members; reading, --set, printing and
// checking all go through that list, so a new setting is one member and one line.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "optim/density/density.hpp"
#include "optim/engine/settings.hpp"
#include "optim/images/movie.hpp"
#include "optim/motion/models.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// The values a number may take. An empty `among` means every value between min and max. Bounds are
// floats because the settings are: 0.99 as a float exceeds 0.99 as a double.
struct Allowed {
  float min = std::numeric_limits<float>::lowest();
  float max = std::numeric_limits<float>::max();
  bool above_min = false;  // min itself is refused
  std::vector<float> among = {};
  bool or_zero = false;  // 0 as well, which leaves it to gflow

  bool contains(double value) const;  // false for NaN and infinities
  bool contains(int64_t value) const;
  std::string text() const;  // "0 to 1", "at least 1", "above 0", "one of 1, 2, 4, 8"
};
inline Allowed between(float min, float max) { return {min, max}; }
inline Allowed zero_or_between(float min, float max) {
  Allowed range{min, max};
  range.or_zero = true;
  return range;
}
inline Allowed at_least(float min) { return {min}; }
inline Allowed above(float min) {
  Allowed range{min};
  range.above_min = true;
  return range;
}
inline Allowed above_up_to(float min, float max) {
  Allowed range{min, max};
  range.above_min = true;
  return range;
}
Allowed one_of(std::vector<float> values);

// Choices. names_of() gives the words of the file, in the order of the enumerators, which
// count from 0.
enum class Background { white, black, random };
enum class InitFrom { automatic, points, stereo, random, visual_hull, file };
enum class FlowSource { dis, files, tracks };
enum class FlowPairs { track, time };
enum class FarFlow { chain, direct, tracks };
enum class GuidanceProvider { none, process, onnx, analytic };
enum class GuidanceCameras { orbit, test, val };
enum class UpAxis { automatic, cameras, x, y, z };
enum class NoiseKind { scaled_linear, linear };

constexpr std::array<const char*, 3> names_of(Background) { return {"white", "black", "random"}; }
constexpr std::array<const char*, 3> names_of(Masks) { return {"auto", "all", "none"}; }
constexpr std::array<const char*, 6> names_of(InitFrom) {
  return {"auto", "points", "stereo", "random", "visual-hull", "file"};
}
// motion.model: left to the scene, or a MotionModelKind, each one number higher.
enum class MotionChoice { automatic };
constexpr MotionChoice choice_of(MotionModelKind kind) { return MotionChoice(int(kind) + 1); }
constexpr auto names_of(MotionChoice) {
  constexpr auto kinds = names_of(MotionModelKind{});
  std::array<const char*, kinds.size() + 1> names = {"auto"};
  for (size_t k = 0; k < kinds.size(); ++k) names[k + 1] = kinds[k];
  return names;
}

constexpr std::array<const char*, 3> names_of(FlowSource) { return {"dis", "files", "tracks"}; }
constexpr std::array<const char*, 2> names_of(FlowPairs) { return {"track", "time"}; }
constexpr std::array<const char*, 3> names_of(FarFlow) { return {"chain", "direct", "tracks"}; }
constexpr std::array<const char*, 4> names_of(GuidanceProvider) {
  return {"none", "process", "onnx", "analytic"};
}
constexpr std::array<const char*, 3> names_of(GuidanceCameras) { return {"orbit", "test", "val"}; }
constexpr std::array<const char*, 5> names_of(UpAxis) { return {"auto", "cameras", "x", "y", "z"}; }
constexpr std::array<const char*, 2> names_of(NoiseKind) { return {"scaled_linear", "linear"}; }

// The grey, 0 to 255, behind pictures where they are shown or judged: random is for training steps
// only, and white elsewhere.
constexpr uint8_t shown_level(Background background) {
  return background == Background::black ? 0 : 255;
}

// In every struct, fields(self, field) calls field(key, member, help[, range]) for each setting in
// the order of the file; self is the struct, const or not.

struct SceneConfig {
  std::string path;
  int resolution = 1;
  Background background = Background::white;
  int holdout = 0;
  std::string images;
  Masks masks = Masks::automatic;
  std::string cameras;
  std::string camera;
  float fps = 0;
  float elevation = 0;
  float radius = 2;
  float fovy = 49.1f;
  bool first_views = false;
  int test_every = 8;
  int first_step = 0;
  int stride = 1;
  int max_steps = 0;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("path", self.path, "folder of the scene; `gflow train SCENE` sets it");
    field("resolution", self.resolution, "divides the width and height of the pictures",
          one_of({1, 2, 4, 8}));
    field("background", self.background,
          "behind pictures with transparency; random: a new colour in each training step, white "
          "elsewhere");
    field("holdout", self.holdout, "camera kept for the test, by number; -1: none (N3V)",
          at_least(-1));
    field("images", self.images,
          "folder with one picture a camera (N3V, COLMAP), or of rgb/ (nerfies); empty: found by "
          "name");
    field("masks", self.masks,
          "mask pictures as transparency; auto: mask_path (nerfstudio), masks/ (COLMAP); all: also "
          "seg/ (Panoptic)");
    field("cameras", self.cameras,
          "file of the camera that filmed, or of one camera a picture: cameras.json or "
          "transforms.json; empty: one at rest, by the three settings below (Consistent4D, video)");
    field("camera", self.camera, "the one of several in that file, by name");
    field("fps", self.fps, "pictures a second; 0: as the video says, else 24",
          zero_or_between(float(slowest_fps), float(fastest_fps)));
    field("elevation", self.elevation,
          "of the camera above the horizon [degrees] (Consistent4D, video)", between(-90, 90));
    field("radius", self.radius,
          "distance of the camera from the origin, or of a given one from what it films [scene "
          "units] (Consistent4D, video)",
          above(0));
    field("fovy", self.fovy, "vertical field of view [degrees] (Consistent4D, video)",
          between(1, 170));
    field("first_views", self.first_views,
          "train on the first picture of each view that is for the test, too (Consistent4D)");
    field("test_every", self.test_every,
          "every n-th picture is for the test; 0: none (COLMAP, nerfstudio)", at_least(0));
    field("first_step", self.first_step, "first time step that is used, from 0", at_least(0));
    field("stride", self.stride, "of the time steps from there, use every n-th", at_least(1));
    field("max_steps", self.max_steps, "use at most so many time steps; 0: all", at_least(0));
  }
};

// Random numbers are drawn by 32 bits of the seed. A number that a float holds and people can read.
constexpr int64_t kGreatestSeed = 2000000000;

struct ScheduleConfig {
  int iterations = 10000;
  int batch = 1;
  int focus = 5;
  bool sequential = false;
  float first_share = 0.3f;
  int64_t seed = 0;
  float minutes = 0;
  int log_every = 100;
  int checkpoint_every = 1000;
  int save_every = 0;
  std::string device;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("iterations", self.iterations, "training steps", at_least(1));
    field("batch", self.batch, "views in one step", between(1, 256));
    field("focus", self.focus,
          "steps on the parts of pictures where things change (fixed cameras) or are (alpha), for "
          "each step on whole pictures",
          at_least(0));
    field("sequential", self.sequential,
          "one time step after the other, as Dynamic 3D Gaussians: the first fits the scene, each "
          "next only moves it (motion.model keyframes, motion.keys 0)");
    field("first_share", self.first_share,
          "sequential: share of the iterations that the first time step gets", between(0, 1));
    field("seed", self.seed, "of every random choice", between(0, float(kGreatestSeed)));
    field("minutes", self.minutes,
          "stop after this much training time [minutes], not repeatably; 0: no limit", at_least(0));
    field("log_every", self.log_every, "steps between two lines of the log", at_least(1));
    field(
        "checkpoint_every", self.checkpoint_every,
        "steps between two checkpoints, from which --resume goes on; 0: only when training ends or "
        "is interrupted",
        at_least(0));
    field("save_every", self.save_every,
          "steps between two point clouds, point_cloud/iteration_N; 0: only when training ends or "
          "is interrupted",
          at_least(0));
    field("device", self.device,
          "OpenCL device by index or part of its name; empty: GFLOW_DEVICE, then any");
  }
};

struct MotionConfig {
  MotionChoice model = MotionChoice::automatic;
  int keys = 0;
  bool key_scales = false;
  int bases = 8;
  int sh_degree = 2;
  int sh_interval = 1000;
  float cutoff = 0.05f;
  float duration = 8;
  float rest = 0;
  int rest_every = 500;
  float rest_wake = 5;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("model", self.model,
          "how the Gaussians move: spacetime (curved paths, turning), native4d (4D Gaussians), "
          "keyframes (free paths through keys), bases (a few rigid motions shared by all), "
          "hexplane (one pose and a field that shifts it); auto: hexplane where one camera at a "
          "time sees the scene, else spacetime");
    field("keys", self.keys, "keyframes, bases: moments that hold the paths; 0: one a time step",
          between(0, 10000));
    field("key_scales", self.key_scales, "keyframes: sizes change along the keys, too");
    field("bases", self.bases, "bases: rigid motions", between(1, 32));
    field("duration", self.duration,
          "length of the video in the model's time [x scene extent]: a speed of 1 crosses so much",
          above(0));
    field("sh_degree", self.sh_degree, "highest degree of the spherical harmonics", between(0, 3));
    field("sh_interval", self.sh_interval, "steps between two rises of the degree in use",
          at_least(1));
    field("cutoff", self.cutoff, "a Gaussian whose temporal opacity is lower is skipped",
          between(0, 0.5f));
    field("rest", self.rest,
          "a Gaussian that moves and turns by less than this loses the parameters of its motion "
          "[its own size]; 0: all keep them",
          at_least(0));
    field("rest_every", self.rest_every, "steps between two rounds that decide who rests",
          at_least(1));
    field("rest_wake", self.rest_wake,
          "who rests moves again when what pulls at it adds up to so many times what chance would; "
          "0: only by growing",
          at_least(0));
  }
};

struct HexplaneConfig {
  int levels = 2;
  int channels = 16;
  int resolution = 32;
  int times = 0;
  int hidden = 64;
  int layers = 2;
  float slack = 0.5f;
  int warmup = 300;
  float unfold = 0.5f;
  float opacity = 0.01f;
  bool turn = true;
  bool resize = true;
  float plane_tv = 0;
  float time_smoothness = 0.01f;
  float l1_time = 0;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("levels", self.levels, "sets of planes, each twice as fine in space", between(1, 4));
    field("channels", self.channels, "features of a level", one_of({16, 32, 64}));
    field("resolution", self.resolution, "cells along x, y and z at the first level",
          between(2, 1024));
    field("times", self.times, "rows of the planes in time; 0: one for two time steps",
          between(0, 10000));
    field("hidden", self.hidden, "neurons of a hidden layer", one_of({32, 64, 128, 256}));
    field("layers", self.layers, "hidden layers", between(1, 4));
    field("slack", self.slack, "room around the first Gaussians [x their extent]", at_least(0));
    field("warmup", self.warmup,
          "first steps, in which nothing learns to move; at most a fifth of all", at_least(0));
    field("unfold", self.unfold,
          "share of the training in which the views widen from the middle of the video to all of "
          "it; 0: all at once",
          between(0, 1));
    field(
        "opacity", self.opacity,
        "learning rate instead of lr.opacity: what lasts must not fade before it has learnt where "
        "to be",
        at_least(0));
    field("turn", self.turn, "learn how Gaussians turn");
    field("resize", self.resize, "learn how Gaussians change their size");
    field("plane_tv", self.plane_tv,
          "weight of the squared differences between neighbours on planes of space", at_least(0));
    field("time_smoothness", self.time_smoothness,
          "weight of the squared second differences of planes in time", at_least(0));
    field("l1_time", self.l1_time,
          "weight of how far planes of time are from 1, that is, from rest", at_least(0));
  }
};

struct InitConfig {
  InitFrom from = InitFrom::automatic;
  std::string file;
  int count = 10000;
  float opacity = 0.1f;
  float lifetime = 1;
  float box = 1;
  int dynamic = 6000;
  float dynamic_lifetime = 1;

  // Whether the file says where to begin.
  bool begins_from_file() const {
    return from == InitFrom::file || (from == InitFrom::automatic && !file.empty());
  }

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("from", self.from,
          "first Gaussians: the scene's points; stereo: points on whose colours several cameras "
          "agree; "
          "random ones in a box; visual-hull: random ones on the object, by the pictures' alpha; "
          "those "
          "of a file; auto: file, points, visual-hull, stereo, random, the first that there is");
    field(
        "file", self.file,
        "splat that stands still, in the scene's coordinates: .ply, compressed .ply, .splat, .spz");
    field("count", self.count, "random or stereo points", at_least(1));
    field("opacity", self.opacity, "first opacity", above_up_to(0, 0.99f));
    field("box", self.box, "side of the box of random points [x scene extent]", above(0));
    field("dynamic", self.dynamic,
          "short-lived Gaussians where three or more fixed cameras see something move; 0: none",
          at_least(0));
    field("dynamic_lifetime", self.dynamic_lifetime,
          "their standard deviation in time [time steps]", above(0));
    field("lifetime", self.lifetime, "standard deviation in time [lengths of the video]", above(0));
  }
};

struct LossConfig {
  float ssim = 0.2f;
  float rigidity = 0;
  float rotation = 0;
  float isometry = 0;
  float velocity = 0;
  float acceleration = 0;
  int neighbours = 8;
  float neighbour_falloff = 0.5f;
  int neighbours_every = 500;
  int motion_every = 6;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("ssim", self.ssim, "share of 1 - SSIM in the image loss; the rest is L1", between(0, 1));
    field("rigidity", self.rigidity,
          "weight: neighbours move as the turn of each says; 0: off, as the next four",
          at_least(0));
    field("rotation", self.rotation, "weight: neighbours turn alike", at_least(0));
    field("isometry", self.isometry, "weight: neighbours keep their distance", at_least(0));
    field("velocity", self.velocity, "weight: neighbours move alike", at_least(0));
    field("acceleration", self.acceleration, "weight: paths do not bend", at_least(0));
    field("neighbours", self.neighbours, "nearest Gaussians that each is a neighbour of",
          between(1, 100));
    field("neighbour_falloff", self.neighbour_falloff,
          "neighbours at distance d count exp(-this (d / median of the distances)^2)", at_least(0));
    field("neighbours_every", self.neighbours_every,
          "steps between two searches for neighbours; also after each round of density control",
          at_least(1));
    field("motion_every", self.motion_every,
          "the weights above count in every n-th step only, n times as much (6: with train.focus = "
          "5 those on whole pictures)",
          at_least(1));
  }
};

struct FlowConfig {
  bool enabled = true;
  float weight = 0.05f;
  FlowSource source = FlowSource::dis;
  std::string folder;
  FlowPairs pairs = FlowPairs::track;
  int reach = 1;
  FarFlow far = FarFlow::chain;
  float far_share = 0.5f;
  std::string tracks;
  Transport transport = Transport::material;
  int top_k = 0;
  StopRule stop = StopRule::include;
  bool detach_t1 = false;
  bool detach_weights = false;
  float robust_px = 0.5f;
  int every = 0;
  float calm = 0;
  float calm_px = 0.5f;
  int start = 0;
  int max_gap = 2;
  bool confidence = true;
  bool backward = true;
  float store = 8;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("enabled", self.enabled, "supervise the motion with optical flow");
    field("weight", self.weight, "of the flow loss beside the image loss (the paper: 0.5)",
          at_least(0));
    field("source", self.source,
          "dis: computed from the pictures; files: read from the folder; tracks: of points only");
    field("folder", self.folder,
          "flow files <camera>/<step>.flo, .flo.gz, .png, .npy, or <picture>.flo ...; empty: the "
          "scene's own true flow");
    field(
        "pairs", self.pairs,
        "which pictures are compared: track, neighbours from one camera, at rest or moving; time, "
        "each and the next in time, whoever took it (source files)");
    field("reach", self.reach,
          "longest flow [pictures]: 1, between neighbours; 8, also over 2, 4 and 8; 0: up to the "
          "whole track",
          at_least(0));
    field(
        "far", self.far,
        "flow over several pictures: chain, of that between neighbours; direct, computed; tracks");
    field("far_share", self.far_share,
          "share of the steps with flow that compare pictures further apart", between(0, 1));
    field("tracks", self.tracks,
          "paths of points: a folder with <camera>.npz, or the one file; optim/scene/README.md");
    field("transport", self.transport, "how a pixel moves with a Gaussian");
    field("top_k", self.top_k,
          "Gaussians that count for the flow of a pixel, in depth order; 0: all", at_least(0));
    field("stop", self.stop, "whether the Gaussian that makes a pixel opaque still counts");
    field("detach_t1", self.detach_t1,
          "let the flow loss move the Gaussians at the later time only");
    field("detach_weights", self.detach_weights,
          "let the flow loss change how Gaussians move, not what they cover");
    field("robust_px", self.robust_px,
          "knee of the robust norm: quadratic below, linear above [px]", above(0));
    field("every", self.every,
          "the flow loss counts in every n-th step only, n times as much; 0: 2 for spacetime and "
          "native4d, else 1",
          at_least(0));
    field(
        "calm", self.calm,
        "probability with which a tile of 16x16 pixels where the flow to learn is 0 counts in a "
        "step, then 1/probability times as much; 1: all tiles in every step; 0: 0.1 for spacetime "
        "and native4d, else 1",
        between(0, 1));
    field("calm_px", self.calm_px,
          "flow (times its confidence) from which a tile counts in every step; below, the "
          "probability is in proportion, at least flow.calm [px]",
          above(0));
    field("start", self.start, "first step with the flow loss", at_least(0));
    field("max_gap", self.max_gap, "frames further apart than this are not compared [time steps]",
          at_least(1));
    field("confidence", self.confidence, "drop flow that fails the forward-backward check");
    field("backward", self.backward, "also compare with the frame before (source dis)");
    field("store", self.store,
          "room on disk for computed flow [GiB]; where all would fit, at a byte a pixel, it is "
          "computed beforehand, else when needed, and what was unused for longest is dropped",
          at_least(0));
  }
};

struct GuidanceConfig {
  GuidanceProvider provider = GuidanceProvider::none;
  std::string command;
  std::string model;
  std::string pictures;
  float time_out = 300;
  float weight = 0.1f;
  float flow = 0;
  int every = 1;
  int start = 0;
  int stop = 0;
  int views = 1;
  GuidanceCameras cameras = GuidanceCameras::orbit;
  float azimuth = 180;
  float elevation = 0;
  UpAxis up = UpAxis::automatic;
  int size = 0;
  float scale = 1;
  float t_min = 0.02f;
  float t_max = 0.98f;
  float t_max_final = 0.02f;
  float variance = 1e-3f;
  NoiseKind schedule = NoiseKind::scaled_linear;
  int timesteps = 1000;
  float beta_start = 0.00085f;
  float beta_end = 0.012f;

  bool enabled() const { return provider != GuidanceProvider::none; }

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("provider", self.provider,
          "who judges views nobody filmed: process, a program (command); onnx, a denoiser (model); "
          "analytic, pictures of a folder (pictures)");
    field("command", self.command, "process: what the shell starts; apps/guidance/README.md");
    field("model", self.model, "onnx: the network's file; optim/guidance/README.md");
    field("pictures", self.pictures,
          "analytic: a folder CAMERA/ for each known view, flow/CAMERA/, or pictures of any view; "
          "empty: the scene's");
    field("time_out", self.time_out, "process: longest wait for its start and each answer [s]",
          above_up_to(0, 1e6f));
    field("weight", self.weight,
          "of the mean over the pixels of what it says, beside the image loss", at_least(0));
    field("flow", self.flow, "weight of the flow it wants these views to show; 0: not asked for",
          at_least(0));
    field("every", self.every, "steps between two with guidance", at_least(1));
    field("start", self.start, "first step with guidance", at_least(0));
    field("stop", self.stop, "first step without it again; 0: up to the end", at_least(0));
    field("views", self.views, "views in such a step; the weights are for their mean",
          between(1, 64));
    field("cameras", self.cameras,
          "orbit: the training camera turned about what it looks at; test, val: those of that "
          "split, to try a provider that knows them");
    field("azimuth", self.azimuth, "orbit: drawn evenly, at most so far to either side [degrees]",
          between(0, 180));
    field("elevation", self.elevation, "orbit: drawn evenly, at most so far up or down [degrees]",
          between(0, 90));
    field("up", self.up,
          "orbit: what it turns about; auto: z where the layout says so (Consistent4D, video, "
          "D-NeRF, Blender), else cameras, their mean");
    field("size", self.size,
          "side of its square pictures, into which the training camera's fits [px]; 0: as those of "
          "the training",
          between(0, 4096));
    field("scale", self.scale,
          "onnx, analytic: s of noise = without + s (with - without the condition)", at_least(0));
    field("t_min", self.t_min, "least noise that is added [share of the timesteps]", between(0, 1));
    field("t_max", self.t_max, "most, at the first step with guidance; it falls evenly",
          between(0, 1));
    field("t_max_final", self.t_max_final, "to this, at the last", between(0, 1));
    field("variance", self.variance, "analytic: of a known picture's values, which go from -1 to 1",
          at_least(0));
    field("schedule", self.schedule, "onnx, analytic: how the noise grows with the timestep");
    field("timesteps", self.timesteps, "onnx, analytic: how many there are", between(2, 100000));
    field("beta_start", self.beta_start, "onnx, analytic: variance added at the first",
          above_up_to(0, 0.999f));
    field("beta_end", self.beta_end, "onnx, analytic: at the last, no less",
          above_up_to(0, 0.999f));
  }
};

struct LearningRates {
  float means = 6e-4f;
  float means_final = 6e-6f;
  float mean_t = 1.6e-4f;
  float sh = 2.5e-3f;
  float sh_rest_divisor = 20;
  float opacity = 0.05f;
  float scales = 5e-3f;
  float quats = 1e-3f;
  float quats_final = 1e-4f;
  float weights = 1e-2f;
  float motion = 1;
  float planes = 4e-3f;
  float planes_final = 4e-4f;
  float network = 8e-4f;
  float network_final = 8e-5f;
  float fade = 0.3f;
  float pace = 1;
  float pace_most = 8;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("means", self.means, "at the first step [x scene extent]", at_least(0));
    field("means_final", self.means_final,
          "at the last step, reached exponentially [x scene extent]", above(0));
    field("mean_t", self.mean_t, "position in time", at_least(0));
    field("sh", self.sh, "colour, degree 0", at_least(0));
    field("sh_rest_divisor", self.sh_rest_divisor, "degrees above 0 learn this much slower",
          at_least(1));
    field("opacity", self.opacity, "before the sigmoid", at_least(0));
    field("scales", self.scales, "logarithm of the size in space and time", at_least(0));
    field("quats", self.quats, "rotation (native4d: both quaternions), at the first step",
          at_least(0));
    field("quats_final", self.quats_final, "at the last step, reached exponentially", above(0));
    field("weights", self.weights, "how much a Gaussian follows each basis, before the softmax",
          at_least(0));
    field("motion", self.motion,
          "velocities, accelerations and turns: at the ends of its life a Gaussian moves so many "
          "times what it does in its middle",
          at_least(0));
    field("planes", self.planes, "hexplane's planes, at the first step", at_least(0));
    field("planes_final", self.planes_final, "at the last step, reached exponentially", above(0));
    field("network", self.network, "hexplane's network, at the first step", at_least(0));
    field("network_final", self.network_final, "at the last step, reached exponentially", above(0));
    field(
        "fade", self.fade,
        "rates without one for the last step fall over the second half, exponentially, to this [x "
        "that before]",
        above_up_to(0, 1));
    field("pace", self.pace,
          "rates grow with (length of the video / time a Gaussian is seen) to this power; 0: not",
          between(0, 1));
    field("pace_most", self.pace_most, "but at most so many times", between(1, PaceRule::kMost));
  }
};

// The epsilons bound the step on noise: well below a group's usual gradient, far above its rounding
// errors. Median rms of the gradients on n3v-baton: means 1e-5, velocities 3e-5, means_t 5e-8,
// rotations 2e-7, scales 3e-7, opacities 6e-7, colour 8e-7. 1e-3 of each instead of 1e-8 changed
// PSNR and flow error by less than 0.1 dB and 0.002 px; the larger one is the steadier. Of
// hexplane's planes 1.5e-7 (root mean square 2e-5), of its network 4e-5 (1e-2): the smallest that
// T33 allows.
struct AdamGroups {
  // The root of the smallest float that is not flushed to 0: below it a gradient whose square is
  // none moves its parameter by more than the rate, up to no number at all.
  static constexpr float kLeastEpsilon = 1.1e-19f;
  float beta1 = 0;
  float beta1_paths = 0.9f;
  float beta2 = 0.999f;
  float eps_means = 1e-8f;
  float eps_sh = 1e-8f;
  float eps_opacity = 1e-8f;
  float eps_scales = 1e-8f;
  float eps_quats = 1e-8f;
  float eps_planes = 1e-10f;
  float eps_network = 1e-7f;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field(
        "beta1", self.beta1,
        "memory of the mean gradient; above 0, what no picture shows rests in place of gliding on",
        between(0, 0.9994f));
    field("beta1_paths", self.beta1_paths,
          "the same of keys, bases, planes and networks, of which a step that shows none never was",
          between(0, 0.9994f));
    field("beta2", self.beta2, "memory of its square", between(0, 0.9994f));
    field("eps_means", self.eps_means, "in space and time", at_least(kLeastEpsilon));
    field("eps_sh", self.eps_sh, "colour", at_least(kLeastEpsilon));
    field("eps_opacity", self.eps_opacity, "opacity", at_least(kLeastEpsilon));
    field("eps_scales", self.eps_scales, "in space and time", at_least(kLeastEpsilon));
    field("eps_quats", self.eps_quats, "rotation", at_least(kLeastEpsilon));
    field("eps_planes", self.eps_planes, "planes of hexplane", at_least(kLeastEpsilon));
    field("eps_network", self.eps_network, "network of hexplane", at_least(kLeastEpsilon));
  }
};

struct DensityConfig {
  bool enabled = true;
  DensityKind strategy = DensityKind::adc;
  int start = 500;
  float stop_fraction = 0.5f;
  int every = 100;
  int cap = 30000;
  int memory = 0;
  float prune_opacity = 0.02f;
  float grad_threshold = 2e-4f;
  bool absgrad = false;
  float split_scale = 0.01f;
  float split_travel = 1;
  float min_lifetime = 1;
  float prune_scale = 0.5f;
  int opacity_reset_every = 0;
  float growth = 0.05f;
  float spread = 0.5f;
  float noise = 1e5f;
  float opacity_weight = 0.01f;
  float scale_weight = 0.01f;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("enabled", self.enabled, "add, move and remove Gaussians");
    field("strategy", self.strategy,
          "adc: clone, split and prune by gradients; mcmc: move the faintest to where others are, "
          "with noise");
    field("start", self.start, "first step", at_least(0));
    field("stop_fraction", self.stop_fraction, "last step, as a share of train.iterations",
          between(0, 1));
    field("every", self.every, "steps between two rounds", at_least(1));
    field("cap", self.cap, "most Gaussians", at_least(1));
    field("memory", self.memory,
          "Gaussians stop growing in number before they need more [MiB]; 0: three quarters of the "
          "device's memory",
          at_least(0));
    field("prune_opacity", self.prune_opacity, "fainter Gaussians are removed (mcmc: moved)",
          above_up_to(0, 0.99f));
    field("grad_threshold", self.grad_threshold,
          "adc: grow where the mean gradient of the image position exceeds this "
          "[1 / half the image]",
          at_least(0));
    field("absgrad", self.absgrad,
          "adc: add up each pixel's gradient without its direction, so that pixels do not cancel; "
          "wants a higher grad_threshold");
    field("split_scale", self.split_scale,
          "adc: larger Gaussians split, smaller ones clone [x scene extent]", above(0));
    field("split_travel", self.split_travel,
          "adc: a Gaussian that moves further than this splits in time [x its size]", above(0));
    field("min_lifetime", self.min_lifetime,
          "adc: shortest temporal scale a split makes [time steps]", above(0));
    field("prune_scale", self.prune_scale, "adc: larger Gaussians are removed [x scene extent]",
          above(0));
    field("opacity_reset_every", self.opacity_reset_every,
          "adc: steps between two times that no opacity may exceed 2 x prune_opacity; 0: never",
          at_least(0));
    field("growth", self.growth, "mcmc: share of their number that is added in a round",
          at_least(0));
    field("spread", self.spread,
          "mcmc: how far those that come to one place are moved apart [x its size]", at_least(0));
    field(
        "noise", self.noise,
        "mcmc: of the positions that a step sees [x their learning rate x covariance, in extents]",
        at_least(0));
    field("opacity_weight", self.opacity_weight, "mcmc: of the mean opacity beside the image loss",
          at_least(0));
    field("scale_weight", self.scale_weight,
          "mcmc: of the mean size beside the image loss [1 / scene extent]", at_least(0));
  }
};

struct RenderConfig {
  float near = 0.05f;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("near", self.near, "Gaussians closer to the camera are skipped [scene units]", above(0));
  }
};

// Changes nothing that is trained.
struct MetricsConfig {
  std::string lpips;
  std::string clip;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("lpips", self.lpips,
          "LPIPS network that judges views, .onnx; empty: none; apps/metrics/README.md");
    field("clip", self.clip, "image encoder of CLIP that judges views, .onnx; empty: none");
  }
};

struct TrainConfig {
  SceneConfig scene;
  ScheduleConfig train;
  MotionConfig motion;
  HexplaneConfig hexplane;
  InitConfig init;
  LossConfig loss;
  FlowConfig flow;
  GuidanceConfig guidance;
  LearningRates lr;
  AdamGroups adam;
  DensityConfig density;
  RenderConfig render;
  MetricsConfig metrics;
  Skips skip;
  // Of the engine's kernels, in place of theirs; no setting: `gflow bench pareto` tries them.
  std::vector<std::pair<std::string, std::string>> defines;

  // Calls section(name, part, help) for each section of the file.
  template <class Self, class Section>
  static void sections(Self& self, Section&& section) {
    section("scene", self.scene, "what is read");
    section("train", self.train, "how long, on what");
    section("motion", self.motion, "the Gaussians in time");
    section("hexplane", self.hexplane, "the field of motion.model = hexplane");
    section("init", self.init, "the first Gaussians");
    section("loss", self.loss, "pictures, and motion among neighbours");
    section("flow", self.flow, "optical flow");
    section("guidance", self.guidance, "views nobody filmed");
    section("lr", self.lr, "learning rates");
    section("adam", self.adam, "the optimiser");
    section("density", self.density, "how many Gaussians, where");
    section("render", self.render, "the image");
    section("metrics", self.metrics, "networks that judge the result; free to change");
    section("skip", self.skip,
            "work that is left out (to measure what it saves: gflow bench skip)");
  }
};

// What the engine needs to know.
EngineSettings engine_settings(const TrainConfig& config);

// The functions below throw Error: an unknown setting is named with the nearest known one, a wrong
// type or value with what is allowed, and each message starts with the file and line or the option
// it comes from.

// Changes the settings that a TOML file gives.
void apply_file(TrainConfig& config, const std::string& path);
// The same for TOML text, called `name` in errors.
void apply_text(TrainConfig& config, const std::string& text, const std::string& name);
// Changes one setting: "section.key=value". Text needs no quotes.
void apply_setting(TrainConfig& config, const std::string& assignment);
// Checks every value against its range; needed after members were set by hand.
void check(const TrainConfig& config);
// The whole configuration as TOML with a comment a line; reading it back gives the same values.
std::string to_toml(const TrainConfig& config);
// One setting in words: its value as TOML, what it means with its unit, and what it may be ("": any
// text).
struct SettingInWords {
  std::string name, value, meaning, allowed;  // name: "section.key"
};
// All, in the order of the file.
std::vector<SettingInWords> settings_in_words(const TrainConfig& config);
// Every setting as "section.key" and its value as TOML.
std::map<std::string, std::string> setting_values(const TrainConfig& config);

}  // namespace gflow
