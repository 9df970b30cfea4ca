"""A clip of a short colon that moves, made once."""

from pathlib import Path

import pytest

from haustra.envs.view.dataset.make import make_dataset
from haustra.envs.view.dataset.moments import Source
from haustra.envs.view.dataset.settings import DatasetSettings

SETTINGS = DatasetSettings(clips=1, frames=3, width=96, height=77)


@pytest.fixture(scope="session")
def folder(source: Source, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of one clip of three small pictures."""
    where = tmp_path_factory.mktemp("dataset")
    make_dataset(where, SETTINGS, name="test", sources=iter([source]))
    return where
