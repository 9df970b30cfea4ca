"""Files of strangers end in one line, and none takes long."""

import io
import time
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from haustra.errors import UnreadableFileError
from haustra.reading import read_arrays, read_document

BOMB = 'a: &a ["x","x","x","x","x","x","x","x","x"]\n' + "".join(
    f"{after}: &{after} [{','.join([f'*{name}'] * 9)}]\n" for name, after in zip("abcdefgh", "bcdefghi", strict=True)
)
DOCUMENTS: list[tuple[str, bytes, str]] = [
    ("bomb.yaml", BOMB.encode(), "stands for more than"),
    ("ring.yaml", b"a: &a [*a]", "nest more than 32 deep"),
    ("deep.toml", b"a = " + b"[" * 5000, "nest too deeply"),
    ("deep.json", b"[" * 100_000, "nest too deeply"),
    ("deep.yaml", b"[" * 5000, "nest too deeply"),
    ("keys.toml", b".".join([b"a"] * 500) + b" = 1", "nest more than 32 deep"),
    ("long.toml", b"a = " + b"1" * 5000, "is not TOML"),
    ("long.json", b"1" * 5000, "is not JSON"),
    ("huge.toml", b"#" * 5_000_000, "longer than 4 MB"),
    ("noise.toml", b"\xff\xfe\x00", "not text in UTF-8"),
    ("broken.toml", b"a = [", "is not TOML"),
    ("tag.yaml", b"!!python/object/apply:os.system ['echo x']", "is not YAML"),
]


@pytest.mark.parametrize(("name", "content", "message"), DOCUMENTS, ids=[name for name, *_ in DOCUMENTS])
def test_a_document_that_is_none(name: str, content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    began = time.process_time()
    with pytest.raises(UnreadableFileError, match=message) as refusal:
        read_document(tmp_path / name, "study")
    assert time.process_time() - began < 10
    assert len(str(refusal.value)) < 600 and "\n" not in str(refusal.value)


def test_a_byte_order_mark_is_no_mistake(tmp_path: Path) -> None:
    (tmp_path / "mark.toml").write_bytes(b"\xef\xbb\xbfa = 1\n")
    assert read_document(tmp_path / "mark.toml") == {"a": 1}


@pytest.mark.parametrize("path", [Path("none.toml"), Path("a\0b.toml"), Path("/")])
def test_a_file_that_is_not_there(path: Path) -> None:
    with pytest.raises(UnreadableFileError, match="Cannot read the design"):
        read_document(path, "design")


def archive(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(f"{name}.npy", content)
    return path


def saved(array: Any, **options: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, **options)
    return buffer.getvalue()


def test_zeros_are_not_unpacked_to_be_refused(tmp_path: Path) -> None:
    path = archive(tmp_path / "zeros.npz", points=saved(np.zeros(60_000_000)))
    assert path.stat().st_size < 1_000_000
    began = time.process_time()
    with pytest.raises(UnreadableFileError, match="unpacks to 480 MB, more than 400 MB"):
        read_arrays(path, ("points",))
    assert time.process_time() - began < 0.2


def test_arrays_that_lie_or_hold_objects_or_are_missing(tmp_path: Path) -> None:
    honest = saved(np.zeros(4))
    lying = honest.replace(b"(4,)", b"(4" + b"0" * 1 + b")")[: len(honest)]
    giant = honest.replace(b"'shape': (4,), }          ", b"'shape': (400000000000,), }")
    for name, content in {
        "lying": lying,
        "giant": giant,
        "empty": b"",
        "noise": b"\x93NUMPY\x01\x00\xff\xff" * 9,
    }.items():
        with pytest.raises(UnreadableFileError, match=r"damaged"):
            read_arrays(archive(tmp_path / f"{name}.npz", points=content), ("points",))
    with pytest.raises(UnreadableFileError, match="damaged"):
        pickled = saved(np.array([{"a": 1}], dtype=object), allow_pickle=True)
        read_arrays(archive(tmp_path / "pickled.npz", points=pickled), ("points",))
    with pytest.raises(UnreadableFileError, match="holds no array 'arc'"):
        read_arrays(archive(tmp_path / "some.npz", points=honest), ("points", "arc"))
    assert list(read_arrays(archive(tmp_path / "some.npz", points=honest), ("points", "arc"), some=True)) == ["points"]
