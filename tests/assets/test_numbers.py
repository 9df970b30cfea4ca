"""Every physical number can answer for itself."""

import tomllib
from pathlib import Path

import pytest

from haustra.assets import asset
from haustra.errors import HaustraError
from haustra.quantity import load_quantities

FILES = sorted(asset("numbers/scope.toml").parent.glob("*.toml"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_number_has_unit_range_and_source(path: Path) -> None:
    for name, quantity in load_quantities(path).items():
        assert quantity.unit.strip(), name
        assert len(quantity.source.strip()) > 10, f"{name}: '{quantity.source}' names no source"
        assert quantity.low <= quantity.value <= quantity.high, name


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_no_number_hides_outside_an_entry(path: Path) -> None:
    def bare(table: dict, prefix: str = "") -> list[str]:
        if "value" in table:
            return []
        return [
            name
            for key, entry in table.items()
            for name in (bare(entry, f"{prefix}{key}.") if isinstance(entry, dict) else [f"{prefix}{key}"])
        ]

    assert bare(tomllib.loads(path.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(
    ("entry", "complaint"),
    [
        ('value = 1\nlow = 0\nhigh = 2\nsource = "doi"', "unit"),
        ('value = 1\nunit = "m"\nlow = 0\nhigh = 2', "source"),
        ('value = 1\nunit = "m"\nlow = 0\nhigh = 2\nsource = ""', "source"),
        ('value = 3\nunit = "m"\nlow = 0\nhigh = 2\nsource = "doi"', "not inside"),
        ('value = nan\nunit = "m"\nlow = 0\nhigh = 2\nsource = "doi"', "not finite"),
    ],
)
def test_an_entry_that_cannot_answer_is_refused(tmp_path: Path, entry: str, complaint: str) -> None:
    path = tmp_path / "numbers.toml"
    path.write_text(f"[scope.diameter]\n{entry}\n", encoding="utf-8")
    with pytest.raises(HaustraError, match=complaint) as caught:
        load_quantities(path)
    assert "scope.diameter" in str(caught.value)


def test_a_real_scope_is_not_a_uniform_elastic_rod() -> None:
    """A homogeneous round rod has GJ/EI = 1/(1 + nu) <= 1; a colonoscope's braid makes it about 13."""
    scope = load_quantities(asset("numbers/scope.toml"))
    ratio = scope["scope.adult.torsional_rigidity"].value / scope["scope.adult.flexural_rigidity"].value
    assert 10 < ratio < 20
