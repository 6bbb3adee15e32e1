"""Public depth networks that this program can run: address, licence, size and hash.

Sizes and hashes are those that public repositories state for these very files. Where none states a
hash it is None: the first download records it, and later ones are compared with that.
"""

from dataclasses import dataclass

from diff4splat.errors import ConfigError

PERMISSIVE = frozenset({"Apache-2.0", "MIT"})


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelFile:
    """One file of a model."""

    name: str
    """In the cache."""
    address: str
    bytes: int | None = None
    sha256: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PublicModel:
    """A model that others trained and published."""

    name: str
    what: str
    license: str
    megabytes: int
    """About, of all files."""
    files: tuple[ModelFile, ...]
    """The graph first."""
    source: str
    """Page of the publisher."""

    @property
    def permissive(self) -> bool:
        """Whether any use is allowed."""
        return self.license in PERMISSIVE


_COMMUNITY = "https://huggingface.co/onnx-community"
CATALOG = (
    PublicModel(
        name="depth-anything-v2-small",
        what="Depth Anything V2 small: inverse depth, 518 px",
        license="Apache-2.0",
        megabytes=99,
        source=f"{_COMMUNITY}/depth-anything-v2-small",
        files=(
            ModelFile(
                name="model.onnx",
                address=f"{_COMMUNITY}/depth-anything-v2-small/resolve/"
                "4472b7362082ad9968fee890ca0f1e5aca36b93d/onnx/model.onnx",
                bytes=99_060_839,
                sha256="afb6a5c28f3b6bf1618c6e43f02073ef9dfdc70e937502d51603e57b0a1df10c",
            ),
        ),
    ),
    PublicModel(
        name="moge-2-vits",
        what="MoGe-2 ViT-S: depth in metres",
        license="MIT",
        megabytes=141,
        source="https://huggingface.co/Ruicheng/moge-2-vits-normal-onnx",
        files=(
            ModelFile(
                name="model.onnx",
                address="https://huggingface.co/Ruicheng/moge-2-vits-normal-onnx/resolve/"
                "e50ffda41565591092adea54c6ac83d6212e1e23/model.onnx",
                bytes=140_852_051,
                sha256="24eacb5dc7a2c54c7bc98f7de085ffbed79ad006ea5b664c2c2cdc02ff3a52f0",
            ),
        ),
    ),
    PublicModel(
        name="midas-v21-small",
        what="MiDaS v2.1 small: inverse depth, 256 px, fast",
        license="MIT",
        megabytes=67,
        source="https://github.com/isl-org/MiDaS/releases/tag/v2_1",
        files=(
            ModelFile(
                name="model.onnx",
                address="https://github.com/isl-org/MiDaS/releases/download/v2_1/model-small.onnx",
                bytes=66_764_249,
                sha256="2d8c6cb8f415229daf1eb041024208e2608c9f98e17c81cc7c6ecb449c56fd58",
            ),
        ),
    ),
    PublicModel(
        name="depth-anything-v3-small",
        what="Depth Anything 3 small: depth up to a factor",
        license="Apache-2.0",
        megabytes=106,
        source=f"{_COMMUNITY}/depth-anything-v3-small",
        files=(
            ModelFile(
                name="model.onnx",
                address=f"{_COMMUNITY}/depth-anything-v3-small/resolve/main/onnx/model.onnx",
            ),
            ModelFile(
                name="model.onnx_data",
                address=f"{_COMMUNITY}/depth-anything-v3-small/resolve/main/onnx/model.onnx_data",
            ),
        ),
    ),
    PublicModel(
        name="depth-anything-v2-base",
        what="Depth Anything V2 base: inverse depth, 518 px",
        license="CC-BY-NC-4.0",
        megabytes=389,
        source=f"{_COMMUNITY}/depth-anything-v2-base",
        files=(
            ModelFile(
                name="model.onnx",
                address=f"{_COMMUNITY}/depth-anything-v2-base/resolve/main/onnx/model.onnx",
            ),
        ),
    ),
    PublicModel(
        name="depth-pro",
        what="Depth Pro in 4 bits: depth in metres, 1536 px",
        license="apple-ascl",
        megabytes=746,
        source=f"{_COMMUNITY}/DepthPro-ONNX",
        files=(
            ModelFile(
                name="model.onnx",
                address=f"{_COMMUNITY}/DepthPro-ONNX/resolve/main/onnx/model_q4.onnx",
            ),
        ),
    ),
)


def find_model(name: str) -> PublicModel:
    """The model of that name.

    Raises:
        ConfigError: there is none.
    """
    for model in CATALOG:
        if model.name == name:
            return model
    names = ", ".join(model.name for model in CATALOG)
    raise ConfigError(f"model: expected one of {names}, got {name!r}")
