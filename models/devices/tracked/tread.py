"""The tread, its strut tips and the tissue strip it is pressed on, as one value."""

from dataclasses import asdict, dataclass

from haustra.assets import asset
from haustra.errors import InvalidDesignError
from haustra.fields import number, require_declared
from haustra.quantity import load_quantities

NUMBERS = load_quantities(asset("numbers/tracked.toml"))
"""Every number of the tracked robot with its unit, range and source."""


@dataclass(frozen=True, kw_only=True)
class TreadGeometry:
    """One track's tread over one strut's two tips, at the 4:1 scale of the published prototype. SI units.

    The paper gives the width, the tissue thickness and the worm's lead. It does not give the tooth, the belt and the
    tips, only that their spacing is "very close to a multiple of the distance between the tread teeth": those defaults
    are assumed, chosen so that the finite-element reference shows the published ripple and stress ratio
    (docs/theory/tracked.md says which figure fixed which length).
    """

    pitch: float = number("m", 1e-5, 0.2, default=NUMBERS["tracked.tread.pitch"].value)
    """Distance between teeth [m]. Assumed: 13 mm of track a worm turn / 2 starts."""
    tooth_width: float = number("m", 1e-5, 0.2, default=NUMBERS["tracked.tread.tooth_width"].value)
    """Length of a tooth's face along the track [m]. Assumed: half the pitch."""
    tooth_height: float = number("m", 1e-5, 0.2, default=NUMBERS["tracked.tread.tooth_height"].value)
    """From the belt's outer face to the tooth's face [m]. Assumed."""
    belt_thickness: float = number("m", 1e-5, 0.2, default=NUMBERS["tracked.tread.belt_thickness"].value)
    """[m]. Assumed."""
    tip_radius: float = number("m", 1e-5, 0.2, default=NUMBERS["tracked.tread.tip_radius"].value)
    """Radius of a strut tip's circular contact [m]. Assumed."""
    tip_spacing: float = number("m", 1e-5, 0.2, default=NUMBERS["tracked.tread.tip_spacing"].value)
    """Between the two tips of a strut set, along the track [m]. Assumed: 3.0 pitches."""
    width: float = number("m", 1e-5, 0.2, default=NUMBERS["tracked.tread.width"].value)
    """Width of tread and tissue strip, out of the plane [m]. Published."""
    tissue_thickness: float = number("m", 1e-5, 0.2, default=NUMBERS["tracked.tread.tissue_thickness"].value)
    """[m]. Published."""
    clearance: float = number("m", 1e-5, 0.2, default=NUMBERS["tracked.tread.clearance"].value)
    """Gap between teeth and tissue where the tread's ends are held [m]. Assumed: the paper holds the ends so that
    the tread touches only near the tips."""

    def __post_init__(self) -> None:
        require_declared(self, "Tread", error=InvalidDesignError)
        if self.tooth_width >= self.pitch:
            raise InvalidDesignError(
                f"Tooth width {self.tooth_width * 1e3:g} mm is not smaller than the pitch {self.pitch * 1e3:g} mm: "
                "there would be no gap between teeth; narrow the tooth or raise the pitch."
            )

    @property
    def spacing_in_pitches(self) -> float:
        """Tip spacing over pitch: its fraction decides whether the two tips' ripples add or cancel."""
        return self.tip_spacing / self.pitch

    def to_json(self) -> dict[str, float]:
        """As plain JSON values [m]."""
        return asdict(self)
