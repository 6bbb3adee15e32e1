"""What a client may ask of a generation; each limit is stated in the API's description."""

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from diff4splat.errors import Diff4SplatError
from diff4splat.paths.language import parse_path, require_short_of_near

MAX_PROMPT_BYTES = 512


def _camera(text: str) -> str:
    """Presets alone: a server opens no file that a client names."""
    try:
        require_short_of_near(parse_path(text, None))
    except Diff4SplatError as error:
        raise ValueError(str(error)) from error
    return text


def _prompt(text: str | None) -> str | None:
    if text is None:
        return None
    if not text.strip():
        raise ValueError("expected some text, got none; leave the prompt out")
    if len(text.encode("utf-8", "surrogatepass")) > MAX_PROMPT_BYTES:
        raise ValueError(f"expected at most {MAX_PROMPT_BYTES} bytes of UTF-8")
    return text


class JobOptions(BaseModel):
    """The options of ``diff4splat generate`` that a client may set."""

    model_config = ConfigDict(extra="forbid")

    camera: Annotated[
        str, Field(max_length=200, pattern=r"^[a-z0-9:.+\-]+$"), AfterValidator(_camera)
    ] = "spiral"
    """Presets joined by +, such as arc:0.2 or orbit:0.05+up."""
    prompt: Annotated[
        str | None, Field(min_length=1, max_length=MAX_PROMPT_BYTES), AfterValidator(_prompt)
    ] = None
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    frames: Annotated[int, Field(ge=2, le=240)] = 49
    resolution: Annotated[int | None, Field(ge=64, le=1024)] = None
    fov: Annotated[float | None, Field(ge=1, le=170)] = None
    fit: Literal["crop", "pad"] = "crop"
    fill: Literal["none", "video"] | None = None
    still: bool = False
    steps: Annotated[int | None, Field(ge=1, le=100)] = None
    guidance: Annotated[float | None, Field(ge=0, le=30)] = None
