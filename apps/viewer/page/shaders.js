// SPDX-License-Identifier: Apache-2.0
// The shaders: the formulas of kernels/shared (motion/*.h, quat.h, projection.h, sh.h, transport.h,
// pixel.h) in GLSL, with the same names. Matrices are three rows.
import { texelsPerKey, texelsPerRow } from './packing.js';

export const textureWidth = 4096;  // texels per row of a parameter texture; a power of two
export const keyLayers = 8;        // keys on the device at once
const transports = ['material', 'translate', 'paper', 'ot'];
const motionNumbers = { static: 0, spacetime: 1, native4d: 2, keyframes: 3, poses: 4 };
// What a picture shows. `depth` and `flow` are sums of values, the others of colours.
export const modeNumbers = { color: 0, opacity: 1, depth: 2, flow: 3, motion: 4, ellipsoids: 5, points: 6 };

function definesOf(model, mode) {
  const numbers = {
    MOTION: motionNumbers[model.motion], MODE: modeNumbers[mode], DEGREE: model.sh_degree,
    ROW_TEXELS: texelsPerRow(model), KEYS: model.keyCount > 0 ? 1 : 0, KEY_TEXELS: texelsPerKey(model),
    KEY_OPACITIES: model.arrays.pose_opacities ? 1 : 0, CUBIC: model.arrays.cubics ? 1 : 0,
    WINDOWS: model.arrays.windows ? 1 : 0, WIDTH_BITS: Math.log2(textureWidth), LAYERS: keyLayers,
    TRANSPORT: Math.max(transports.indexOf(model.transport), 0),
  };
  return Object.entries(numbers).map(([name, value]) => `#define ${name} ${value}\n`).join('');
}

const common = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
#define ALPHA_MIN_LOG2 -7.99435344
#define ALPHA_MAX 0.99
#define FOV_MARGIN 0.3
#define HALF_LOG2_E 0.721347520
#define SQRT_HALF_LOG2_E 0.849321800
`;

// Colour from spherical harmonics: 3 floats per coefficient, four floats per texel.
function shSum(degree) {
  const count = (degree + 1) ** 2, lines = [];
  for (let q = 0; 4 * q < 3 * count; ++q) {
    lines.push(`s = shTexel(i, ${q});`);
    for (let lane = 0; lane < 4 && 4 * q + lane < 3 * count; ++lane) {
      const j = 4 * q + lane;
      lines.push(`c.${'xyz'[j % 3]} += s.${'xyzw'[lane]} * y[${Math.floor(j / 3)}];`);
    }
  }
  return lines.join('\n  ');
}
export function shTexels(degree) { return Math.ceil(3 * (degree + 1) ** 2 / 4); }

// What the pass that poses Gaussians writes for each, and the pass that draws them reads, a texel each:
// mean, k1, k2 | k3, log2 opacity, half axis of the ellipse | value, half width | flow's H.
export function posedOutputs(mode) {
  return mode === 'flow' ? ['splat', 'splat2', 'value', 'transportH'] : ['splat', 'splat2', 'value'];
}

// Poses and projects one Gaussian per vertex.
export function poseShader(model, mode) {
  return `${common}${definesOf(model, mode)}
in uint row;
uniform sampler2D rowTexture, shTexture;
uniform sampler2DArray keyTexture;
uniform int moving, show;       // show: 0 all, 1 moving, 2 static Gaussians
uniform float sigmas;
uniform vec2 times;             // now, and one time step later
uniform ivec2 keyFirst, keyCount;
uniform vec4 keyWeight[2];
uniform vec3 rotation[3];       // world to camera
uniform vec3 translation, eye;
uniform vec4 intrinsics;        // fx fy cx cy
uniform vec2 size;              // [px]
uniform float near, dilation, pointRadius, movesFrom;
uniform float minOpacity;       // Gaussians that never have it are left out
uniform float maxSize;          // the same for those with a longer axis
out vec4 splat, splat2, value, transportH;  // posedOutputs(); not drawn where value.w is 0

vec4 rowTexel(int i, int k) {
  int at = i * ROW_TEXELS + k;
  return texelFetch(rowTexture, ivec2(at & ((1 << WIDTH_BITS) - 1), at >> WIDTH_BITS), 0);
}
vec4 shTexel(int i, int k) {
  int at = i * ${shTexels(model.sh_degree)} + k;
  return texelFetch(shTexture, ivec2(at & ((1 << WIDTH_BITS) - 1), at >> WIDTH_BITS), 0);
}
vec4 keyTexel(int key, int i, int k) {
  int at = i * KEY_TEXELS + k;
  return texelFetch(keyTexture, ivec3(at & ((1 << WIDTH_BITS) - 1), at >> WIDTH_BITS, key % LAYERS), 0);
}

struct Rows3 { vec3 r1, r2, r3; };
struct Pose { vec3 mean; Rows3 factor; float opacity; };

vec4 unitQuat(vec4 q) {
  float largest = max(max(abs(q.x), abs(q.y)), max(abs(q.z), abs(q.w)));
  return largest > 1e-6 && largest < 1e30 ? normalize(q / largest) : vec4(1, 0, 0, 0);
}
// The factor R(q) diag(s) of a covariance.
Rows3 factorOf(vec4 quat, vec3 s) {
  vec4 q = unitQuat(quat);
  float w = q.x, x = q.y, y = q.z, z = q.w;
  return Rows3(vec3(1. - 2. * (y * y + z * z), 2. * (x * y - w * z), 2. * (x * z + w * y)) * s,
               vec3(2. * (x * y + w * z), 1. - 2. * (x * x + z * z), 2. * (y * z - w * x)) * s,
               vec3(2. * (x * z - w * y), 2. * (y * z + w * x), 1. - 2. * (x * x + y * y)) * s);
}
float sigmoid(float x) { return 1. / (1. + exp(-x)); }
float lifeOpacity(float logit, float dt, float variance) { return exp(-.5 * dt * dt / variance) * sigmoid(logit); }

vec4 quatMul(vec4 a, vec4 b) {
  return vec4(a.x * b.x - a.y * b.y - a.z * b.z - a.w * b.w, a.x * b.y + a.y * b.x + a.z * b.w - a.w * b.z,
              a.x * b.z - a.y * b.w + a.z * b.x + a.w * b.y, a.x * b.w + a.y * b.z - a.z * b.y + a.w * b.x);
}

// The pose of Gaussian i at times[which]; opacity 0 outside its time window.
Pose poseAt(int i, int which) {
  Pose o;
  float t = times[which];
  vec4 base = rowTexel(i, 0), quat = rowTexel(i, 1), logScales = rowTexel(i, 2);
#if MOTION == 0
  o.mean = base.xyz;
  o.factor = factorOf(quat, exp(logScales.xyz));
  o.opacity = sigmoid(base.w);
#elif MOTION == 1
  vec4 v = rowTexel(i, 3), c = rowTexel(i, 4), turn = rowTexel(i, 5);
  float tau = t - v.w;
  vec3 s = exp(logScales.xyz), bend = c.xyz;
  float life = exp(logScales.w);
#if CUBIC
  bend += rowTexel(i, 6).xyz * tau;
#endif
  o.mean = base.xyz + (v.xyz + bend * tau) * tau;
  o.factor = factorOf(quat + turn * tau, s);
  o.opacity = abs(tau) < sigmas * life ? lifeOpacity(base.w, tau, life * life) : 0.;
#elif MOTION == 2
  float dt = t - rowTexel(i, 3).w;
  vec4 s = exp(logScales), ql = unitQuat(quat), r = unitQuat(rowTexel(i, 4)) * vec4(1, -1, -1, -1);
  vec4 fx = quatMul(quatMul(ql, vec4(0, 1, 0, 0)), r) * s.x, fy = quatMul(quatMul(ql, vec4(0, 0, 1, 0)), r) * s.y;
  vec4 fz = quatMul(quatMul(ql, vec4(0, 0, 0, 1)), r) * s.z, ft = quatMul(ql, r) * s.w;
  vec4 pt = vec4(fx.x, fy.x, fz.x, ft.x), px = vec4(fx.y, fy.y, fz.y, ft.y);
  vec4 py = vec4(fx.z, fy.z, fz.z, ft.z), pz = vec4(fx.w, fy.w, fz.w, ft.w);
  float variance = dot(pt, pt);
  vec3 velocity = vec3(dot(px, pt), dot(py, pt), dot(pz, pt)) / variance;
  o.mean = base.xyz + velocity * dt;
  // The reflection that takes p_t to the time axis.
  vec4 u = pt / sqrt(variance);
  float side = u.w < 0. ? -1. : 1., beta = 1. / (1. + abs(u.w));
  o.factor.r1 = px.xyz - (dot(px, u) + side * px.w) * beta * u.xyz;
  o.factor.r2 = py.xyz - (dot(py, u) + side * py.w) * beta * u.xyz;
  o.factor.r3 = pz.xyz - (dot(pz, u) + side * pz.w) * beta * u.xyz;
  o.opacity = abs(dt) < sigmas * sqrt(variance) ? lifeOpacity(base.w, dt, variance) : 0.;
#else
  vec3 shift = vec3(0), scaleShift = vec3(0);
  vec4 turn = vec4(0);
  float keyOpacity = 0.;
  if (i < moving)
    for (int k = 0; k < keyCount[which]; ++k) {
      int key = keyFirst[which] + k;
      float w = keyWeight[which][k];
      vec4 a = keyTexel(key, i, 0);
      shift += a.xyz * w;
      keyOpacity += a.w * w;
      turn += keyTexel(key, i, 1) * w;
#if KEY_TEXELS == 3
      scaleShift += keyTexel(key, i, 2).xyz * w;
#endif
    }
  float dt = t - rowTexel(i, 3).w, life = exp(min(logScales.w, 40.));
  o.opacity = abs(dt) < sigmas * life ? lifeOpacity(base.w, dt, life * life) : 0.;
#if MOTION == 3
  o.mean = base.xyz + shift;
  o.factor = factorOf(quat + turn, exp(logScales.xyz + scaleShift));
#else
  bool moves = i < moving;
  o.mean = moves ? shift : base.xyz;
  o.factor = factorOf(moves ? turn : quat, exp(moves && KEY_TEXELS == 3 ? scaleShift : logScales.xyz));
  if (moves && KEY_OPACITIES == 1) o.opacity = keyOpacity;
#endif
#endif
#if WINDOWS
  vec4 window = rowTexel(i, ROW_TEXELS - 1);
  if (!(t >= window.x && t < window.y)) o.opacity = 0.;
#endif
  return o;
}

struct Projection { vec3 p; vec2 mean; vec3 m1, m2; };
Projection project(vec3 mean, Rows3 factor) {
  Projection o;
  o.p = vec3(dot(rotation[0], mean), dot(rotation[1], mean), dot(rotation[2], mean)) + translation;
  float inverse = 1. / o.p.z;
  vec2 xy = o.p.xy * inverse, f = intrinsics.xy, c = intrinsics.zw, margin = FOV_MARGIN * .5 * size / f;
  o.mean = f * xy + c;
  vec2 uv = clamp(xy, -(c / f + margin), (size - c) / f + margin);
  vec3 w1 = (rotation[0] - rotation[2] * uv.x) * (f.x * inverse);
  vec3 w2 = (rotation[1] - rotation[2] * uv.y) * (f.y * inverse);
  o.m1 = w1.x * factor.r1 + w1.y * factor.r2 + w1.z * factor.r3;
  o.m2 = w2.x * factor.r1 + w2.y * factor.r2 + w2.z * factor.r3;
  return o;
}

#if TRANSPORT > 1
// H of transport.h for the maps paper and ot, from differences, so that nothing cancels for small motion.
mat2 adjugate(mat2 s) { return mat2(s[1][1], -s[0][1], -s[1][0], s[0][0]); }
float trace(mat2 s) { return s[0][0] + s[1][1]; }
float inner(mat2 x, mat2 y) { return x[0][0] * y[0][0] + 2. * x[0][1] * y[0][1] + x[1][1] * y[1][1]; }
mat2 symmetric(float a, float b, float c) { return mat2(a, b, b, c); }
mat2 covariance(Projection o) { return symmetric(dot(o.m1, o.m1) + dilation, dot(o.m1, o.m2), dot(o.m2, o.m2) + dilation); }
float determinantOf(Projection o) {
  vec3 minors = cross(o.m1, o.m2);
  return dot(minors, minors) + dilation * (dot(o.m1, o.m1) + dot(o.m2, o.m2) + dilation);
}
mat2 transport(Projection o, Projection o2) {
  vec3 e1 = o2.m1 - o.m1, e2 = o2.m2 - o.m2, sum1 = o.m1 + o2.m1, sum2 = o.m2 + o2.m2;
  mat2 S = covariance(o), S2 = covariance(o2), change = symmetric(dot(e1, sum1), .5 * (dot(e1, sum2) + dot(e2, sum1)), dot(e2, sum2));
  float s = sqrt(determinantOf(o)), s2 = sqrt(determinantOf(o2));  // determinants of the square roots
#if TRANSPORT == 2
  // B2 - B, the X with M X + X M = change for the mean M of the roots; then inv(B) U, a rotation.
  mat2 M = .5 * ((S + mat2(s)) / sqrt(trace(S) + 2. * s) + (S2 + mat2(s2)) / sqrt(trace(S2) + 2. * s2));
  float det = M[0][0] * M[1][1] - M[0][1] * M[0][1];
  mat2 X = (change * det + adjugate(M) * change * adjugate(M)) / (2. * trace(M) * det);
  vec2 q = normalize(vec2(S[1][1] + s, -S[0][1]));
  return X * mat2(q.x, q.y, -q.y, q.x);
#else
  vec3 minors = cross(o.m1, o.m2) + cross(o2.m1, o2.m2), minorsChange = cross(e1, o2.m2) + cross(o.m1, e2);
  float sChange = (dot(minorsChange, minors) + dilation * trace(change)) / (s + s2), rChange = sChange / s;
  float n = sqrt(inner(S, S2) + 2. * s * s2), nChange = (inner(S, change) + 2. * s * sChange) / (n + trace(S));
  float u3 = sqrt(S[1][1]);
  return (change - rChange * S + mat2(rChange * trace(S) - nChange)) / n * mat2(s / u3, 0, S[0][1] / u3, u3);
#endif
}
#endif

vec3 colorOf(int i, vec3 mean) {
  vec3 v = mean - eye;
  float squared = dot(v, v);
  vec3 d = squared > 0. ? v * inversesqrt(squared) : vec3(0);
  float x = d.x, yy_ = d.y, z = d.z, xx = x * x, yy = d.y * d.y, zz = z * z;
  float y[16];
  y[0] = 0.28209479177387814;
#if DEGREE > 0
  y[1] = -0.4886025119029199 * yy_; y[2] = 0.4886025119029199 * z; y[3] = -0.4886025119029199 * x;
#endif
#if DEGREE > 1
  y[4] = 1.0925484305920792 * x * yy_; y[5] = -1.0925484305920792 * yy_ * z;
  y[6] = 0.31539156525252005 * (2. * zz - xx - yy); y[7] = -1.0925484305920792 * x * z;
  y[8] = 0.5462742152960396 * (xx - yy);
#endif
#if DEGREE > 2
  y[9] = -0.5900435899266435 * yy_ * (3. * xx - yy); y[10] = 2.890611442640554 * x * yy_ * z;
  y[11] = -0.4570457994644658 * yy_ * (4. * zz - xx - yy); y[12] = 0.3731763325901154 * z * (2. * zz - 3. * xx - 3. * yy);
  y[13] = -0.4570457994644658 * x * (4. * zz - xx - yy); y[14] = 1.445305721320277 * z * (xx - yy);
  y[15] = -0.5900435899266435 * x * (xx - 3. * yy);
#endif
  vec3 c = vec3(.5);
  vec4 s;
  ${shSum(model.sh_degree)}
  return max(c, vec3(0));
}

void main() {
  gl_Position = vec4(0);
  splat = splat2 = value = transportH = vec4(0);
  int i = int(row);
  Pose pose = poseAt(i, 0);
  float log2Opacity = log2(pose.opacity);
  if (!(log2Opacity >= ALPHA_MIN_LOG2)) return;  // NaN fails
  Projection o = project(pose.mean, pose.factor);
  if (!(o.p.z >= near)) return;
  Rows3 L = pose.factor;
  float longest = sqrt(max(dot(L.r1, L.r1), max(dot(L.r2, L.r2), dot(L.r3, L.r3))));
  float peak = KEY_OPACITIES == 1 && i < moving ? pose.opacity : sigmoid(rowTexel(i, 0).w);
  if (peak < minOpacity || longest > maxSize) return;

  // Covariance, its determinant from the minors of M, and K with K^T K = inv(S).
  float a = dot(o.m1, o.m1) + dilation, b = dot(o.m1, o.m2), c = dot(o.m2, o.m2) + dilation;
  vec3 minors = cross(o.m1, o.m2);
  float det = dot(minors, minors) + dilation * (a + c - dilation);
  float k1 = sqrt(c / det), k3 = inversesqrt(c), k2 = -(b / c) * k1;
  float sum = o.mean.x + o.mean.y + o.p.z + k1 + k2 + k3 + log2Opacity + det;
  if (!(abs(sum) < 1e37)) return;

  bool moves = false;
  float speed = 0.;
  if (show != 0 || MODE == 3 || MODE == 4) {
    if (i < moving && MOTION != 0) {
      Pose later = poseAt(i, 1);
      speed = distance(pose.mean, later.mean);
      moves = speed > movesFrom;
#if MODE == 3
      Projection o2 = project(later.mean, later.factor);
      if (o2.p.z >= near) {
        value.xy = o2.mean - o.mean;
#if TRANSPORT == 0
        vec3 e1 = o2.m1 - o.m1, e2 = o2.m2 - o.m2;
        vec3 w1 = (cross(o.m2, minors) + o.m1 * dilation) * (k1 / c), w2 = o.m2 * k3;
        transportH = vec4(dot(e1, w1), dot(e1, w2), dot(e2, w1), dot(e2, w2)) / SQRT_HALF_LOG2_E;
#elif TRANSPORT > 1
        mat2 H = transport(o, o2);
        transportH = vec4(H[0][0], H[1][0], H[0][1], H[1][1]) / SQRT_HALF_LOG2_E;
#endif
        if (!(abs(dot(value, vec4(1)) + dot(transportH, vec4(1))) < 1e37)) value = transportH = vec4(0);
      }
#endif
    }
    if (show != 0 && moves != (show == 1)) return;
  }
#if MODE == 0 || MODE >= 4
  value.rgb = colorOf(i, pose.mean);
  if (!(abs(value.r + value.g + value.b) < 1e37)) return;
#endif
#if MODE == 2
  value.r = o.p.z;
#endif
#if MODE == 4
  float shade = dot(value.rgb, vec3(.299, .587, .114));
  value.rgb = mix(vec3(shade * .55 + .05), mix(vec3(.25, .5, .9), vec3(1., .62, .2), smoothstep(0., 8. * movesFrom, speed)) * (.35 + .8 * shade),
                  smoothstep(.5 * movesFrom, 1.5 * movesFrom, speed));
#endif
  splat = vec4(o.mean, vec2(k1, k2) * SQRT_HALF_LOG2_E);

  // A rectangle along the axes of the ellipse alpha >= 1/255, with a margin for rounding.
  float reach = (log2Opacity - ALPHA_MIN_LOG2 + 1e-3) / HALF_LOG2_E;
#if MODE == 5
  reach = min(reach, 2.25);
#endif
  float middle = .5 * (a + c), radius = length(vec2(.5 * (a - c), b));
  vec2 axis = abs(b) > 1e-6 * middle ? normalize(vec2(b, middle + radius - a)) : a >= c ? vec2(1, 0) : vec2(0, 1);
  vec2 lengths = sqrt(reach * vec2(middle + radius, max(middle - radius, dilation))) + .02;
#if MODE == 6
  axis = vec2(1, 0);
  lengths = vec2(pointRadius);
#endif
  splat2 = vec4(k3 * SQRT_HALF_LOG2_E, log2Opacity, axis * lengths.x);
  value.w = lengths.y;
}`;
}
export const noFragments = `#version 300 es
void main() {}`;

// Places the corners of one Gaussian's rectangle.
export function vertexShader(model, mode) {
  return `${common}${definesOf(model, mode)}
uniform sampler2D posedTexture;
uniform vec2 size;              // [px]
flat out vec4 splat, value, transportH;
flat out vec2 splat2;
vec4 posedTexel(int k) {
  int at = (gl_VertexID >> 2) * (MODE == 3 ? 4 : 3) + k;
  return texelFetch(posedTexture, ivec2(at & ((1 << WIDTH_BITS) - 1), at >> WIDTH_BITS), 0);
}
void main() {
  splat = posedTexel(0);
  vec4 more = posedTexel(1);
  value = posedTexel(2);
  splat2 = more.xy;
#if MODE == 3
  transportH = posedTexel(3);
#endif
#if MODE == 6
  splat2.x = value.w;
#endif
  vec2 corner = vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1) * 2. - 1., axis = more.zw;
  vec2 at = splat.xy + corner.x * axis + corner.y * value.w * normalize(vec2(-axis.y, axis.x));
  gl_Position = value.w > 0. ? vec4(at.x / size.x * 2. - 1., 1. - at.y / size.y * 2., 0, 1) : vec4(2, 2, 2, 1);
}`;
}

export function fragmentShader(model, mode) {
  return `${common}${definesOf(model, mode)}
flat in vec4 splat, value, transportH;
flat in vec2 splat2;
uniform vec2 size;
out vec4 result;
void main() {
  vec2 d = vec2(gl_FragCoord.x, size.y - gl_FragCoord.y) - splat.xy;
#if MODE == 6
  float inside = splat2.x - length(d);
  if (inside <= 0.) discard;
  result = vec4(value.rgb, 1) * min(inside, 1.);
#else
  vec2 z = vec2(splat.z * d.x + splat.w * d.y, splat2.x * d.y);
  float e = splat2.y - dot(z, z);
  if (!(e >= ALPHA_MIN_LOG2)) discard;
#if MODE == 5
  float q = dot(z, z) / (2.25 * HALF_LOG2_E);
  if (q > 1.) discard;
  result = vec4(value.rgb * (1.05 - .55 * q * q), 1);
#else
  float alpha = min(exp2(e), ALPHA_MAX);
#if MODE == 3
  result = vec4(value.x + dot(transportH.xy, z), value.y + dot(transportH.zw, z), 0, 1) * alpha;
#else
  result = vec4(value.rgb, 1) * alpha;
#endif
#endif
#endif
}`;
}

export const screenVertexShader = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4. - 1., 0, 1); }`;

// From sums to the picture: background, depth and flow as colours. The wheel of hues is that of
// Baker et al. 2011, as in optim/formats/flo.cpp.
export const screenFragmentShader = `${common}
uniform sampler2D sums;
uniform int mode;
uniform vec3 background, wheel[55];
uniform vec2 corner, depthRange;
uniform float longestFlow;
out vec4 result;
vec3 depthColor(float x) {
  vec3 stops[5] = vec3[5](vec3(.99, .91, .68), vec3(.96, .62, .32), vec3(.80, .29, .42), vec3(.42, .16, .52), vec3(.09, .08, .25));
  float at = clamp(x, 0., 1.) * 4.;
  int k = min(int(at), 3);
  return mix(stops[k], stops[k + 1], at - float(k));
}
vec3 flowColor(vec2 flow) {
  float radius = length(flow), at = (atan(-flow.y, -flow.x) / 3.14159265 + 1.) * .5 * 54.;
  int first = clamp(int(at), 0, 54);
  vec3 hue = mix(wheel[first], wheel[(first + 1) % 55], at - float(first));
  return radius <= 1. ? 1. - radius * (1. - hue) : hue * .75;
}
void main() {
  vec4 s = texelFetch(sums, ivec2(gl_FragCoord.xy - corner), 0);
  vec3 c = s.rgb + (1. - s.a) * background;
  if (mode == 1) c = s.aaa;
  if (mode == 2) c = s.a > .004 ? depthColor((s.r / s.a - depthRange.x) / max(depthRange.y - depthRange.x, 1e-6)) : background;
  if (mode == 3) c = s.a > .004 ? flowColor(s.rg / s.a / longestFlow) : vec3(1);
  result = vec4(clamp(c, 0., 1.), 1);
}`;

// The colours of the wheel, [55 x 3].
export function wheelColors() {
  const arcs = [[15, 1, true, [1, 0, 0]], [6, 0, false, [1, 1, 0]], [4, 2, true, [0, 1, 0]], [11, 1, false, [0, 1, 1]],
    [13, 0, true, [0, 0, 1]], [6, 2, false, [1, 0, 1]]];
  const colors = [];
  for (const [steps, channel, rises, from] of arcs)
    for (let i = 0; i < steps; ++i) {
      const color = [...from], part = Math.floor(255 * i / steps) / 255;
      color[channel] = rises ? part : 1 - part;
      colors.push(...color);
    }
  return new Float32Array(colors);
}
