"""A public model, of Wan or CogVideoX, as one of our model folders.

    transformer/   ─ renamed ─ + camera adapter, render condition (zero) ─ dit.safetensors
    vae/           ─────────── + latent mean and standard deviation ────── vae.safetensors
    text_encoder/  ─ renamed ───────────────────────────────────────────── text_encoder.safetensors
    tokenizer/     ─────────────────────────────────────────────────────── tokenizer.json

Weights are copied byte by byte in the type that they have. All configurations and headers are
checked before the first byte is written.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Tensor

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
from diff4splat.models.public_weights.cogvideox_family import COGVIDEOX
from diff4splat.models.public_weights.family import Family, PublicNetworks, WeightSource
from diff4splat.models.public_weights.merge import Shapes, match_keys, write_merged
from diff4splat.models.public_weights.options import ImportOptions
from diff4splat.models.public_weights.shard_files import StoredTensor, stored_tensors
from diff4splat.models.public_weights.source_folder import SourceFolder, require_class
from diff4splat.models.public_weights.wan_family import WAN
from diff4splat.models.video_dit.camera_adapter import CameraAdapter
from diff4splat.models.video_dit.render_condition import RenderConditionEmbedding
from diff4splat.models.wan.tokenizer import TOKENIZER_FILE

__all__ = ["ImportOptions", "PublicModel", "open_public_model", "write_model"]
FAMILIES = (WAN, COGVIDEOX)
OWNED = (CONFIG_FILE, PROVENANCE_FILE, SUMS_FILE, TOKENIZER_FILE)


@dataclass(frozen=True, slots=True, kw_only=True)
class PublicModel:
    """A folder whose weights are all accounted for; none are read yet."""

    folder: SourceFolder
    config: ModelConfig
    tokenizer: bytes
    """Vocabulary of the text encoder, as JSON."""
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
    family = _family(folder)
    public = family.read(folder, settings)
    config, tokenizer = _model_config(public, settings), family.tokenizer(folder)
    fresh: dict[str, Mapping[str, Tensor]] = {part: {} for part in public.sources} | {
        "vae": public.statistics,
        "dit": {
            source.prefix + key: value
            for source in public.sources["dit"]
            for key, value in _added(config, settings).items()
        },
    }
    networks = dict(create_networks(config, "meta", parts=public.sources).parts())
    shapes = {
        part: {key: tuple(value.shape) for key, value in networks[part].state_dict().items()}
        for part in public.sources
    }
    tensors = {
        part: _matched(folder, sources, shapes[part], fresh[part])
        for part, sources in public.sources.items()
    }
    return PublicModel(
        folder=folder,
        config=config,
        tokenizer=tokenizer,
        tensors=tensors,
        fresh=fresh,
        shapes=shapes,
    )


def _family(folder: SourceFolder) -> Family:
    index = folder.json("model_index.json")
    known = {pipeline: family for family in FAMILIES for pipeline in family.pipelines}
    return known[require_class(index, tuple(known), f"{folder.root} (pipeline)")]


def _matched(
    folder: SourceFolder,
    sources: tuple[WeightSource, ...],
    shapes: Shapes,
    fresh: Mapping[str, Tensor],
) -> dict[str, StoredTensor]:
    """Every stored weight of a part under our name."""
    found = {}
    for source in sources:
        wanted = {
            key.removeprefix(source.prefix): shape
            for key, shape in shapes.items()
            if key.startswith(source.prefix) and key not in fresh
        }
        stored = stored_tensors(folder, source.folder)
        where = f"{folder.root / source.folder}"
        matched = match_keys(stored, wanted, source.rename, where)
        found |= {source.prefix + key: tensor for key, tensor in matched.items()}
    return found


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
    name = model.folder.root.resolve().name
    provenance = ModelProvenance(
        trained=frozenset(model.tensors), license=license, origin=f"imported from {name}"
    )
    owned = (*OWNED, *(part_file(Path(), part).name for part in model.tensors))
    with atomic_folder(out, owned) as staging:
        for part, tensors in model.tensors.items():
            file = part_file(staging, part)
            write_merged(tensors, model.fresh[part], model.shapes[part], file, advance)
        (staging / TOKENIZER_FILE).write_bytes(model.tokenizer)
        write_text(staging / CONFIG_FILE, model.config.to_json())
        write_provenance(provenance, staging)
        write_sums(staging)


def _model_config(public: PublicNetworks, settings: ImportOptions) -> ModelConfig:
    base = size_by_name(settings.reconstruction)
    return ModelConfig(
        name=public.name,
        frames=settings.frames,
        size_px=settings.size_px or public.size_px,
        vae=public.vae,
        text=public.text,
        dit=public.dit,
        joint=public.joint,
        image_encoder=public.image_encoder,
        ldrm=replace(base.ldrm, input="latents"),
        deformation=base.deformation,
        activation=base.activation,
    )


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
