"""Shaders of the OpenGL renderer, the laws in them written down from the functions that every renderer calls.

One takes vertices to where the colon is now and into the camera's axes, and keeps them off the device; one works out
their normals; the rasteriser finds which triangle each pixel's ray may meet; one follows that ray exactly and shades;
and two expose the picture.
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
FAR = 1.5
"""Nothing is drawn beyond this distance [m]; engineering choice."""
_HEAD = f"#version 430\nlayout(local_size_x = {GROUP}) in;\n"


def _buffer(binding: int, kind: str, name: str, *, written: bool = False) -> str:
    access = "" if written else "readonly "
    return f"layout(std430, binding = {binding}) {access}buffer B{binding} {{ {kind} {name}[]; }};\n"


@functools.cache
def write_carry() -> str:
    """Vertices from the colon at rest to where they are now, in the camera's axes."""
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
        with own.when(extra[0] - FALL * xp.abs(place[3] - arc) > far):
            reach = reached(xp, minus((place[0], place[1], place[2]), middle), ray, extra[1])
            own.set(far, xp.maximum(far, reach))
    here = minus(add(middle, times(xp.maximum(far, zero), ray)), own.vector("eye"))
    seen = [dot(here, own.vector(f"sides[{axis}]")) for axis in range(3)]
    own.say(f"local[v] = vec4({', '.join(each.text for each in seen)}, 1.0);")
    buffers = (
        _buffer(0, "vec4", "axis")
        + _buffer(1, "vec4", "lever")
        + _buffer(2, "float", "arcs")
        + _buffer(3, "vec4", "nodes")
        + _buffer(4, "vec4", "device")
        + _buffer(5, "vec4", "local", written=True)
    )
    given = "uniform int first, last, places; uniform vec3 eye; uniform vec3 sides[3]; uniform vec4 world[3];\n"
    return _HEAD + buffers + given + _each("v", own.text)


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


def write_seen() -> tuple[str, str]:
    """Vertices where the lens shows them, and the number of the triangle at each pixel: for the rasteriser."""
    vertex = f"""#version 430
layout(location = 0) in vec4 local;
layout(std430, binding = 0) readonly buffer Radii {{ float radii[]; }};
uniform vec2 centre, size; uniform vec4 stretch; uniform float most; uniform int places;
out gl_PerVertex {{ vec4 gl_Position; float gl_ClipDistance[1]; }};
void main() {{
  vec3 p = local.xyz;
  float off = length(p.xy), away = length(p), half_angle = off / max(away - p.z, 1e-12);
  float way = min(half_angle / most, 1.0) * float(places - 1);
  int at = min(int(way), places - 2);
  float radius = (radii[at] + (way - float(at)) * (radii[at + 1] - radii[at])) / max(off, 1e-12);
  vec2 plane = vec2(radius * p.x, -radius * p.y);
  vec2 pixel = centre + vec2(dot(stretch.xy, plane), dot(stretch.zw, plane));
  gl_Position = vec4((pixel + 0.5) / size * 2.0 - 1.0, away / {FAR} * 2.0 - 1.0, 1.0);
  gl_ClipDistance[0] = 0.6 * away - p.z;
}}
"""
    fragment = """#version 430
uniform int base;
layout(location = 0) out uint met;
void main() { met = uint(base + gl_PrimitiveID + 1); }
"""
    return vertex, fragment


@functools.cache
def write_shade(kinds: tuple[int, ...], guides: int) -> str:
    """Rays to the triangles that the rasteriser found, exactly, and what comes back from there.

    A ray that passes beside its triangle, whose edges the lens bends, meets one of those around its corners.

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
        + _buffer(2, "int", "starts")
        + _buffer(3, "int", "around")
        + _buffer(4, "vec4", "normals")
        + _buffer(5, "vec4", "wall")
        + _buffer(6, "vec4", "lens")
        + _buffer(7, "vec4", "light", written=True)
    )
    given = f"""layout(std140, binding = 0) uniform Common {{ vec4 common_numbers[{_fours(kinds, guides)}]; }};
layout(binding = 0) uniform usampler2D seen;
layout(binding = 1) uniform sampler2D lattice_of;
uniform int first, last, width;
float number(int slot) {{ return common_numbers[slot / 4][slot % 4]; }}
vec4 lattice(int row) {{ return texelFetch(lattice_of, ivec2(row % 256, row / 256), 0); }}
vec4 asked(int face, vec3 ray) {{
  vec3 a = local[faces[3 * face]].xyz, b = local[faces[3 * face + 1]].xyz, c = local[faces[3 * face + 2]].xyz;
  vec3 n = cross(b - a, c - a);
  vec3 w = vec3(dot(ray, cross(b, c)), dot(ray, cross(c, a)), dot(ray, cross(a, b)));
  return vec4(w, dot(a, n) > 0.0 ? dot(a, n) / dot(ray, n) : -1.0);
}}
"""
    body = f"""
  vec3 ray = lens[v].xyz;
  int face = int(texelFetch(seen, ivec2(v % width, v / width), 0).x) - 1;
  light[v] = vec4(0.0, 0.0, 0.0, -1.0);
  if (face < 0 || lens[v].w < 0.0) return;
  vec4 met = asked(face, ray);
  if (min(met.x, min(met.y, met.z)) < 0.0) {{
    float nearest = 1e9;
    int beside = face;
    for (int corner = 0; corner < 3; ++corner) {{
      int vertex = faces[3 * face + corner];
      for (int n = starts[vertex]; n < starts[vertex + 1]; ++n) {{
        vec4 other = asked(around[n], ray);
        if (min(other.x, min(other.y, other.z)) >= 0.0 && other.w > 0.0 && other.w < nearest) {{
          nearest = other.w;
          beside = around[n];
        }}
      }}
    }}
    if (beside != face) {{ face = beside; met = asked(face, ray); }}
  }}
  if (met.w <= 0.0) return;
  vec3 w = max(met.xyz, 0.0);
  w /= max(w.x + w.y + w.z, 1e-30);
  float away = met.w;
  int i = faces[3 * face], j = faces[3 * face + 1], k = faces[3 * face + 2];
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

    Light is never below nought, and then numbers in memory are in the order of the whole numbers that they look like.
    """
    return f"""#version 430
layout(local_size_x = {SELECTING}) in;
{_buffer(0, "vec4", "light")}{_buffer(1, "float", "gain", written=True)}{_buffer(2, "uint", "bright", written=True)}
uniform int width, height; uniform float target, fixed_gain, inertia;
shared uint counts[256];
shared uint total, prefix, rank;
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
    if (own == 0u) {{
      uint passed = 0u, value = 0u;
      while (value < 255u && passed + counts[value] <= rank) {{ passed += counts[value]; value += 1u; }}
      rank -= passed;
      prefix = (prefix << 8) | value;
    }}
    barrier();
  }}
  uint found = prefix;
  barrier();
  return found;
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
  float one = uintBitsToFloat(chosen(samples, low));
  float other = uintBitsToFloat(chosen(samples, min(low + 1u, max(lit, 1u) - 1u)));
  if (own != 0u) return;
  float wanted = target / max(one + (place - float(low)) * (other - one), 1e-12);
  bool first = gain[1] == 0.0;
  float now = lit == 0u ? (first ? 1.0 : gain[0])
    : first ? wanted : pow(gain[0], inertia) * pow(wanted, 1.0 - inertia);
  gain[0] = fixed_gain > 0.0 ? fixed_gain : now;
  gain[1] = 1.0;
}}
"""


@functools.cache
def write_develop() -> str:
    """Bytes of red, green and blue from light, by the gain and the camera's curve."""
    buffers = (
        _buffer(0, "vec4", "light")
        + _buffer(1, "float", "gain")
        + _buffer(2, "uint", "curve")
        + _buffer(3, "uint", "picture", written=True)
    )
    text = """
  vec3 own = min(gain[0] * light[v].xyz, 1.0) * float(top);
  picture[v] = curve[int(own.x)] | curve[int(own.y)] << 8 | curve[int(own.z)] << 16 | 0xff000000u;"""
    return _HEAD + buffers + "uniform int first, last, top;\n" + _each("v", text)
