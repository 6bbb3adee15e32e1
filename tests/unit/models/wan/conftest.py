from pathlib import Path

import pytest
from imported_models import KINDS, imported, wan_source

from diff4splat.models.hub.model import Model, load_model

__all__ = ["imported", "wan_source"]


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def model(imported: dict[str, Path], kind: str) -> Model:
    return load_model(imported[kind], parts=("vae", "text_encoder", "dit"))
