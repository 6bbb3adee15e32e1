// The formulas of docs/reference/rendering.md; one quad per Gaussian, 128 quads per instance.
const BATCH = 128;
// Harmonics that a scene does not have are left out of the program: it compiles and runs faster.
const vertexShader = (harmonicCount) => `#version 300 es
#define HARMONICS ${harmonicCount}
precision highp float; precision highp int;
uniform highp usampler2D order, canonical, harmonics;
uniform highp usampler2DArray keys;
uniform int count, moving, mode;
uniform ivec4 layers; uniform vec4 weights;
uniform ivec2 between; uniform float betweenWeight, offsetStep, logScaleStep, harmonicsStep;
uniform mat3 cameraFromWorld; uniform vec3 position;
uniform vec2 focal, center, size, depthRange; uniform float dilation, near, largestOffset;
uniform vec3 colorLow, colorHigh;
out vec4 color; out vec2 local;

int low16(uint v) { return int(v << 16) >> 16; }
int high16(uint v) { return int(v) >> 16; }
ivec2 place(int index, int perItem, int part) {
  int texel = index * perItem + part;
  return ivec2(texel & 2047, texel >> 11);
}
vec4 quaternion(uint packed) {
  int largest = int(packed >> 30);
  float q[4]; float sum = 0.0;
  for (int i = 0; i < 3; i++) {
    float c = (float((packed >> uint(10 * i)) & 1023u) / 1023.0 * 2.0 - 1.0) * 0.70710678;
    q[i + (i >= largest ? 1 : 0)] = c; sum += c * c;
  }
  q[largest] = sqrt(max(0.0, 1.0 - sum));
  return vec4(q[0], q[1], q[2], q[3]);
}
vec4 slerp(vec4 a, vec4 b, float w) {
  float c = dot(a, b);
  if (c < -1e-4) { b = -b; c = -c; }
  if (c > 1.0 - 1e-6) return normalize(mix(a, b, w));
  float angle = acos(min(c, 1.0));
  return normalize((sin((1.0 - w) * angle) * a + sin(w * angle) * b) / sin(angle));
}
vec4 product(vec4 a, vec4 b) {
  return vec4(a.x * b.x - dot(a.yzw, b.yzw), a.x * b.yzw + b.x * a.yzw + cross(a.yzw, b.yzw));
}
mat3 rotation(vec4 q) {
  float w = q.x, x = q.y, y = q.z, z = q.w;
  return mat3(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
              2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
              2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
}
#if HARMONICS > 0
vec3 harmonic(int index, int i) {
  vec3 c;
  for (int k = 0; k < 3; k++) {
    int at = 3 * i + k;
    uint word = texelFetch(harmonics, place(index, 3, at >> 4), 0)[(at >> 2) & 3];
    c[k] = float(int(word << uint(24 - 8 * (at & 3))) >> 24);
  }
  return c * harmonicsStep;
}
vec3 viewColor(int index, vec3 base, vec3 d) {
  float x = d.x, y = d.y, z = d.z, xx = x * x, yy = y * y, zz = z * z;
  vec3 c = base + 0.48860251 * (-y * harmonic(index, 0) + z * harmonic(index, 1) - x * harmonic(index, 2));
#if HARMONICS >= 8
  c += 1.09254843 * (x * y * harmonic(index, 3) - y * z * harmonic(index, 4) - x * z * harmonic(index, 6))
     + 0.31539157 * (2.0 * zz - xx - yy) * harmonic(index, 5) + 0.54627422 * (xx - yy) * harmonic(index, 7);
#endif
#if HARMONICS >= 15
  c += 0.59004359 * (-y * (3.0 * xx - yy) * harmonic(index, 8) - x * (xx - 3.0 * yy) * harmonic(index, 14))
     + 2.89061144 * x * y * z * harmonic(index, 9) + 1.44530572 * z * (xx - yy) * harmonic(index, 13)
     - 0.45704580 * (4.0 * zz - xx - yy) * (y * harmonic(index, 10) + x * harmonic(index, 12))
     + 0.37317633 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy) * harmonic(index, 11);
#endif
  return c;
}
#else
vec3 viewColor(int index, vec3 base, vec3 d) { return base; }
#endif
// The Turbo map without its dark end, as a polynomial.
vec3 turbo(float v) {
  v = 0.1 + 0.85 * clamp(v, 0.0, 1.0);
  vec4 a = vec4(1.0, v, v * v, v * v * v); vec2 b = a.zw * a.z;
  return clamp(vec3(
    dot(a, vec4(0.13572138, 4.61539260, -42.66032258, 132.13108234)) + dot(b, vec2(-152.94239396, 59.28637943)),
    dot(a, vec4(0.09140261, 2.19418839, 4.84296658, -14.18503333)) + dot(b, vec2(4.27729857, 2.82956604)),
    dot(a, vec4(0.10667330, 12.64194608, -60.58204836, 110.36276771)) + dot(b, vec2(-89.90310912, 27.34824973))), 0.0, 1.0);
}
void main() {
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  int rank = gl_InstanceID * ${BATCH} + (gl_VertexID >> 2);
  if (rank >= count) return;
  int index = int(texelFetch(order, ivec2(rank & 2047, rank >> 11), 0).x);
  uvec4 first = texelFetch(canonical, place(index, 2, 0), 0), second = texelFetch(canonical, place(index, 2, 1), 0);
  vec3 mean = uintBitsToFloat(first.xyz), offset = vec3(0.0);
  vec3 logScale = vec3(low16(second.y), high16(second.y), low16(second.z)) / 1024.0;
  vec4 quat = quaternion(second.x);
  if (index < moving) {
    ivec2 at = ivec2(index & 2047, index >> 11);
    for (int i = 0; i < 4; i++) {
      if (weights[i] == 0.0) continue;
      uvec4 key = texelFetch(keys, ivec3(at, layers[i]), 0);
      offset += weights[i] * offsetStep * vec3(low16(key.x), high16(key.x), low16(key.y));
    }
    uvec4 a = texelFetch(keys, ivec3(at, between.x), 0), b = texelFetch(keys, ivec3(at, between.y), 0);
    quat = product(quat, slerp(quaternion(a.w), quaternion(b.w), betweenWeight));
    logScale += logScaleStep * mix(vec3(high16(a.y), low16(a.z), high16(a.z)),
                                   vec3(high16(b.y), low16(b.z), high16(b.z)), betweenWeight);
  }
  vec3 world = mean + offset, camera = cameraFromWorld * (world - position);
  if (!(camera.z > near)) return;
  vec2 slope = camera.xy / camera.z;
  vec2 inside = clamp(slope, (-0.15 * size - center) / focal, (1.15 * size - center) / focal);
  mat3 turned = cameraFromWorld * rotation(quat);
  vec3 scale = exp(logScale);
  vec3 row0 = vec3(turned[0].x, turned[1].x, turned[2].x), row1 = vec3(turned[0].y, turned[1].y, turned[2].y);
  vec3 row2 = vec3(turned[0].z, turned[1].z, turned[2].z);
  vec3 a = focal.x / camera.z * (row0 - inside.x * row2) * scale;
  vec3 b = focal.y / camera.z * (row1 - inside.y * row2) * scale;
  float aa = dot(a, a), bb = dot(b, b), ab = dot(a, b);
  vec3 across = cross(a, b);
  float determinant = dot(across, across) + dilation * (aa + bb) + dilation * dilation;
  float radius = length(vec2(0.5 * (aa - bb), ab)), major = 0.5 * (aa + bb) + dilation + radius;
  float minor = determinant / major;
  float opacity = float(first.w >> 24) / 255.0;
  if (!(minor > 1e-12) || opacity < 1.0 / 255.0) return;
  float angle = 0.5 * atan(2.0 * ab, aa - bb), reach = sqrt(2.0 * log(255.0 * opacity));
  vec2 axis = vec2(cos(angle), sin(angle));
  local = reach * vec2(float(gl_VertexID & 1) * 2.0 - 1.0, float((gl_VertexID >> 1) & 1) * 2.0 - 1.0);
  vec2 pixel = center + focal * slope + axis * sqrt(major) * local.x + vec2(-axis.y, axis.x) * sqrt(minor) * local.y;
  gl_Position = vec4(2.0 * pixel.x / size.x - 1.0, 1.0 - 2.0 * pixel.y / size.y, 0.0, 1.0);
  vec3 stored = vec3(first.w & 255u, (first.w >> 8) & 255u, (first.w >> 16) & 255u) / 255.0;
  vec3 rgb = max(viewColor(index, mix(colorLow, colorHigh, stored), normalize(world - position)), 0.0);
  if (mode == 1) rgb = turbo(1.0 - log(camera.z / depthRange.x) / log(depthRange.y / depthRange.x));
  if (mode == 2) rgb = index < moving ? turbo(length(offset) / largestOffset) : vec3(0.3 * dot(rgb, vec3(0.3, 0.6, 0.1)));
  color = vec4(rgb, opacity);
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec4 color; in vec2 local; out vec4 result;
void main() {
  float alpha = min(0.999, color.a * exp(-0.5 * dot(local, local)));
  if (alpha < 1.0 / 255.0) discard;
  result = vec4(color.rgb * alpha, alpha);
}`;
const COPY_VERTEX = `#version 300 es
void main() { gl_Position = vec4(float(gl_VertexID & 1) * 4.0 - 1.0, float(gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }`;
const COPY_FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D image; out vec4 result;
void main() { result = vec4(texelFetch(image, ivec2(gl_FragCoord.xy), 0).rgb, 1.0); }`;
