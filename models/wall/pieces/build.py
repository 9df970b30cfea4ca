"""From a colon to its wall."""

import functools
import time
import zipfile
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float
from manifold3d import Manifold

from haustra.children import cores
from haustra.errors import InvalidOptionError, OutputError, UnreadableFileError, WallAccuracy
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.store import colon_hash
from haustra.models.wall import cache
from haustra.models.wall.pieces.blocks import SLIVER, Block, corners, cut_blocks, lumen_solid
from haustra.models.wall.pieces.cells import place_sites, power_cells
from haustra.models.wall.pieces.clearing import Cleared, clear_neighbours
from haustra.models.wall.pieces.measure import measure
from haustra.models.wall.pieces.neighbours import Neighbours
from haustra.models.wall.pieces.packing import pack_block, unpack_hulls
from haustra.models.wall.pieces.pool import run_blocks
from haustra.models.wall.pieces.split import convex_parts
from haustra.models.wall.pieces.store import load_wall, save_wall
from haustra.models.wall.pieces.wall import Wall, WallPiece
from haustra.provenance import Provenance, content_hash

Method = Literal["coacd", "prism"]
Progress = Callable[[str, int, int], None]
"""Told what is being done, how much of it is done, and how much there is."""
_Stretch = list[tuple[Block, list[np.ndarray]]]
"""All blocks of a stretch of the colon, each with its hulls."""
ALGORITHM = "3"
"""Part of every cache key; raised when the same options give other pieces."""
_ASSEMBLY = "3"
"""Part of the key of a whole wall; raised when the same blocks give another wall or another error, kept with it."""
TOLERANCE: dict[Method, float] = {"coacd": 1.5e-3, "prism": 0.8e-3}
"""Default tolerance [m]: what keeps the 95th percentile of the intrusion below 1.0 mm and 0.4 mm (docs/decisions)."""
WIDENING = 0.3
"""Mean depth of the pieces in the lumen over the tolerance, measured on two CT colons and a grown one: 0.25 to 0.35."""
SIMPLIFICATION = 0.4
"""Share of the tolerance; 0.6 mm halves the triangles of a CT surface and costs 0.1 mm of recess."""
BLOCK_LIMIT = 60.0
"""Seconds for one block; typical ones take below two, so one that takes longer hangs."""


@dataclass(frozen=True)
class WallOptions:
    """What shapes a wall. SI units."""

    method: Method = "coacd"
    """How blocks are made convex: CoACD's search, or cuts where the hull stands deepest in the lumen."""
    tolerance: float = 0.0015
    """Largest depth [m] of a piece in the lumen that is aimed at."""
    thickness: float = 0.030
    """How far pieces reach beyond the lumen [m], where no other loop and no inside of a bend stands in the way."""
    spacing: float = 0.020
    """Length of a block along the centreline [m]."""
    sectors: int = 8
    """Blocks around the centreline."""

    @property
    def widening(self) -> float:
        """How far the lumen is widened before it is cut out [m], to centre the error; less where tissue is thin."""
        return WIDENING * self.tolerance

    @property
    def simplification(self) -> float:
        """How far the lumen surface may move when it is simplified before it is cut out [m]."""
        return SIMPLIFICATION * self.tolerance

    def __post_init__(self) -> None:
        if self.method not in get_args(Method):
            raise InvalidOptionError(f"Wall method '{self.method}' is not known. Known: {', '.join(get_args(Method))}.")
        for name, low, high in (
            ("tolerance", 1e-4, 1e-2),
            ("thickness", 3e-3, 0.1),
            ("spacing", 5e-3, 0.1),
            ("sectors", 4, 32),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise InvalidOptionError(
                    f"Wall option {name} is {value}: give a value from {low} to {high} (SI units)."
                )


def build_wall(
    colon: Colon,
    *,
    method: Method = "coacd",
    thickness: float = WallOptions.thickness,
    tolerance: float | None = None,
    max_error_mm: float | None = None,
    workers: int | None = None,
    rays: int = 20_000,
    use_cache: bool = True,
    progress: Progress | None = None,
) -> Wall:
    """Build the thick shell outside the lumen as convex pieces, and measure its error.

    Args:
        colon: The colon.
        method: 'coacd' or 'prism'.
        thickness: How far pieces reach beyond the lumen [m].
        tolerance: Largest depth of a piece in the lumen that is aimed at [m]; `TOLERANCE` when left out.
        max_error_mm: Largest 95th percentile of the intrusion that is accepted [mm], and largest depth of
            a piece in the lumen of another loop.
        workers: Child processes; as many as there are cores when left out.
        rays: Rays that measure the error.
        use_cache: Whether to reuse and keep blocks and walls in the cache folder.
        progress: Told what is done.

    Raises:
        InvalidOptionError: when an option is out of range.
        InvalidMeshError: when the lumen bounds no solid.
        WallError: when no piece came out, or the error exceeds `max_error_mm`.
    """
    began = time.perf_counter()
    aimed = TOLERANCE.get(method, 0.0) if tolerance is None else tolerance
    options = WallOptions(method=method, thickness=thickness, tolerance=aimed)
    if rays < 1000 or (workers is not None and workers < 1):
        raise InvalidOptionError(f"A wall needs at least 1000 rays and 1 worker, not {rays} and {workers}.")
    tell = progress or (lambda what, done, total: None)
    digest = colon_hash(colon)
    key = content_hash(ALGORITHM.encode(), _ASSEMBLY.encode(), digest.encode(), repr((asdict(options), rays)).encode())
    wall = _from_cache(key) if use_cache else None
    if wall is None:
        count = workers or cores()
        cleared, counts = _make_pieces(colon, options, count, use_cache, tell)
        pieces = tuple(piece for stretch in cleared for piece in stretch.pieces)
        if not pieces:
            raise WallAccuracy(f"No piece of wall came out of colon '{colon.name}': check it with 'haustra view'.")
        tell("measuring", 0, 1)
        error, beside = measure(colon, pieces, [stretch.left for stretch in cleared], rays=rays, threads=count)
        tell("measuring", 1, 1)
        wall = Wall(
            method=method,
            pieces=pieces,
            error=error,
            provenance=Provenance(inputs={colon.name: digest}, configuration={**asdict(options), "rays": rays}),
            metadata={
                "thickness_m": thickness,
                "tolerance_m": aimed,
                **counts,
                "pieces_cut_back": sum(stretch.cut for stretch in cleared),
                **beside,
                "cached": False,
            },
        )
        if use_cache:
            _keep(wall, key)
    if max_error_mm is not None:
        _refuse_over(max_error_mm, wall, colon.name, aimed)
    return replace(wall, metadata={**wall.metadata, "seconds": time.perf_counter() - began})


def _refuse_over(max_error_mm: float, wall: Wall, name: str, tolerance: float) -> None:
    depth, beside = wall.error.intrusion_p95_mm, wall.error.neighbour_max_mm or 0.0
    if depth > max_error_mm:
        raise WallAccuracy(
            f"The wall stands {depth:.2f} mm in the lumen of '{name}' (95th percentile), "
            f"more than the {max_error_mm:g} mm asked for: lower the tolerance ({1e3 * tolerance:g} mm) or accept more."
        )
    if beside > max_error_mm:
        raise WallAccuracy(
            f"The wall of one loop stands up to {beside:.2f} mm in the lumen of another in '{name}', "
            f"more than the {max_error_mm:g} mm asked for: loops may have grown together there ('haustra colon check')."
        )


def _make_pieces(
    colon: Colon, options: WallOptions, workers: int, use_cache: bool, tell: Progress
) -> tuple[list[Cleared], dict[str, int]]:
    """The pieces of each stretch, cleared in turn while the children decompose further ones."""
    cleared: list[Cleared] = []
    neighbours = functools.cache(lambda: Neighbours(colon))  # made when all is cut: until then children may wait

    def whole(stretch: _Stretch) -> None:
        pieces = [
            WallPiece(sound, block.site.start, block.site.end)
            for block, found in stretch
            for hull in found
            if (sound := _sound(hull)) is not None
        ]
        cleared.append(clear_neighbours(neighbours(), pieces))

    counts = _decompose(_cut(colon, options, tell), options, workers, use_cache, tell, whole)
    return cleared, counts


def _cut(colon: Colon, options: WallOptions, tell: Progress) -> Iterator[Block]:
    tell("cutting", 0, 1)
    lumen = lumen_solid(colon, widening=options.widening, simplification=options.simplification)
    sites = place_sites(colon, spacing=options.spacing)
    for number, cell in enumerate(power_cells(sites, thickness=options.thickness)):
        yield from cut_blocks(cell, lumen, sectors=options.sectors, thickness=options.thickness)
        tell("cutting", number + 1, len(sites))


def _decompose(
    cut: Iterator[Block],
    options: WallOptions,
    workers: int,
    use_cache: bool,
    tell: Progress,
    whole: Callable[[_Stretch], None],
) -> dict[str, int]:
    """Decompose all blocks: how many came from the cache, fell back to plain cuts, or are one piece.

    `whole` is given the stretches in turn, each as soon as all is cut and all of the stretch is decomposed.
    """
    settings = repr((ALGORITHM, options.method, options.tolerance)).encode()
    blocks: list[Block] = []
    paths: list[Path] = []
    hulls: dict[int, list[np.ndarray]] = {}
    missing: list[int] = []
    stretches: deque[list[int]] = deque()
    counts = {"blocks_fallen_back": 0}

    def not_cached() -> Iterator[bytes]:
        for block in cut:
            data, index = pack_block(block), len(blocks)
            blocks.append(block)
            paths.append(cache.block_path(content_hash(settings, data)))
            found = _read_hulls(paths[index]) if use_cache else None
            if found is None:
                missing.append(index)
                yield data
            else:
                hulls[index] = found
        stretches.extend(
            list(own) for _, own in groupby(range(len(blocks)), key=lambda index: blocks[index].site.start)
        )
        give()

    def give() -> None:
        while stretches and all(index in hulls for index in stretches[0]):
            whole([(blocks[index], hulls[index]) for index in stretches.popleft()])

    def done(number: int, answer: bytes | None) -> None:
        index = missing[number]
        if answer is None:
            counts["blocks_fallen_back"] += 1
            hulls[index] = [corners(hull) for hull in convex_parts(blocks[index], tolerance=options.tolerance)]
        else:
            hulls[index] = unpack_hulls(answer)
            if use_cache:
                cache.keep(paths[index], answer)
        tell("decomposing", len(hulls), len(blocks))
        give()

    run_blocks(
        not_cached(),
        method=options.method,
        tolerance=options.tolerance,
        workers=workers,
        limit=BLOCK_LIMIT,
        done=done,
    )
    return counts | {
        "blocks": len(blocks),
        "blocks_cached": len(blocks) - len(missing),
        # A block that is convex within the tolerance never reaches CoACD.
        "blocks_of_one_piece": sum(len(found) == 1 for found in hulls.values()),
    }


def _sound(vertices: Float[np.ndarray, "vertices 3"]) -> np.ndarray | None:
    """The corners of a hull without inner points, or None for one too flat to hold anything up."""
    hull = Manifold.hull_points(vertices)
    return np.ascontiguousarray(corners(hull)) if hull.volume() > SLIVER else None


def _read_hulls(path: Path) -> list[np.ndarray] | None:
    data = cache.read(path)
    if data is None:
        return None
    try:
        return unpack_hulls(data)
    except (ValueError, OSError, KeyError, zipfile.BadZipFile):
        return None


def _from_cache(key: str) -> Wall | None:
    try:
        wall = load_wall(cache.wall_path(key))
    except UnreadableFileError:
        return None
    return replace(wall, metadata={**wall.metadata, "cached": True})


def _keep(wall: Wall, key: str) -> None:
    try:
        save_wall(wall, cache.wall_path(key))
    except OutputError:  # a cache that cannot be written is no reason to fail
        return
