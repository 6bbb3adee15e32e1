"""What a depth network takes and gives, recognised from its graph.

A row of ``RULES`` is a family of public exports. Graphs that none fits are refused with what they
have, unless their metadata states the contract (``METADATA``).
"""

import json
import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import get_args

from diff4splat.errors import FileFormatError
from diff4splat.models.depth_priors.graph_facts import GraphFacts, TensorFacts
from diff4splat.models.depth_priors.kinds import DepthKind

IMAGENET = ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))
HALF = ((0.5, 0.5, 0.5), (0.5, 0.5, 0.5))
PLAIN = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
METADATA = "diff4splat.depth"
"""Key of a graph's metadata with a contract in JSON, fields as in ``DepthContract``."""
NORMALISING = frozenset({"Sub", "Div", "Mul", "Add"})
PASSING = frozenset({"Cast", "Identity", "Reshape", "Unsqueeze", "Squeeze", "Transpose", "Pad"})
"""Operators between the image and the first layer that change nothing of its values."""
_MOST_STEPS = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthContract:
    """How an image becomes the input, and what the output is."""

    family: str
    input: str
    output: str
    kind: DepthKind
    mean: tuple[float, float, float] = PLAIN[0]
    std: tuple[float, float, float] = PLAIN[1]
    """Of RGB in [0, 1]."""
    side_px: int = 518
    """Of the input, where the graph leaves it free."""
    multiple_px: int = 14
    square: bool = False
    """Whether the image is stretched to a square, as the network was trained."""
    fov: str = ""
    """Output with the horizontal field of view in degrees, of canonical inverse depth."""
    mask: str = ""
    scale: str = ""
    """Outputs of point maps: what is known, and metres per unit."""
    tokens: str = ""
    """Input that asks for a number of tokens."""


def recognise(file: Path, facts: GraphFacts) -> DepthContract:
    """The contract of a graph.

    Raises:
        FileFormatError: its inputs and outputs fit none that is known.
    """
    if METADATA in facts.metadata:
        return _stated(file, facts)
    for rule in RULES:
        contract = rule(facts)
        if contract is not None:
            return contract
    raise FileFormatError(
        f"{file}: expected a depth network (Depth Anything, MiDaS, DPT, Depth Pro, MoGe: an image "
        f"in, depth out), got inputs {_listed(facts.inputs)} and outputs {_listed(facts.outputs)}; "
        "run it elsewhere and give its depth map"
    )


def _moge(facts: GraphFacts) -> DepthContract | None:
    """MoGe-2: RGB in [0, 1] and tokens in; points, mask and a metric scale out."""
    image, outputs = _image(facts), _names(facts.outputs)
    scale = next((name for name in ("metric_scale", "scale") if name in outputs), "")
    if image is None or not {"points", "mask"} <= outputs or not scale:
        return None
    tokens = "num_tokens" if "num_tokens" in _names(facts.inputs) else ""
    return DepthContract(
        family="MoGe", input=image.name, output="points", kind="metric", mask="mask", scale=scale,
        tokens=tokens,
    )  # fmt: skip


def _depth_pro(facts: GraphFacts) -> DepthContract | None:
    """Canonical inverse depth with a field of view, or depth in metres with a focal length."""
    image, outputs = _image(facts), _names(facts.outputs)
    names = {"predicted_depth", "depth"} & outputs
    marks = {"field_of_view", "fov", "fov_deg", "focallength_px"} & outputs
    if image is None or len(names) != 1 or len(marks) != 1:
        return None
    mark = marks.pop()
    return DepthContract(
        family="Depth Pro", input=image.name, output=names.pop(), kind="metric", mean=HALF[0],
        std=HALF[1], side_px=1536, multiple_px=1, square=True,
        fov="" if mark == "focallength_px" else mark,
    )  # fmt: skip


def _depth_anything_3(facts: GraphFacts) -> DepthContract | None:
    """An axis of views, or cameras beside the depth; z up to a factor."""
    image, outputs = _image(facts), _names(facts.outputs)
    names = {"predicted_depth", "depth"} & outputs
    marks = {"intrinsics", "extrinsics", "sky", "confidence", "predicted_confidence"} & outputs
    if image is None or len(names) != 1 or not (len(image.shape) == 5 or marks):
        return None
    return DepthContract(
        family="Depth Anything 3", input=image.name, output=names.pop(), kind="relative",
        mean=IMAGENET[0], std=IMAGENET[1], side_px=504, multiple_px=14,
    )  # fmt: skip


def _one_map(facts: GraphFacts) -> DepthContract | None:
    """One image in, one map out: Depth Anything, DPT or MiDaS, by the first layer of the graph."""
    image = _image(facts)
    if image is None or len(facts.inputs) != 1 or len(facts.outputs) != 1:
        return None
    output = facts.outputs[0]
    if not _is_map(output):
        return None
    kernel, normalised = _first_layer(facts, image.name)
    named = {image.name, output.name} & {"pixel_values", "predicted_depth", "image", "depth"}
    contract = DepthContract(
        family="Depth Anything", input=image.name, output=output.name, kind="inverse",
        mean=IMAGENET[0], std=IMAGENET[1],
    )  # fmt: skip
    if kernel == 14:
        found = contract
    elif named and kernel is not None:
        found = replace(
            contract, family="DPT", mean=HALF[0], std=HALF[1], side_px=384, multiple_px=32
        )
    elif set(image.shape[2:]) <= {256, 384} and kernel is not None:
        side_px = image.shape[2]
        found = replace(contract, family="MiDaS", side_px=side_px, multiple_px=32, square=True)
    else:
        return None
    return replace(found, mean=PLAIN[0], std=PLAIN[1]) if normalised else found


RULES: tuple[Callable[[GraphFacts], DepthContract | None], ...] = (
    _moge, _depth_pro, _depth_anything_3, _one_map,
)  # fmt: skip


def _stated(file: Path, facts: GraphFacts) -> DepthContract:
    """The contract in the graph's own metadata."""
    known = {one.name for one in fields(DepthContract)}
    try:
        record = json.loads(facts.metadata[METADATA])
        contract = DepthContract(
            **{
                name: tuple(map(float, value)) if name in ("mean", "std") else value
                for name, value in record.items()
            }
        )
        valid = set(record) <= known and contract.kind in get_args(DepthKind)
        valid &= len(contract.mean) == len(contract.std) == 3 and min(contract.std) > 0
        valid &= all(map(math.isfinite, (*contract.mean, *contract.std)))
        valid &= contract.input in _names(facts.inputs) and contract.output in _names(facts.outputs)
        valid &= 1 <= contract.multiple_px <= contract.side_px <= 4096
    except (TypeError, ValueError, AttributeError, RecursionError):
        valid = False
    if not valid:
        raise FileFormatError(
            f"{file}: expected a contract with {', '.join(sorted(known))} in its metadata "
            f"{METADATA!r}, got {facts.metadata[METADATA][:80]!r}; correct it"
        )
    return contract


def _image(facts: GraphFacts) -> TensorFacts | None:
    """The one input that can be an image of three channels, if all others have a known name."""
    images = [
        one
        for one in facts.inputs
        if len(one.shape) in (4, 5) and one.shape[-3] in (3, None) and one.dtype in FLOATS
    ]
    others = _names(facts.inputs) - {one.name for one in images}
    return images[0] if len(images) == 1 and others <= {"num_tokens"} else None


FLOATS = ("float32", "float16")


def _is_map(output: TensorFacts) -> bool:
    """One value per pixel, or a shape that the file leaves open."""
    shape = [axis for axis in output.shape if axis != 1]
    return len(shape) <= 4 and (len(output.shape) != 4 or output.shape[1] in (1, None))


def _first_layer(facts: GraphFacts, image: str) -> tuple[int | None, bool]:
    """(side of the kernel of the first convolution, whether values are normalised before it)."""
    queue = deque([(image, False)])
    for _ in range(_MOST_STEPS):
        if not queue:
            break
        value, normalised = queue.popleft()
        for node in (one for one in facts.nodes if value in one.inputs and one.outputs):
            if node.operator == "Conv" and len(node.inputs) > 1:
                shape = facts.weight_shapes.get(node.inputs[1], ())
                return (shape[2] if len(shape) == 4 else None), normalised
            if node.operator in NORMALISING | PASSING:
                queue.append((node.outputs[0], normalised or node.operator in NORMALISING))
    return None, False


def _names(tensors: tuple[TensorFacts, ...]) -> set[str]:
    return {one.name for one in tensors}


def _listed(tensors: tuple[TensorFacts, ...]) -> str:
    return ", ".join(_described(tensors)) or "none"


def _described(tensors: tuple[TensorFacts, ...]) -> Iterator[str]:
    for one in tensors[:6]:
        yield f"{one.name[:40]!r} {list('?' if axis is None else axis for axis in one.shape)}"
