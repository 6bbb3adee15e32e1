from pathlib import Path

import pytest
from cogvideox_folder import KINDS
from imported_cogvideox import cogvideox_source, imported_cogvideox

from diff4splat.models.hub.model import Model, load_model

__all__ = ["cogvideox_source", "imported_cogvideox"]


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def model(imported_cogvideox: dict[str, Path], kind: str) -> Model:
    return load_model(imported_cogvideox[kind], parts=("vae", "text_encoder", "dit"))
