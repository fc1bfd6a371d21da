// SPDX-License-Identifier: BSD-3-Clause
// Rays through tetrahedra, in GLSL. Vertices are seen along the ray: across it (xy), how far along it (z), their value
// (w). A ray that is in a face goes on by the side of the tetrahedron that surrounds it there. Neighbours see their
// common face alike, so that no ray gets lost between them, and a flat tetrahedron is passed like any other.

export const width = 2048; // texels of a texture's row

export const vertexShader = `#version 300 es
out vec2 place;
void main() {
  place = 2.0 * vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) - 1.0;
  gl_Position = vec4(place, 0.0, 1.0);
}`;

export const copyShader = `#version 300 es
precision mediump float;
uniform sampler2D image;
in vec2 place;
out vec4 seen;
void main() { seen = texture(image, 0.5 * place + 0.5); }`;

export const fragmentShader = `#version 300 es
precision highp float;
precision highp int;
precision highp usampler2D;
precision highp sampler2D;
uniform sampler2D vertices, vectors, nodes, cells, table, opaque;
uniform usampler2D corners, neighbours, faces;
uniform mat4 toWorld;           // from the picture's cube to the vertices' coordinates
uniform uint nodeCount, tetCount;
uniform vec2 range;             // of the colours, of logarithms if logarithmic
uniform bool logarithmic, hasOpaque;
uniform bool byCells;           // tetrahedra have the values, four to a texel of cells
uniform bool byLengths;         // values are lengths of vectors
uniform vec4 clip;              // drawn is where dot(clip.xyz, p) < clip.w
in vec2 place;
out vec4 seen;

const uint NONE = 0xffffffffu, LEAF = 4u; // LEAF as RAYS_LEAF
const float FAR = 1e30;

vec3 origin, direction, across, up;
vec2 extent;                    // of what is drawn along the ray
float opacity = 0.0;
vec3 color = vec3(0.0);

ivec2 at(uint i) { return ivec2(int(i % ${width}u), int(i / ${width}u)); }
float area(vec4 a, vec4 b) { return a.x * b.y - a.y * b.x; }

vec4 along(uint vertex) {
  vec4 v = texelFetch(vertices, at(vertex), 0);
  vec3 p = v.xyz - origin;
  return vec4(dot(p, across), dot(p, up), dot(p, direction), v.w);
}

vec3 unproject(float depth) {
  vec4 p = toWorld * vec4(place, depth, 1.0);
  return p.xyz / p.w;
}

// Is a part of the box between two places?
bool meets(vec3 low, vec3 high, float last, float first) {
  vec3 a = (low - origin) / direction, b = (high - origin) / direction;
  vec3 near = min(a, b), far = max(a, b);
  float from = max(max(near.x, near.y), near.z), to = min(min(far.x, far.y), far.z);
  float rounding = 1e-5 * abs(to);
  return from <= to + rounding && to + rounding >= last && from <= first + rounding;
}

// The next face behind \`last\` by which the ray enters: its number, and where.
uint enter(float last, out float first) {
  uint found = NONE;
  first = FAR;
  for (uint i = 0u; i < nodeCount;) {
    vec4 low = texelFetch(nodes, at(2u * i), 0), high = texelFetch(nodes, at(2u * i + 1u), 0);
    if (!meets(low.xyz, high.xyz, last, first)) {
      i = uint(low.w);
      continue;
    }
    i++;
    if (high.w < 0.0) continue;
    for (uint k = 0u; k < LEAF; k++) {
      uint number = LEAF * uint(high.w) + k;
      uvec4 face = texelFetch(faces, at(number), 0);
      if (face.w == NONE) break;
      vec4 a = along(face.x), b = along(face.y), c = along(face.z);
      vec3 w = vec3(area(b, c), area(c, a), area(a, b));
      float sum = w.x + w.y + w.z;
      if (max(max(w.x, w.y), w.z) > 0.0 || sum >= 0.0) continue;
      float z = dot(w, vec3(a.z, b.z, c.z)) / sum;
      if (z > last && z < first) {
        first = z;
        found = number;
      }
    }
  }
  return found;
}

float position(float value) {
  float x = logarithmic ? log2(max(value, 1e-38)) * 0.30102999566 : value;
  return (x - range.x) / (range.y - range.x);
}

// A place on the ray, and what is linear there: the value, or the vector whose length it is.
struct Place { float z; vec4 linear; };

float valueOf(vec4 linear) { return byLengths ? length(linear) : linear.x; }
float seat(vec4 linear) { return clamp(position(valueOf(linear)), 0.0, 1.0); }

// In a face, with weights of its corners.
vec4 linearIn(uvec3 id, vec3 w, vec3 values) {
  if (!byLengths) return vec4(dot(w, values), 0.0, 0.0, 0.0);
  return w.x * texelFetch(vectors, at(id.x), 0) + w.y * texelFetch(vectors, at(id.y), 0)
    + w.z * texelFetch(vectors, at(id.z), 0);
}

// Colour and opacity of a piece between two places.
void pass(Place from, Place to) {
  float z0 = max(from.z, extent.x), z1 = min(to.z, extent.y);
  if (z1 <= z0) return;
  vec2 part = (vec2(z0, z1) - from.z) / (to.z - from.z);
  vec4 first = mix(from.linear, to.linear, part.x), last = mix(from.linear, to.linear, part.y);
  float low = seat(first), high = seat(last);
  float between = byLengths ? seat(0.5 * (first + last)) : 0.5 * (low + high); // a length may sink
  float steps = clamp(ceil(128.0 * max(abs(high - low), 2.0 * abs(between - 0.5 * (low + high)))), 1.0, 128.0);
  for (float i = 0.5; i < steps; i++) {
    float x = seat(mix(first, last, i / steps));
    vec4 entry = texelFetch(table, ivec2(int(x * ${width - 1}.0 + 0.5), 0), 0);
    float taken = (1.0 - opacity) * (1.0 - exp(-entry.w * (z1 - z0) / steps));
    color += taken * entry.rgb;
    opacity += taken;
  }
}

// From a face of the boundary to the next one.
void follow(uint number, float z) {
  uvec4 face = texelFetch(faces, at(number), 0);
  uvec3 id = face.xzy; // counter-clockwise as the ray sees it
  uint slot = face.w;
  vec4 a = along(id.x), b = along(id.y), c = along(id.z);
  vec3 w = vec3(area(b, c), area(c, a), area(a, b));
  Place from = Place(z, linearIn(id, w / (w.x + w.y + w.z), vec3(a.w, b.w, c.w)));
  for (uint i = 0u; i < tetCount; i++) {
    uvec4 tet = texelFetch(corners, at(slot >> 2), 0);
    uint id4 = tet[slot & 3u];
    vec4 p = along(id4);
    float pa = area(p, a), pb = area(p, b), pc = area(p, c);
    uint gone;
    if (pa >= 0.0 && pb <= 0.0) {
      gone = id.z; id.z = id4; c = p;
    } else if (pb >= 0.0 && pc <= 0.0) {
      gone = id.x; id.x = id4; a = p;
    } else {
      gone = id.y; id.y = id4; b = p;
    }
    w = vec3(area(b, c), area(c, a), area(a, b));
    float sum = w.x + w.y + w.z;
    Place to = from;
    if (sum > 0.0) to = Place(dot(w, vec3(a.z, b.z, c.z)) / sum, linearIn(id, w / sum, vec3(a.w, b.w, c.w)));
    if (byCells) from.linear.x = to.linear.x = texelFetch(cells, at(slot >> 4), 0)[(slot >> 2) & 3u];
    pass(from, to);
    if (opacity > 0.995 || to.z >= extent.y) return;
    from = to;
    uint k = tet.x == gone ? 0u : tet.y == gone ? 1u : tet.z == gone ? 2u : 3u;
    slot = texelFetch(neighbours, at(slot >> 2), 0)[k];
    if (slot == NONE) return;
  }
}

void look() {
  origin = unproject(-1.0);
  direction = normalize(unproject(1.0) - origin);
  across = normalize(cross(abs(direction.x) < 0.6 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0), direction));
  up = cross(direction, across);
  extent = vec2(0.0, FAR);
  if (hasOpaque) {
    vec4 written = texelFetch(opaque, ivec2((0.5 * place + 0.5) * vec2(textureSize(opaque, 0))), 0);
    float depth = (written.r * 256.0 + written.g) / 257.0;
    if (depth < 1.0) extent.y = dot(unproject(2.0 * depth - 1.0) - origin, direction);
  }
  float slope = dot(clip.xyz, direction), before = clip.w - dot(clip.xyz, origin);
  if (slope > 0.0) extent.y = min(extent.y, before / slope);
  else if (slope < 0.0) extent.x = max(extent.x, before / slope);
  else if (before <= 0.0) extent.y = -FAR;
}

void main() {
  look();
  float first, last = -FAR;
  while (opacity <= 0.995 && last < extent.y) {
    uint number = enter(last, first);
    if (number == NONE || first >= extent.y) break;
    follow(number, first);
    last = first;
  }
  seen = vec4(color, opacity);
}`;
