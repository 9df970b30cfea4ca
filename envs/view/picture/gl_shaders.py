"""Shaders of the OpenGL renderer, the laws in them written down from the functions that every renderer calls.

One takes vertices to where the colon is now and into the camera's axes, keeps them off the device and finds where the
lens shows them; one works out their normals; one asks, for each triangle, which rays of the pixels about its corners
meet it, and lets the nearest have each pixel; one shades; and two expose the picture. All are compute shaders: graphics
processors for computing rasterise with a small part of themselves only.
"""

import functools

from haustra.envs.view.picture.glsl import REAL, WHOLE, Glsl, Number
from haustra.envs.view.picture.mucosa import Change, Landmark, Looks, Scene, Sight, WallPlace, shade
from haustra.envs.view.picture.shader import SHARED
from haustra.models.wall.indentation import FALL, reached
from haustra.models.wall.sections import Section, carried
from haustra.models.wall.signed_distance import ANUS
from haustra.models.wall.vectors import Vector, add, between, dot, minus, norm, times

GROUP = 64
"""Threads of a group."""
SELECTING = 1024
"""Threads of the one group that exposes: as many as every OpenGL with compute shaders lets stand together."""
SPARSE = 4
"""Exposure looks at one of so many rows and columns (`haustra.envs.view.picture.light.Response.gain_for`)."""
UPPER = 0.75
"""Share of the lit places that are darker than what exposure goes by (see there)."""
NONE = 0xFFFFFFFF
"""Number of a pixel whose ray meets nothing, and its distance."""
LARGEST = 64
"""Triangles with more pixels about them than this are looked at by a group of threads each, others by one."""
GROUPS = 4096
"""Groups that share the large triangles of a picture at most."""
LISTED = 4
"""The list of large triangles begins with how many there are, and with three numbers of groups that are to look."""
FOUR = 4
"""Pixels of a thread that makes bytes: four times three bytes are three whole numbers."""
_HEAD = f"#version 430\nlayout(local_size_x = {GROUP}) in;\n"


def _buffer(binding: int, kind: str, name: str, *, written: bool = False) -> str:
    access = "" if written else "readonly "
    return f"layout(std430, binding = {binding}) {access}buffer B{binding} {{ {kind} {name}[]; }};\n"


@functools.cache
def write_carry() -> str:
    """Vertices from the colon at rest to where they are now, in the camera's axes and in its picture."""
    own = Glsl()
    xp, zero = own.xp, own.given("0.0")
    own.say("vec4 held = axis[v], lever_of = lever[v];")
    arc, share = own.given("arcs[v]"), own.given("lever_of.w")
    node, offset, still = own.given("int(held.w)", WHOLE), own.vector("lever_of"), own.vector("held")

    def at(node: Number) -> tuple[Vector, Section]:
        first, turn, across = (own.row("nodes", node * 3 + row) for row in range(3))
        turned = turn[0], (turn[1], turn[2], turn[3])
        return (first[0], first[1], first[2]), (*turned, first[3], (across[0], across[1], across[2]))

    (before, one), (after, other) = at(node), at(node + 1)
    middle = _in_world(own, add(still, between(before, after, share)))
    away = between(carried(one, offset), carried(other, offset), share)
    ray = _turned(own, away)
    length = norm(xp, ray)
    ray = times(1 / length, ray)
    far = own.put(REAL, length.text)
    with (
        own.when(arc > ANUS),
        own.block("for (int p = 0; p < places; ++p)"),
    ):
        place, extra = own.row("device", own.given("2 * p", WHOLE)), own.row("device", own.given("2 * p + 1", WHOLE))
        most = extra[0] - FALL * xp.abs(place[3] - arc)
        with own.when(most > far):
            reach = reached(xp, minus((place[0], place[1], place[2]), middle), ray, extra[1])
            own.set(far, xp.maximum(far, xp.minimum(reach, most)))
    here = minus(add(middle, times(xp.maximum(far, zero), ray)), own.vector("eye"))
    seen = [dot(here, own.vector(f"sides[{axis}]")) for axis in range(3)]
    own.say(f"vec3 own = vec3({', '.join(each.text for each in seen)}), shown = project(own);")
    own.say("local[v] = vec4(own, shown.z);")
    own.say("image[v] = shown.xy;")
    buffers = (
        _buffer(0, "vec4", "axis")
        + _buffer(1, "vec4", "lever")
        + _buffer(2, "float", "arcs")
        + _buffer(3, "vec4", "nodes")
        + _buffer(4, "vec4", "device")
        + _buffer(5, "vec4", "local", written=True)
        + _buffer(6, "vec2", "image", written=True)
    )
    given = "uniform int first, last, places; uniform vec3 eye; uniform vec3 sides[3]; uniform vec4 world[3];\n"
    return _HEAD + buffers + given + _PROJECT + _each("v", own.text)


def _in_world(own: Glsl, place: Vector) -> Vector:
    """A place of the colon's own coordinates in the world."""
    x, y, z = _turned(own, place)
    return x + own.given("world[0].w"), y + own.given("world[1].w"), z + own.given("world[2].w")


def _turned(own: Glsl, v: Vector) -> Vector:
    x, y, z = (dot(own.vector(f"world[{row}]"), v) for row in range(3))
    return x, y, z


def _each(thing: str, text: str) -> str:
    head = f"int {thing} = first + int(gl_GlobalInvocationID.x);\n  if ({thing} >= last) return;\n"
    return f"void main() {{\n  {head}{text}\n}}\n"


@functools.cache
def write_normals() -> str:
    """Unit normals at vertices into the lumen: means of the triangles' around, by area, as exact rays have them."""
    buffers = (
        _buffer(0, "vec4", "local")
        + _buffer(1, "int", "faces")
        + _buffer(2, "int", "starts")
        + _buffer(3, "int", "around")
        + _buffer(4, "vec4", "normals", written=True)
    )
    text = """
  vec3 total = vec3(0.0);
  for (int n = starts[v]; n < starts[v + 1]; ++n) {
    int face = 3 * around[n];
    vec3 a = local[faces[face]].xyz, b = local[faces[face + 1]].xyz, c = local[faces[face + 2]].xyz;
    total -= cross(b - a, c - a);
  }
  normals[v] = vec4(total / max(length(total), 1e-30), 0.0);"""
    return _HEAD + buffers + "uniform int first, last;\n" + _each("v", text)


_PROJECT = """layout(std430, binding = 7) readonly buffer Radii { float radii[]; };
uniform vec2 centre; uniform vec4 stretch; uniform float most; uniform int radius_count;
vec3 project(vec3 p) {
  float off = length(p.xy), half_angle = off / max(length(p) - p.z, 1e-12);
  float way = min(half_angle / most, 1.0) * float(radius_count - 1);
  int at = min(int(way), radius_count - 2);
  float radius = (radii[at] + (way - float(at)) * (radii[at + 1] - radii[at])) / max(off, 1e-12);
  vec2 plane = vec2(radius * p.x, -radius * p.y);
  return vec3(centre + vec2(dot(stretch.xy, plane), dot(stretch.zw, plane)), half_angle);
}
"""
"""Column and row at which the lens shows a place in the camera's axes, and tan(angle / 2), as `kernels._project`."""

_ASKED = """vec4 asked(vec3 a, vec3 b, vec3 c, vec3 ray) {
  precise vec3 u = b - a, v = c - a, n = cross(u, v), p = cross(b, c), q = cross(c, a), r = cross(a, b);
  precise vec3 inside = vec3(dot(ray, p), dot(ray, q), dot(ray, r));
  precise float facing = dot(a, n), away = facing / dot(ray, n);
  return vec4(inside, away);
}
"""
"""Whether a ray meets a triangle, where none of the first three is below nought, and after how far: as `kernels` has
it. Precise, so that neighbours' common edge is the same for both, and every stage finds the same distance."""


@functools.cache
def write_nearest() -> str:
    """Which triangle each pixel's ray meets first: distances, then whose these are.

    A thread asks all pixels about a triangle's corners; where these are many, a group of threads does so later. Bounds
    are those of `kernels.find_boxes`.
    """
    from haustra.envs.view.picture import kernels

    buffers = (
        _buffer(0, "vec4", "local")
        + _buffer(1, "vec2", "image")
        + _buffer(2, "int", "faces")
        + _buffer(3, "vec4", "lens")
        + _buffer(4, "uint", "nearest", written=True)
        + _buffer(5, "uint", "own", written=True)
        + _buffer(6, "uint", "large", written=True)
    )
    given = "uniform int first, last, stage; uniform ivec2 size; uniform float widest;\n"
    text = f"""
ivec4 box(vec4 a, vec4 b, vec4 c, int i, int j, int k) {{
  const ivec4 none = ivec4(0, 0, -1, -1);
  float half_angle = min(a.w, min(b.w, c.w));
  if (half_angle > 4.0 * widest || dot(a.xyz, cross(b.xyz - a.xyz, c.xyz - a.xyz)) <= 0.0) return none;
  vec3 u = b.xyz - a.xyz, v = c.xyz - a.xyz, w = v - u;
  float edge = max(dot(u, u), max(dot(v, v), dot(w, w)));
  float angle = sqrt(edge / max(min(dot(a.xyz, a.xyz), min(dot(b.xyz, b.xyz), dot(c.xyz, c.xyz))), 1e-12));
  vec2 low, high;
  if (angle > {kernels.WIDE}) {{
    low = vec2(1e9);
    high = vec2(-1e9);
    for (int side = 0; side < 3; ++side) {{
      vec3 from = side == 0 ? a.xyz : side == 1 ? b.xyz : c.xyz, to = side == 0 ? b.xyz : side == 1 ? c.xyz : a.xyz;
      for (int s = 0; s < {kernels.SAMPLES}; ++s) {{
        vec2 at = project(from + float(s) / {kernels.SAMPLES}.0 * (to - from)).xy;
        low = min(low, at);
        high = max(high, at);
      }}
    }}
    angle /= {kernels.SAMPLES}.0;
  }} else {{
    if (half_angle > widest + angle) return none;
    vec2 p = image[i], q = image[j], r = image[k];
    low = min(p, min(q, r));
    high = max(p, max(q, r));
  }}
  float margin = {kernels.MARGIN} + {kernels.BEND} * angle * max(high.x - low.x, high.y - low.y);
  low = max(ceil(low - margin), vec2(0.0));
  high = min(floor(high + margin), vec2(size) - 1.0);
  return any(greaterThan(low, high)) ? none : ivec4(ivec2(low), ivec2(high));
}}
{_ASKED}void ask(int face, vec3 a, vec3 b, vec3 c, int pixel) {{
  vec4 towards = lens[pixel];
  if (towards.w < 0.0) return;
  vec4 met = asked(a, b, c, towards.xyz);
  if (min(met.x, min(met.y, met.z)) < 0.0 || !(met.w > 0.0)) return;
  uint away = floatBitsToUint(met.w);
  if ((stage & 1) == 0) atomicMin(nearest[pixel], away);
  else if (nearest[pixel] == away) atomicMin(own[pixel], uint(face));
}}
void look(int face, int thread, int threads) {{
  int i = faces[3 * face], j = faces[3 * face + 1], k = faces[3 * face + 2];
  vec4 a = local[i], b = local[j], c = local[k];
  ivec4 about = box(a, b, c, i, j, k);
  int columns = about.z - about.x + 1, count = columns * (about.w - about.y + 1);
  if (threads == 1 && count > {LARGEST}) {{
    if (stage == 0) {{
      uint at = atomicAdd(large[0], 1u);
      large[{LISTED}u + at] = uint(face);
      atomicMax(large[1], min(at + 1u, {GROUPS}u));
    }}
    return;
  }}
  for (int n = thread; n < count; n += threads)
    ask(face, a.xyz, b.xyz, c.xyz, (about.y + n / columns) * size.x + about.x + n % columns);
}}
void main() {{
  if (stage < 2) {{
    int face = first + int(gl_GlobalInvocationID.x);
    if (face < last) look(face, 0, 1);
  }} else
    for (uint n = gl_WorkGroupID.x; n < large[0]; n += gl_NumWorkGroups.x)
      look(int(large[{LISTED}u + n]), int(gl_LocalInvocationID.x), {GROUP});
}}
"""
    return _HEAD + buffers + given + _PROJECT + text


@functools.cache
def write_shade(kinds: tuple[int, ...], guides: int) -> str:
    """What comes back from the triangles that rays meet; what was known of these is forgotten for the next picture.

    Args:
        kinds: of the landmarks.
        guides: number of light guides.
    """
    own = Glsl()
    scene = _scene(own, kinds, guides)
    numbers = [own.given(f"known[{column}]") for column in range(9)]
    place = WallPlace((numbers[0], numbers[1], numbers[2]), *numbers[3:])
    sight = Sight(own.given("away"), own.vector("ray"), own.vector("normal"), own.given("lens[v].w"))

    def only(condition: Number, change: Change, looks: Looks) -> Looks:
        return Looks.of(own.changed_where(condition, lambda held: change(Looks.of(held)).numbers, looks.numbers))

    bands = shade(own.xp, place, sight, scene, only)
    buffers = (
        _buffer(0, "vec4", "local")
        + _buffer(1, "int", "faces")
        + _buffer(2, "uint", "nearest", written=True)
        + _buffer(3, "uint", "own", written=True)
        + _buffer(4, "vec4", "normals")
        + _buffer(5, "vec4", "wall")
        + _buffer(6, "vec4", "lens")
        + _buffer(7, "vec4", "light", written=True)
    )
    given = f"""layout(std140, binding = 0) uniform Common {{ vec4 common_numbers[{_fours(kinds, guides)}]; }};
layout(binding = 0) uniform sampler2D lattice_of;
uniform int first, last;
float number(int slot) {{ return common_numbers[slot / 4][slot % 4]; }}
vec4 lattice(int row) {{ return texelFetch(lattice_of, ivec2(row % 256, row / 256), 0); }}
{_ASKED}"""
    body = f"""
  vec3 ray = lens[v].xyz;
  uint met_first = own[v];
  own[v] = {NONE}u;
  nearest[v] = {NONE}u;
  light[v] = vec4(0.0, 0.0, 0.0, -1.0);
  if (met_first == {NONE}u) return;
  int face = int(met_first);
  int i = faces[3 * face], j = faces[3 * face + 1], k = faces[3 * face + 2];
  vec4 met = asked(local[i].xyz, local[j].xyz, local[k].xyz, ray);
  vec3 w = max(met.xyz, 0.0);
  w /= max(w.x + w.y + w.z, 1e-30);
  float away = met.w;
  vec3 normal = w.x * normals[i].xyz + w.y * normals[j].xyz + w.z * normals[k].xyz;
  normal /= max(length(normal), 1e-15);
  float known[12];
  for (int row = 0; row < 3; ++row) {{
    vec4 four = w.x * wall[3 * i + row] + w.y * wall[3 * j + row] + w.z * wall[3 * k + row];
    for (int column = 0; column < 4; ++column) known[4 * row + column] = four[column];
  }}
{own.text}
  light[v] = vec4({", ".join(own.text_of(band, REAL) for band in bands)}, away);"""
    return _HEAD + buffers + given + _each("v", body)


def _fours(kinds: tuple[int, ...], guides: int) -> int:
    """Fours that hold the numbers all pixels share."""
    return -(-(SHARED + 3 * guides + 7 * len(kinds)) // 4)


def _scene(own: Glsl, kinds: tuple[int, ...], guides: int) -> Scene:
    """What all pixels share, in the order of `haustra.envs.view.picture.shader.common_numbers`."""
    numbers = iter([own.given(f"number({slot})") for slot in range(SHARED + 3 * guides + 7 * len(kinds))])

    def vector() -> Vector:
        return next(numbers), next(numbers), next(numbers)

    axes = vector(), vector(), vector()
    (spread, pixel, wet), mucus = vector(), next(numbers)
    places = [vector() for _ in range(guides)]
    landmarks = [Landmark(kind, vector(), next(numbers), vector()) for kind in kinds]

    def lattice(row: Number) -> list[Number]:
        name = own.put("vec4", f"lattice({row.text})").text
        return [own.given(f"{name}.{each}") for each in "xyzw"]

    return Scene(lattice, landmarks, axes, places, spread, pixel, wet, mucus)


@functools.cache
def write_gain() -> str:
    """The gain of a picture, by numpy's percentile of what is lit, found digit by digit in one group.

    No triangle is large any more then.

    Light is never below nought, and then numbers in memory are in the order of the whole numbers that they look like.
    """
    return f"""#version 430
layout(local_size_x = {SELECTING}) in;
{_buffer(0, "vec4", "light")}{_buffer(1, "float", "gain", written=True)}{_buffer(2, "uint", "bright", written=True)}
{_buffer(3, "uint", "large", written=True)}uniform int width, height; uniform float target, fixed_gain, inertia;
shared uint counts[256];
shared uint total, prefix, rank, left, next;
uint chosen(int samples, uint wanted) {{
  uint own = gl_LocalInvocationID.x;
  if (own == 0u) {{ prefix = 0u; rank = wanted; }}
  for (int digit = 3; digit >= 0; --digit) {{
    if (own < 256u) counts[own] = 0u;
    barrier();
    for (int s = int(own); s < samples; s += {SELECTING}) {{
      uint above = digit == 3 ? 0u : bright[s] >> (8 * digit + 8);
      if (bright[s] > 0u && above == prefix) atomicAdd(counts[(bright[s] >> (8 * digit)) & 255u], 1u);
    }}
    barrier();
    uint here = own < 256u ? counts[own] : 0u;
    for (uint reach = 1u; reach < 256u; reach *= 2u) {{
      uint more = own < 256u && own >= reach ? counts[own - reach] : 0u;
      barrier();
      if (own < 256u) counts[own] += more;
      barrier();
    }}
    uint before = own < 256u ? counts[own] - here : 0u, wanted_here = rank;
    barrier();
    if (here > 0u && before <= wanted_here && wanted_here < before + here) {{
      rank = wanted_here - before;
      left = here - rank - 1u;
      prefix = (prefix << 8) | own;
    }}
    barrier();
  }}
  return prefix;
}}
void main() {{
  uint own = gl_LocalInvocationID.x, lit_here = 0u;
  int columns = (width + {SPARSE - 1}) / {SPARSE}, samples = columns * ((height + {SPARSE - 1}) / {SPARSE});
  if (own == 0u) total = 0u;
  barrier();
  for (int s = int(own); s < samples; s += {SELECTING}) {{
    vec3 seen = light[{SPARSE} * (s / columns) * width + {SPARSE} * (s % columns)].xyz;
    bright[s] = floatBitsToUint(max(max(seen.x, max(seen.y, seen.z)), 0.0));
    if (bright[s] > 0u) lit_here += 1u;
  }}
  atomicAdd(total, lit_here);
  barrier();
  uint lit = total;
  float place = {UPPER} * (float(lit) - 1.0);
  uint low = uint(max(floor(place), 0.0));
  uint found = chosen(samples, low), after = {NONE}u;
  if (own == 0u) next = {NONE}u;
  barrier();
  for (int s = int(own); s < samples; s += {SELECTING}) if (bright[s] > found) after = min(after, bright[s]);
  if (after != {NONE}u) atomicMin(next, after);
  barrier();
  if (own != 0u) return;
  float one = uintBitsToFloat(found), other = left > 0u || next == {NONE}u ? one : uintBitsToFloat(next);
  float wanted = target / max(one + (place - float(low)) * (other - one), 1e-12);
  bool first = gain[1] == 0.0;
  float now = lit == 0u ? (first ? 1.0 : gain[0])
    : first ? wanted : pow(gain[0], inertia) * pow(wanted, 1.0 - inertia);
  gain[0] = fixed_gain > 0.0 ? fixed_gain : now;
  gain[1] = 1.0;
  large[0] = large[1] = 0u;
}}
"""


@functools.cache
def write_develop() -> str:
    """Bytes of red, green and blue, of four pixels at a time, from light, by the gain and the camera's curve."""
    buffers = (
        _buffer(0, "vec4", "light")
        + _buffer(1, "float", "gain")
        + _buffer(2, "uint", "curve")
        + _buffer(3, "uint", "picture", written=True)
    )
    text = f"""
  uint bytes[{3 * FOUR}];
  for (int n = 0; n < {FOUR}; ++n) {{
    vec3 own = min(gain[0] * light[min({FOUR} * v + n, pixels - 1)].xyz, 1.0) * float(top);
    for (int band = 0; band < 3; ++band) bytes[3 * n + band] = curve[int(own[band])];
  }}
  for (int n = 0; n < 3; ++n)
    picture[3 * v + n] = bytes[4 * n] | bytes[4 * n + 1] << 8 | bytes[4 * n + 2] << 16 | bytes[4 * n + 3] << 24;"""
    return _HEAD + buffers + "uniform int first, last, top, pixels;\n" + _each("v", text)
