"""Checkpoints of a fit with other contents than a fit writes."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from small_fits import ball_capture

from diff4splat.errors import Diff4SplatError
from diff4splat.fitting.checkpoints.checkpoint import (
    CHECKPOINT_FILE,
    FitState,
    load_checkpoint,
    save_checkpoint,
)
from diff4splat.fitting.fit_types import FitRequest
from diff4splat.fitting.session import FitSession
from diff4splat.fitting.settings import FitSettings
from diff4splat.fitting.stages import COARSE, FINE, coarse_stage, fine_stage
from diff4splat.io.scene_files.tensor_file import (
    TensorFile,
    read_metadata,
    read_tensors,
    write_tensors,
)

SETTINGS = FitSettings(motion="static", coarse_steps=2, fine_steps=2, harmonics=0, points=8)


@pytest.fixture
def session(tmp_path: Path) -> FitSession:
    capture = ball_capture(views=2, times=2, held=(1,))
    session = FitSession(FitRequest(capture=capture, settings=SETTINGS, folder=tmp_path))
    session.save(coarse_stage(session, None))
    return session


def _resumed(session: FitSession) -> None:
    coarse_stage(session, load_checkpoint(session.request.folder, session.fingerprint))


def test_a_whole_one_is_taken(session: FitSession) -> None:
    _resumed(session)


@pytest.mark.parametrize(
    "change",
    [
        *({"step": -1}, {"step": 10**400}, {"step": "two"}, {"stage": "a"}, {"stage": None}),
        *({"seconds": 10**400}, {"fingerprint": 3}, {"other": 1}),
    ],
)
def test_other_progress_is_refused(session: FitSession, change: dict) -> None:
    file = session.request.folder / CHECKPOINT_FILE
    metadata = read_metadata(file)
    metadata["fit"] = json.dumps(json.loads(metadata["fit"]) | change)
    write_tensors(TensorFile(tensors=read_tensors(file), metadata=metadata), file)
    with pytest.raises(Diff4SplatError, match=r"checkpoint\.safetensors: .*expected"):
        _resumed(session)


@pytest.mark.parametrize("text", ["", "[]", "[" * 100_000, "9" * 5000])
def test_other_text_is_refused(session: FitSession, text: str) -> None:
    file = session.request.folder / CHECKPOINT_FILE
    metadata = read_metadata(file) | {"fit": text}
    write_tensors(TensorFile(tensors=read_tensors(file), metadata=metadata), file)
    with pytest.raises(Diff4SplatError, match="expected"):
        _resumed(session)


@pytest.mark.parametrize(
    "change",
    [
        lambda tensor: None,
        lambda tensor: tensor[:0],
        lambda tensor: tensor[None],
        lambda tensor: tensor.double() * float("nan"),
        lambda tensor: (tensor != 0).byte(),
    ],
)
@pytest.mark.parametrize("name", ["moves", "table/means", "table/sh_dc", "fixed/pull_total"])
def test_other_tensors_are_refused(
    session: FitSession, name: str, change: Callable[[torch.Tensor], torch.Tensor | None]
) -> None:
    file = session.request.folder / CHECKPOINT_FILE
    tensors, metadata = read_tensors(file), read_metadata(file)
    changed = change(tensors.pop(name))
    tensors |= {} if changed is None else {name: changed}
    write_tensors(TensorFile(tensors=tensors, metadata=metadata), file)
    with pytest.raises(Diff4SplatError, match="expected"):
        _resumed(session)


def test_a_fine_stage_without_its_bounds_is_refused(session: FitSession) -> None:
    state = load_checkpoint(session.request.folder, session.fingerprint)
    assert isinstance(state, FitState) and state.stage == COARSE
    save_checkpoint(replace(state, stage=FINE), session.request.folder)
    found = load_checkpoint(session.request.folder, session.fingerprint)
    with pytest.raises(Diff4SplatError, match="bounds: expected float32 of shape"):
        fine_stage(session, found, None)
