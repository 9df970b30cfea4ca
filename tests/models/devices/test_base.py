"""Devices by name and by file, and what a bad file is told."""

import tomllib
from pathlib import Path

import pytest

from haustra.assets import assets
from haustra.errors import InvalidDesignError, UnreadableFileError
from haustra.models.devices.base import kinds, load_device, shipped_devices
from haustra.models.devices.scope.files import save_design
from haustra.models.devices.scope.library import named_design


def test_every_shipped_name_gives_a_device_of_that_name():
    assert {"adult", "paediatric", "tracked"} <= set(shipped_devices())
    for name in shipped_devices():
        device = load_device(name)
        assert device.name == name and device.kind in kinds()
        assert device.controls
        assert device.describe()["kind"] == device.kind


def test_a_file_of_a_scope_needs_no_kind(tmp_path: Path):
    path = save_design(named_design("adult"), tmp_path / "mine.toml")
    assert load_device(path).kind == "scope"


@pytest.mark.parametrize("path", assets("devices", ".toml").values(), ids=lambda path: path.stem)
def test_every_shipped_number_has_a_unit_a_range_and_a_source(path: Path):
    def check(table: dict) -> None:
        for name, value in table.items():
            if name == "at_scale" or isinstance(value, str):
                continue
            if name == "design" or "value" not in value:  # parts of a design
                check(value)
            else:
                assert {"value", "unit", "low", "high", "source"} <= set(value), name

    check(tomllib.loads(path.read_text(encoding="utf-8")))


def changed(tmp_path: Path, old: str, new: str) -> Path:
    text = assets("devices", ".toml")["tracked"].read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "changed.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('kind = "tracked"', 'kind = "os.system"', "kind 'os.system' is not known. Known: "),
        ('kind = "tracked"', 'kind = "tracked"\nweight = 3', "'weight' is not known. Known: name, design, rpm"),
        ('name = "tracked"\n', "", "'name' is missing: add it"),
        ("value = 150", "value = 1500", "is not inside [75, 300]"),
        ("value = 150\n", "value = 2000\n", "is not inside"),
        ('unit = "1/min"', 'unit = "rad/s"', "is in 'rad/s'; give it in '1/min'"),
        ('steering = "none"', 'steering = "by wire"', "steering 'by wire' is not known. Known: none, each tread"),
        ('steering = "none"', "steering = 3", "steering 3 is not known"),
    ],
)
def test_what_is_wrong_with_a_file_is_one_line(tmp_path: Path, old: str, new: str, message: str):
    with pytest.raises(InvalidDesignError) as error:
        load_device(changed(tmp_path, old, new))
    assert message in str(error.value) and "\n" not in str(error.value)


def test_unknown_names_and_files_are_refused(tmp_path: Path):
    with pytest.raises(InvalidDesignError, match=r"Device '\.\./numbers/scope' is not known. Known: adult"):
        load_device("../numbers/scope")
    with pytest.raises(UnreadableFileError, match="Cannot read the device"):
        load_device(tmp_path / "none.toml")
