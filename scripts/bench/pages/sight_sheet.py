"""`python -m haustra.scripts.bench.pages.sight_sheet PICTURE.webp`: sixteen views of a grown colon, anus to caecum."""

import sys
from pathlib import Path

import numpy as np

_SIZE, _SAMPLES = 320, 2
"""Rows and columns of a view [pixels], and how many times finer it is drawn along each side."""
_SEED, _COLLAPSED, _INFLATED, _STOOL = 5, 700.0, 3333.0, 0.35
"""Seed of the colon, gas pressures at which two views are collapsed and inflated [Pa], and share of the lower wall
under residue in one."""


def draw(path: Path) -> Path:
    """Draw the sheet."""
    from PIL import Image, ImageDraw, ImageFont

    from haustra.envs.console.channel import treated, wounds
    from haustra.envs.view.picture.appearance import Appearance, Residue
    from haustra.envs.view.picture.camera import looking, unit
    from haustra.envs.view.picture.endoscope import Endoscope
    from haustra.envs.view.picture.lens import named_lens
    from haustra.envs.view.picture.renderer import CameraPose
    from haustra.envs.view.picture.surface import ColonSurface
    from haustra.files import write_atomically
    from haustra.models.anatomy.grown import grow_colon
    from haustra.models.anatomy.lesion import read_orders
    from haustra.models.gas.numbers import diameter_share

    polyps = read_orders("polyp", ["descending@0.4:9mm", "transverse:10mm:pedunculated"])
    sacs = read_orders("diverticulum", ["sigmoid@0.55:8mm", "sigmoid@0.6:6mm"])
    colon = grow_colon(seed=_SEED, lesions=(*polyps, *sacs))
    line, surface = colon.centreline, ColonSurface(colon)
    lens = named_lens("cf-hq190l").at(_SAMPLES * _SIZE, _SAMPLES * _SIZE)
    scope = Endoscope(colon, lens, surface=surface)
    segments = {each.name: each for each in colon.segments}

    def station(arc: float) -> int:
        return min(int(np.searchsorted(line.arc, arc)), len(line.arc) - 1)

    def along(arc: float, ahead: float = 0.05) -> CameraPose:
        here = line.points[station(arc)]
        up = line.frames[station(arc)][:, 0]
        return CameraPose(here, looking(line.points[station(arc + ahead)] - here, up))

    def towards(place: np.ndarray, arc: float, back: float) -> CameraPose:
        here = line.points[station(arc - back)]
        return CameraPose(here, looking(place - here, line.frames[station(arc - back)][:, 0]))

    def within(name: str, share: float) -> float:
        return segments[name].start + share * (segments[name].end - segments[name].start)

    def lesion(kind: str, shape: str, back: float, aside: float = 0.0) -> CameraPose:
        found = next(each for each in colon.lesions if each.kind == kind and each.type == shape)
        place, middle = np.array(found.position), line.points[station(found.arc)]
        pose = towards(place + min(0.5 * found.extent, 0.004) * unit(middle - place), found.arc, back)
        moved = pose.position + aside * unit(middle - place)
        return CameraPose(moved, looking(place - moved, pose.rotation[:, 1]))

    orifice, valve = (row[1:4] for row in scope.appearance.landmarks)
    caecum, end = segments["caecum"].start, line.length
    views = {
        "anal canal, dentate line": along(0.004, 0.03),
        "rectum": along(0.07),
        "sigmoid: diverticulum": lesion("diverticulum", "sac", 0.012, 0.008),
        "descending: sessile polyp": lesion("polyp", "sessile", 0.024),
        "the same, forceps have bitten": lesion("polyp", "sessile", 0.024),
        "the same, cut off by a snare": lesion("polyp", "sessile", 0.024),
        "splenic flexure": along(within("descending", 0.93), 0.04),
        "transverse: taeniae, folds": along(within("transverse", 0.7)),
        "transverse: stalked polyp": lesion("polyp", "pedunculated", 0.035),
        "ileocaecal valve": towards(valve, caecum, 0.03),
        "caecum: appendix orifice": towards(orifice, end, 0.035),
        "blood from a biopsy": along(within("ascending", 0.4)),
        "red-out: lens on the wall": along(within("descending", 0.2)),
        "collapsed, 0.7 kPa": along(within("descending", 0.2)),
        "the same place, 3.3 kPa": along(within("descending", 0.2)),
        "residue that was not rinsed": along(within("ascending", 0.4)),
    }
    sessile = next(index for index, each in enumerate(colon.lesions) if each.type == "sessile")
    place = within("ascending", 0.4)
    bleeding = line.points[station(place + 0.035)]
    pictures = []
    for name, pose in views.items():
        surface.place(colon.lumen.vertices)
        surface.indent(np.zeros((0, 3)), 0.0)
        scope.appearance.known[:, 3] = 0.0
        if name.startswith("blood"):
            wall = colon.lumen.vertices - bleeding
            near = int(np.abs(np.linalg.norm(wall, axis=1) - 0.02).argmin())
            scope.appearance.bleed(colon.lumen.vertices[near], 0.03)
        elif name.startswith("red"):
            aside = line.frames[station(within("descending", 0.2))][:, 1]
            reach = colon.radius[station(within("descending", 0.2))].max()
            pose = CameraPose(pose.position + (reach + 0.004) * aside, looking(aside, line.frames[0][:, 2]))
            surface.make_room(pose.position, aside, within("descending", 0.2), 0.0064)
        elif name.endswith("kPa"):
            gas = _COLLAPSED if name.startswith("collapsed") else _INFLATED
            share = float(diameter_share(np, "descending", gas))
            middles = np.column_stack([np.interp(surface.arcs, line.arc, line.points[:, axis]) for axis in range(3)])
            shrunk = np.empty_like(colon.lumen.vertices)
            shrunk[surface.order] = middles + share * (surface.rest - middles)
            surface.place(shrunk)
            surface.make_room(pose.position, -pose.rotation[:, 2], within("descending", 0.2), 0.0064)
        eye = scope
        if name.startswith("the same, "):
            tissue = [(1 if "bitten" in name else 2) * (index == sessile) for index in range(len(colon.lesions))]
            after = treated(colon, tissue)
            eye = Endoscope(after, lens, surface=ColonSurface(after))
            for cut, reach in wounds(colon, tissue):
                eye.appearance.bleed(cut, reach)
        elif name.startswith("residue"):
            eye = Endoscope(
                colon, lens, surface=surface, appearance=Appearance(colon, surface, residue=Residue(_STOOL))
            )
        fine = eye.picture(pose).reshape(_SIZE, _SAMPLES, _SIZE, _SAMPLES, 3)
        pictures.append((name, fine.mean(axis=(1, 3)).astype(np.uint8)))
    sheet = Image.new("RGB", (4 * _SIZE, 4 * _SIZE), "black")
    text, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    for number, (name, picture) in enumerate(pictures):
        corner = (number % 4 * _SIZE, number // 4 * _SIZE)
        sheet.paste(Image.fromarray(picture), corner)
        text.text((corner[0] + 5, corner[1] + 4), f"{number + 1}", fill="white", font=font)
        text.text((corner[0] + 5, corner[1] + _SIZE - 20), name, fill="white", font=font)
    return write_atomically(path, lambda to: sheet.save(to, format="WEBP", quality=85))


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
