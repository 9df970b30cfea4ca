"""What a data set is made of, and the presets by name."""

from collections.abc import Mapping
from dataclasses import dataclass

from haustra.envs.view.picture.appearance import Residue
from haustra.envs.view.picture.light import Response
from haustra.errors import InvalidOptionError
from haustra.fields import number, require_declared, texts, whole


@dataclass(frozen=True)
class DatasetSettings:
    """Colons, runs and pictures of a data set; each colon is grown from a seed of its own and insufflated."""

    colons: int = whole(1, 1000, default=1)
    """Colons, each with one run of a scope."""
    clips: int = whole(1, 1000, default=2)
    """Stretches of each run, evenly spread over it; a folder each."""
    frames: int = whole(2, 9999, default=16)
    """Pictures in each clip, one after the other."""
    width: int = whole(64, 2700, default=338)
    """Columns of a picture [pixels]."""
    height: int = whole(64, 2160, default=270)
    """Rows of a picture [pixels]."""
    rate: float = number("1/s", 0.1, 50.0, default=25.0)
    """Pictures a second; a whole part of a run's records, 50 of an insertion and 10 of a withdrawal."""
    seconds: float = number("s", 1.0, 600.0, default=60.0)
    """Longest insertion, in simulated time [s]."""
    difficulty: str = "easy"
    """Band of tortuosity of the colons."""
    polyps: tuple[str, ...] = texts(most=50, default=())
    """Polyps of each colon, as `haustra colon grow` takes them."""

    gamma: float = number("1", 0.5, 5.0, default=2.2)
    """Brightness goes with light to the power of 1 / gamma [1]."""
    gain: float | None = number("1", 1e-9, 1.0, default=None)
    """Fixed exposure of light (in units of a guide's at 1 m) [1]; automatic for each picture when none."""
    noise: float = number("1", 0.0, 0.5, default=0.0)
    """Standard deviation of noise at full light, of the most that fits [1]; it falls as the root of light."""
    exposure: float = number("s", 0.0, 0.04, default=0.0)
    """Time for which a picture is exposed, around that of its ground truth, for motion blur [s]; 0 for none."""
    stool: float = number("1", 0.0, 1.0, default=0.0)
    """Share of the lower wall under stool [1]."""
    mucus: float = number("1", 0.0, 1.0, default=0.0)
    """Share of the wall under mucus [1]."""

    def __post_init__(self) -> None:
        require_declared(self)

    @property
    def response(self) -> Response:
        """What the camera makes of light."""
        return Response(gamma=self.gamma, gain=self.gain, noise=self.noise, exposure=self.exposure)

    @property
    def residue(self) -> Residue:
        """What lies on the wall."""
        return Residue(stool=self.stool, mucus=self.mucus)

    def every(self, interval: float) -> int:
        """Records of a run from one picture to the next, by the time between two records [s]."""
        return max(1, round(1 / (self.rate * interval)))


_POLYPS = ("sigmoid:small", "sigmoid:diminutive:flat", "descending:small", "transverse:large:pedunculated")
PRESETS: Mapping[str, DatasetSettings] = {
    "quick": DatasetSettings(polyps=_POLYPS),
    "standard": DatasetSettings(
        colons=4, clips=8, frames=75, width=675, height=540, difficulty="any", polyps=(*_POLYPS, "ascending:small*2")
    ),
    "full": DatasetSettings(
        colons=20,
        clips=10,
        frames=200,
        width=1350,
        height=1080,
        difficulty="any",
        polyps=(*_POLYPS, "ascending:small*2", "caecum:diminutive"),
    ),
}
"""quick: some tens of small pictures within a minute. standard: 2,400 pictures at half the size of C3VD's. full: 40,000
pictures at C3VD's size."""


def find_preset(name: str) -> DatasetSettings:
    """The preset of that name.

    Raises:
        InvalidOptionError: when there is none; the message lists those there are.
    """
    if name not in PRESETS:
        raise InvalidOptionError(f"Data set '{name}' is not known. Known: {', '.join(PRESETS)}.")
    return PRESETS[name]
