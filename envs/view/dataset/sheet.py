"""The data sheet of a data set: what is in it, how it was made, and what it is not."""

from collections.abc import Mapping
from typing import Any

from haustra.envs.view.dataset.formats import DEPTH_MM, FLOW_PX
from haustra.envs.view.picture.lens import Lens

SHEET = "README.md"

_FILES: Mapping[str, str] = {
    "NNNN_color.png": "8-bit RGB",
    "NNNN_depth.tiff": f"16-bit grey: depth along the camera's axis, 0 to {DEPTH_MM:g} mm in 0 to 65535; "
    "0 and 65535 are none",
    "NNNN_normals.tiff": "16-bit RGB: unit normal of the triangle, towards the camera, each component from -1 to 1",
    "NNNN_flow.tiff": "16-bit RGB, from the second picture on: red columns, green rows, from this picture to the one "
    f"before, {-FLOW_PX:g} to {FLOW_PX:g} pixels in 0 to 65535; 0 in both is none: hidden, outside, or faster",
    "NNNN_occlusion.png": f"8-bit grey: 255 where more wall of the same stretch lies behind, within {DEPTH_MM:g} mm",
    "pose.txt": "one line a picture: the 4 x 4 matrix from the camera to the world, column by column, in mm",
    "camera.json": "intrinsics of Scaramuzza's model by the names of C3VD's loader, at this size",
    "coverage_mesh.obj": "the surface at rest in mm; texture place 1 for triangles that any picture of the clip shows, "
    "else 2",
    "world_vertex_positions.bin": "float32, little-endian, pictures x vertices x 3: where the vertices of that mesh "
    "were, in mm",
    "NNNN_segment.png, NNNN_landmark.png, NNNN_polyp.png": "8-bit grey: 0 for none, else one more than the index in "
    "dataset.json (masks; the colon's lesions)",
    "frames.parquet": "time, insertion, tip's place, what the hand asked for, its force and torque, wall forces",
    "contacts.parquet": "for each picture, places of the colon 2 cm apart that are pressed, and the largest force on a "
    "link there",
    "plain/NNNN.npz": "depth, normals, flow, occlusion, triangle of each pixel and vertices, in floating point and SI "
    "units",
}
"""What each file of a clip holds."""
_CAMERA: Mapping[str, tuple[str, str]] = {
    "gain": ("gain", ""),
    "noise": ("noise at full light", ""),
    "exposure": ("exposed, around the moment of the ground truth, for", " s"),
    "stool": ("stool", ""),
    "mucus": ("mucus", ""),
}
"""What a sheet says of settings that are not nought."""


def data_sheet(record: Mapping[str, Any], lens: Lens) -> str:
    """The sheet as Markdown, from what dataset.json holds."""
    found, settings = record["accuracy"], record["settings"]
    files = "\n".join(f"| `{name}` | {about} |" for name, about in _FILES.items())
    made_by = f"haustra dataset {record['name']} --seed {record['seed']}"
    said = [f"{title} {settings[name]:g}{unit}" for name, (title, unit) in _CAMERA.items() if settings[name]]
    camera = f"gamma {settings['gamma']:g}, exposure {'fixed' if settings['gain'] else 'automatic'}"
    camera = ", ".join([camera, *said])
    if record["of"] != "seeds":
        made_by += " --run RUN --colon COLON"
    clips = sum(len(colon["clips"]) for colon in record["colons"])
    return f"""# {record["name"]}: a colonoscopy data set with mechanics

{found["frames"]} pictures of {lens.width} x {lens.height} pixels in {clips} clips, {settings["rate"]:g} a second, from
{len(record["colons"])} simulated run(s). Made by `{made_by}`; the same command makes the same geometry again.
`dataset.json` holds all options, colons, lesions and versions; `contact.png` shows one picture of each clip: colour,
depth, normals, flow, occlusion, segment, landmark, polyp.

## What is in a clip's folder

| file | holds |
|---|---|
{files}

Files of the names and formats of C3VD (Bobrow 2023, doi 10.1016/j.media.2023.102956) are read by its loaders; the rest
is beside them. The camera looks along +z, x is to the right and y down; the middle of the first pixel is 0, 0.

## How it was made

A colon is grown from a seed, hangs on a mesentery and moves; an adult colonoscope is driven in by a follower of the
lumen, in MuJoCo's units and by haustra's backend 'linear' at 50 records a second. The surface is the one the physics
moved, indented where the scope presses. Rays are exact: each pixel's middle, against the triangles. Lens: {lens.name}.
Camera and wall: {camera}.

## How exact it is, measured from these files

| | largest |
|---|---|
| reprojection of a pixel through depth, pose and moving surface, against its flow ({found["flows"]} pixels) | \
{found["reprojection_px"]:.4f} px |
| depth against MuJoCo's rays, in every eighth picture | {found["depth_error_mm"]:.4f} mm |
| depth in sixteen bits against floating point | {found["round_trip_mm"]:.4f} mm |
| normals against the triangles | {found["normals_error_deg"]:.4f} degrees |

## What it is not

- No tissue was filmed: colour, light and noise are drawn, not measured, and stand for no statistics of patients.
- Colons, mesentery and forces are those of a simulation whose numbers are partly assumed (docs/numbers.md).
- Lesions are geometry: their stiffness and colour are those of the wall.
- The surface is flat triangles some 2.5 mm wide; normals jump from one to the next.
- Whether a place was hidden in the picture before is told to within a pixel.
- Nothing here is fit for clinical use.

## Licence

CC BY 4.0 for the data; haustra itself is Apache-2.0. No picture or mesh of another data set is in it; the lens's
coefficients are from C3VD's published calibration.
"""
