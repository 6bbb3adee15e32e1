"""A depth network in an ONNX file: checked when made, opened with the first image."""

import hashlib
from pathlib import Path

import numpy as np
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import FileFormatError
from diff4splat.io.file_digest import file_sha256
from diff4splat.models.depth_priors.contracts import DepthContract, recognise
from diff4splat.models.depth_priors.graph_facts import read_graph_facts
from diff4splat.models.depth_priors.graph_safety import require_safe
from diff4splat.models.depth_priors.kinds import DepthKind, DepthMap
from diff4splat.models.depth_priors.point_maps import point_map_depth
from diff4splat.models.depth_priors.preprocessing import network_input
from diff4splat.models.onnx.session import open_session, run_session

TOKENS = 1800
"""Of MoGe's inputs; its exports state the same."""
INVERSE_RANGE = (1e-4, 1e4)
"""Of canonical inverse depth, before it is inverted."""
MOST_PIXELS = 1 << 26
"""Of an output."""


class OnnxDepthPrior:
    """Depth of an image by a network that others trained.

    Raises:
        FileFormatError: no graph, an unsafe one, or one of no known contract.
    """

    def __init__(self, file: Path, kind: DepthKind | None = None) -> None:
        self.file = file
        facts = read_graph_facts(file)
        require_safe(file, facts)
        self.contract: DepthContract = recognise(file, facts)
        self.kind: DepthKind = kind or self.contract.kind
        self.image = next(one for one in facts.inputs if one.name == self.contract.input)
        self.external = tuple(sorted(facts.external_files))
        self._session = None

    @property
    def title(self) -> str:
        """What it is, in words."""
        return f"{self.contract.family} in {self.file.name}"

    def predict(self, rgb: Float[Tensor, "h w 3"], focal_px: tuple[float, float]) -> DepthMap:
        """Depth at the network's own size; ``focal_px`` is (f_x, f_y) of the image.

        Raises:
            FileFormatError: the graph cannot be run, or gives no depth.
        """
        contract = self.contract
        pixels = network_input(contract, self.image, rgb.cpu())
        inputs = {contract.input: pixels.numpy()}
        if contract.tokens:
            inputs[contract.tokens] = np.array(TOKENS, dtype=np.int64)
        names = [contract.output, contract.fov, contract.mask, contract.scale]
        self._session = self._session or open_session(self.file, threads=1)
        found = run_session(self._session, self.file, inputs, list(filter(None, names)))
        size_px = (pixels.shape[-2], pixels.shape[-1])
        scale = tuple(size_px[1 - axis] / rgb.shape[1 - axis] for axis in (0, 1))
        values = self._depth(found, tuple(f * s for f, s in zip(focal_px, scale, strict=True)))
        self._require_depth(values)
        return DepthMap(values=values, kind=self.kind, source=self.title)

    def sha256(self) -> str:
        """Digest of the graph, and of its external weights after it."""
        digest = hashlib.sha256()
        for file in (self.file, *(self.file.parent / name for name in self.external)):
            digest.update(bytes.fromhex(file_sha256(file)))
        if self.external:
            return digest.hexdigest()
        return file_sha256(self.file)

    def _depth(self, found: dict[str, np.ndarray], focal_px: tuple[float, float]) -> np.ndarray:
        contract, values = self.contract, found[self.contract.output]
        if contract.scale:
            points = values.reshape(values.shape[-3:])
            if points.shape[-1] != 3 or points.size == 0:
                raise FileFormatError(
                    f"{self.file}: expected points of three numbers, got {list(values.shape)}"
                )
            known = found[contract.mask].reshape(points.shape[:2]) > 0.5
            metres = float(found[contract.scale].reshape(-1)[0])
            return point_map_depth(points, known, focal_px) * np.float32(metres)
        if values.ndim < 2 or values.size > MOST_PIXELS or 0 in values.shape:
            raise FileFormatError(
                f"{self.file}: expected a map of depth, got the shape {list(values.shape)}; "
                "export the network again"
            )
        if values.size != values.shape[-1] * values.shape[-2]:
            raise FileFormatError(
                f"{self.file}: expected one map of depth, got the shape {list(values.shape)}"
            )
        values = values.reshape(values.shape[-2:]).astype(np.float32)
        if not contract.fov:
            return values
        fov = np.radians(float(found[contract.fov].reshape(-1)[0]))
        # Canonical inverse depth is that of a camera whose focal length is the image's width.
        canonical = values * np.float32(2 * np.tan(fov / 2))
        return 1 / np.clip(canonical, *INVERSE_RANGE)

    def _require_depth(self, values: np.ndarray) -> None:
        masked = bool(self.contract.mask)
        wrong = np.isinf(values) if masked else ~np.isfinite(values)
        if wrong.any():
            raise FileFormatError(
                f"{self.file}: expected finite depth, got NaN or infinity in {int(wrong.sum()):,} "
                f"of {values.size:,} pixels; export the network in float32"
            )
