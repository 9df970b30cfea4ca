"""`python -m haustra.scripts.bench.pages.residue_sheet PICTURE.webp`: one wall clean, under mucus, under stool."""

import sys
from pathlib import Path

import numpy as np

_SIZE = 320
"""Rows and columns of a view [pixels]."""


def draw(path: Path) -> Path:
    """Draw the sheet."""
    from PIL import Image, ImageDraw, ImageFont

    from haustra.envs.view.picture.appearance import Appearance, Residue
    from haustra.envs.view.picture.endoscope import Endoscope
    from haustra.envs.view.picture.lens import named_lens
    from haustra.files import write_atomically
    from haustra.models.anatomy.grown import grow_colon
    from haustra.scripts.bench.sight.reference import LENS, PLACES, SEED, indented_look

    colon, lens = grow_colon(seed=SEED), named_lens(LENS).at(_SIZE, _SIZE)
    scope, pose = indented_look(colon, "transverse", PLACES["transverse"], lens)
    views = {
        "clean": Residue(),
        "mucus 0.3": Residue(mucus=0.3),
        "stool 0.35": Residue(stool=0.35),
        "stool 0.5, mucus 0.4": Residue(0.5, 0.4),
    }
    looks = [Appearance(colon, scope.surface, residue=residue) for residue in views.values()]
    eyes = [Endoscope(colon, lens, surface=scope.surface, appearance=each) for each in looks]
    sheet = Image.fromarray(np.hstack([eye.picture(pose) for eye in eyes]))
    text, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    for number, name in enumerate(views):
        text.text((number * _SIZE + 5, _SIZE - 20), name, fill="white", font=font)
    return write_atomically(path, lambda to: sheet.save(to, format="WEBP", quality=85))


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
