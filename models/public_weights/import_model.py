"""A public Wan model as one of our model folders.

    transformer/   ─ renamed ─ + camera adapter, render condition (zero) ─ dit.safetensors
    vae/           ─────────── + latent mean and standard deviation ────── vae.safetensors
    text_encoder/  ─ renamed ───────────────────────────────────────────── text_encoder.safetensors
    tokenizer/tokenizer.json ───────────────────────────────────────────── tokenizer.json

Weights are copied byte by byte in the type that they have. All configurations and headers are
checked before the first byte is written.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Tensor

from diff4splat.errors import CheckpointError
from diff4splat.io.atomic import atomic_folder, write_text
from diff4splat.models.adapters.tuning import ADDED
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.checksums import SUMS_FILE, write_sums
from diff4splat.models.hub.provenance import (
    NOT_STATED,
    PROVENANCE_FILE,
    ModelProvenance,
    write_provenance,
)
from diff4splat.models.hub.weight_files import CONFIG_FILE, part_file
from diff4splat.models.public_weights.merge import Shapes, match_keys, write_merged
from diff4splat.models.public_weights.shard_files import StoredTensor, stored_tensors
from diff4splat.models.public_weights.source_folder import SourceFolder, require_class
from diff4splat.models.video_dit.camera_adapter import CameraAdapter
from diff4splat.models.video_dit.render_condition import RenderConditionEmbedding
from diff4splat.models.wan import source_config
from diff4splat.models.wan.key_map import video_dit_key
from diff4splat.models.wan.tokenizer import TOKENIZER_FILE
from diff4splat.models.wan.umt5 import umt5_key

IMPORTED = ("vae", "text_encoder", "dit")
"""Parts that the public model has; the others are ours, to be trained."""
FOLDERS = {"vae": "vae", "text_encoder": "text_encoder", "dit": "transformer"}
RENAME: Mapping[str, Callable[[str], str | None]] = {
    "vae": str,
    "text_encoder": umt5_key,
    "dit": video_dit_key,
}
OWNED = (CONFIG_FILE, PROVENANCE_FILE, SUMS_FILE, TOKENIZER_FILE)
DEFAULT_FRAMES = 49
DEFAULT_SIZE_PX = {8: (480, 832), 16: (704, 1280)}
"""By the stride of the autoencoder: what Wan 2.1 and TI2V-5B were trained at."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportOptions:
    """What the public model does not decide."""

    reconstruction: str = "paper"
    """The size whose LDRM and deformation network the model gets."""
    frames: int = DEFAULT_FRAMES
    size_px: tuple[int, int] | None = None
    """(height, width); None: what the public model was trained at."""
    seed: int = 0
    """Of the new layers that are not zero."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PublicModel:
    """A folder whose weights are all accounted for; none are read yet."""

    folder: SourceFolder
    config: ModelConfig
    tensors: Mapping[str, Mapping[str, StoredTensor]]
    """By part, under our names."""
    fresh: Mapping[str, Mapping[str, Tensor]]
    """What is added to each part."""
    shapes: Mapping[str, Shapes]

    @property
    def size(self) -> int:
        """Bytes of all weights."""
        return sum(tensor.size for part in self.tensors.values() for tensor in part.values())

    def summary(self) -> str:
        """One line per part: weights, bytes, and what is added."""
        lines = []
        for part, tensors in self.tensors.items():
            size = sum(tensor.size for tensor in tensors.values()) / 1e9
            kinds = " and ".join(sorted({tensor.dtype for tensor in tensors.values()}))
            added = ", ".join(sorted({key.split(".")[0] for key in self.fresh[part]})) or "nothing"
            lines.append(
                f"{part:<14}{len(tensors):>5} tensors{size:>9.3f} GB in {kinds}; "
                f"none unknown, none missing; added: {added}"
            )
        return "\n".join(lines)


def open_public_model(root: Path, settings: ImportOptions | None = None) -> PublicModel:
    """Check a folder in the layout of diffusers, and match every weight.

    Raises:
        CheckpointError: another architecture, a missing file, unknown or missing weights.
        FileFormatError: a damaged or cut off file, or one with another hash.
    """
    settings, folder = settings or ImportOptions(), SourceFolder(root=root)
    config = _model_config(folder, settings)
    fresh = {
        "vae": _statistics(folder, config),
        "text_encoder": {},
        "dit": _added(config, settings),
    }
    networks = dict(create_networks(config, "meta", parts=IMPORTED).parts())
    shapes = {
        part: {key: tuple(value.shape) for key, value in networks[part].state_dict().items()}
        for part in IMPORTED
    }
    tensors = {
        part: match_keys(
            stored_tensors(folder, FOLDERS[part]),
            {key: shape for key, shape in shapes[part].items() if key not in fresh[part]},
            RENAME[part],
            f"{root / FOLDERS[part]}",
        )
        for part in IMPORTED
    }
    return PublicModel(folder=folder, config=config, tensors=tensors, fresh=fresh, shapes=shapes)


def write_model(
    model: PublicModel,
    out: Path,
    license: str = NOT_STATED,
    advance: Callable[[int], None] = lambda count: None,
) -> None:
    """Write our model folder whole or not at all; ``advance`` gets the bytes as they are copied.

    Raises:
        OutputError: the folder cannot be written.
    """
    tokenizer = model.folder.file(f"tokenizer/{TOKENIZER_FILE}").read_bytes()
    name = model.folder.root.resolve().name
    provenance = ModelProvenance(
        trained=frozenset(IMPORTED), license=license, origin=f"imported from {name}"
    )
    owned = (*OWNED, *(part_file(Path(), part).name for part in IMPORTED))
    with atomic_folder(out, owned) as staging:
        for part, tensors in model.tensors.items():
            file = part_file(staging, part)
            write_merged(tensors, model.fresh[part], model.shapes[part], file, advance)
        (staging / TOKENIZER_FILE).write_bytes(tokenizer)
        write_text(staging / CONFIG_FILE, model.config.to_json())
        write_provenance(provenance, staging)
        write_sums(staging)


def _model_config(folder: SourceFolder, settings: ImportOptions) -> ModelConfig:
    index = folder.json("model_index.json")
    if folder.has("transformer_2/config.json"):
        raise CheckpointError(
            f"{folder.root}: expected one transformer, got two experts for high and low noise; "
            "use TI2V-5B or a Wan 2.1 model"
        )
    require_class(index, ("WanPipeline", "WanImageToVideoPipeline"), f"{folder.root} (pipeline)")
    transformer = folder.json("transformer/config.json")
    vae = folder.json("vae/config.json")
    text = folder.json("text_encoder/config.json")
    require_class(transformer, (source_config.TRANSFORMER,), "transformer/config.json")
    require_class(vae, (source_config.VAE,), "vae/config.json")
    require_class(text, (source_config.TEXT,), "text_encoder/config.json")
    folder.file(f"tokenizer/{TOKENIZER_FILE}")
    vae_config = source_config.vae_config(vae)
    base = size_by_name(settings.reconstruction)
    config = ModelConfig(
        name=f"wan-{transformer['num_layers']}-blocks",
        frames=settings.frames,
        size_px=settings.size_px or DEFAULT_SIZE_PX.get(vae_config.space_stride, (512, 512)),
        vae=vae_config,
        text=source_config.text_config(text),
        dit=source_config.dit_config(transformer),
        ldrm=replace(base.ldrm, input="latents"),
        deformation=base.deformation,
        activation=base.activation,
    )
    _require_agreement(config, transformer)
    return config


def _require_agreement(config: ModelConfig, transformer: Mapping[str, object]) -> None:
    """Parts of one model: as many channels and as wide text states on both sides."""
    pairs = {
        "out_channels": config.vae.latent_channels,
        "text_dim": config.text.width,
    }
    for name, wanted in pairs.items():
        if transformer.get(name) != wanted:
            raise CheckpointError(
                f"transformer/config.json: expected {name} to be {wanted} as in the other parts, "
                f"got {transformer.get(name)}; the folder mixes models"
            )


def _statistics(folder: SourceFolder, config: ModelConfig) -> dict[str, Tensor]:
    source = folder.json("vae/config.json")
    mean, std = source_config.latent_statistics(source, config.vae.latent_channels)
    return {"latent_mean": torch.tensor(mean), "latent_std": torch.tensor(std)}


def _added(config: ModelConfig, settings: ImportOptions) -> dict[str, Tensor]:
    """Fresh adapters: their last layers are zero, so the model is the public one exactly."""
    dit, added = config.dit, {}
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(settings.seed)
        adapter = CameraAdapter(dit.width, dit.camera_width, config.vae.space_stride)
        render = RenderConditionEmbedding(config.vae.latent_channels, dit.width)
    for prefix, module in zip(ADDED, (adapter, render), strict=True):
        added |= {prefix + key: value for key, value in module.state_dict().items()}
    return added
