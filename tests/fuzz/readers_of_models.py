"""What training and fitting write: models, runs, latents, checkpoints of a fit."""

import shutil
import tempfile
from functools import cache
from pathlib import Path

import torch
from latent_folders import latent_folder, latents_of, learning_from, make_pack
from packed_models import trained_folder
from small_fits import ball_capture
from toy_training import Toy, ToySamples, ToyStage, toy_run

from diff4splat.fitting.checkpoints.checkpoint import load_checkpoint
from diff4splat.fitting.fit_types import FitRequest
from diff4splat.fitting.session import FitSession
from diff4splat.fitting.settings import FitSettings
from diff4splat.fitting.stages import coarse_stage
from diff4splat.models.hub.model import load_model
from diff4splat.models.hub.model_info import model_info
from diff4splat.training.latents.samples import LatentSamples
from diff4splat.training.prerequisites import last_checkpoint
from diff4splat.training.trainer.checkpoints.export import load_parts
from diff4splat.training.trainer.loop.fit import fit_stage
from fuzz.reader import Reader

_PARTS = ("vae", "deformation", "text_encoder")


def _write_model(folder: Path) -> None:
    trained_folder(folder)
    for part in ("dit", "ldrm", "monocular_depth", "motion_unet"):
        (folder / f"{part}.safetensors").unlink(missing_ok=True)


def _read_model(folder: Path) -> None:
    model_info(folder)
    load_model(folder, _PARTS)


def _write_run(folder: Path) -> None:
    fit_stage(ToyStage(), ToySamples(), Toy(steps=2).recipe(), toy_run(folder, checkpoint_every=1))
    shutil.rmtree(folder / "tensorboard", ignore_errors=True)


def _read_run(folder: Path) -> None:
    """Tensors without their digests, what the next stage takes, and the run that goes on."""
    with tempfile.TemporaryDirectory(dir=folder.parent) as copy:
        copied = Path(copy) / "run"
        shutil.copytree(folder, copied, symlinks=True, copy_function=_linked)
        errors = []
        for read in (_read_checkpoints, _read_stage, _go_on):
            try:
                read(copied)
            except Exception as error:
                errors.append(error)
        if errors:
            raise errors[0]


def _linked(source: str, target: str) -> None:
    """Pipes and devices cannot be copied."""
    plain = Path(source).is_file() and not Path(source).is_symlink()
    shutil.copy(source, target) if plain else Path(target).symlink_to(source)


def _read_checkpoints(folder: Path) -> None:
    for checkpoint in sorted((folder / "checkpoints").glob("window-*")):
        load_parts(checkpoint)


def _read_stage(folder: Path) -> None:
    load_parts(last_checkpoint(folder))


def _go_on(folder: Path) -> None:
    fit_stage(ToyStage(), ToySamples(), Toy(steps=2).recipe(), toy_run(folder))


def _write_latents(folder: Path) -> None:
    latent_folder(folder, make_pack([True, False]), make_pack([False], first=2))


def _read_latents(folder: Path) -> None:
    samples = LatentSamples(learning_from(latents_of(folder)), 0)
    samples.collate([samples[0], samples[1]])


@cache
def _session(folder: Path) -> FitSession:
    settings = FitSettings(motion="static", coarse_steps=2, fine_steps=2, harmonics=0, points=8)
    capture = ball_capture(views=2, times=2, held=(1,))
    return FitSession(FitRequest(capture=capture, settings=settings, folder=folder))


def _write_fit(folder: Path) -> None:
    session = _session(folder)
    loop = coarse_stage(session, None)
    session.save(loop)


def _read_fit(folder: Path) -> None:
    session = _session(folder)
    state = load_checkpoint(folder, session.fingerprint)
    if state is not None:
        loop = coarse_stage(session, state)
        with torch.no_grad():
            loop.model.scene(0, session.renderer.path)


MODELS = {
    "model folder": Reader(make=_write_model, read=_read_model),
    "run folder": Reader(make=_write_run, read=_read_run),
    "latents": Reader(make=_write_latents, read=_read_latents),
    "fit checkpoint": Reader(make=_write_fit, read=_read_fit),
}
