"""Names and shapes of all weights are frozen: a change makes every stored model unreadable."""

import json
from pathlib import Path

from torch import Tensor

from diff4splat.models.config.sizes import small_size
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks

LOCK = Path(__file__).parents[2] / "contract" / "state_dict_keys.json"
REGENERATE = "python tests/unit/models/test_state_dict_keys.py"


def current_keys() -> dict[str, dict[str, dict[str, str]]]:
    """Size → part → key → shape; ``small`` has every part."""
    return {
        config.name: {
            name: {key: _shape(value) for key, value in sorted(part.state_dict().items())}
            for name, part in create_networks(config, "meta").parts()
        }
        for config in (tiny_size(), small_size())
    }


def _shape(value: Tensor) -> str:
    return " ".join(map(str, value.shape))


def test_names_and_shapes_of_weights_are_frozen() -> None:
    locked = json.loads(LOCK.read_text(encoding="utf-8"))
    assert current_keys() == locked, (
        f"stored models would no longer load; if that is meant: {REGENERATE}"
    )


if __name__ == "__main__":
    LOCK.write_text(json.dumps(current_keys(), indent=1) + "\n", encoding="utf-8")
