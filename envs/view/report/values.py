"""Scores and provenance as tables: keys that carry their unit become a name, a value and a unit."""

from collections.abc import Iterator, Mapping, Sequence

from haustra.envs.view.report.sections import Table

_UNITS = {
    "Nm": "N m",
    "N": "N",
    "m3": "m³",
    "mm": "mm",
    "m": "m",
    "s": "s",
    "kg": "kg",
    "kPa": "kPa",
    "turns": "turns",
    "deg": "°",
    "rad": "rad",
    "Hz": "Hz",
    "MB": "MB",
}


def name_and_unit(key: str) -> tuple[str, str]:
    """Split 'push_force_peak_N' into 'push force peak' and 'N'; the unit is '' when the key names none."""
    stem, _, suffix = key.rpartition("_")
    if stem and suffix in _UNITS:
        return stem.replace("_", " "), _UNITS[suffix]
    return key.replace("_", " "), ""


def shown(value: object) -> str:
    """A value as a person reads it: four significant digits, lists with commas."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(map(shown, value)) or "none"
    return "–" if value is None else str(value)


def score_table(scores: Mapping[str, object], *, title: str = "Scores", leave_out: Sequence[str] = ()) -> Table:
    """Scores with their units; nested values under dotted names, keys in `leave_out` not at all."""
    kept = {key: value for key, value in scores.items() if key not in leave_out}
    rows = []
    for key, value in flat(kept):
        name, unit = name_and_unit(key)
        rows.append((name, shown(value), unit))
    return Table(title, ("score", "value", "unit"), rows)


def provenance_table(provenance: Mapping[str, object], *, title: str = "Where this comes from (SI units)") -> Table:
    """Inputs, configuration and versions: enough to make the result again."""
    return Table(title, ("what", "value"), [(key, shown(value)) for key, value in flat(provenance)])


def flat(values: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    """Nested values one by one, under their keys joined by ' · '; mappings in a list are counted from 1."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{key} · ")
        elif isinstance(value, list | tuple) and value and all(isinstance(entry, Mapping) for entry in value):
            yield from flat({f"{key} {number}": entry for number, entry in enumerate(value, start=1)}, prefix)
        else:
            yield f"{prefix}{key}", value
