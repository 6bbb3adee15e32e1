"""Names and shapes of all weights are frozen: a change makes every stored model unreadable."""

import json
from pathlib import Path

from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks

LOCK = Path(__file__).parents[2] / "contract" / "state_dict_keys.json"
REGENERATE = "python tests/unit/models/test_state_dict_keys.py"


def current_keys() -> dict[str, dict[str, list[int]]]:
    parts = create_networks(tiny_size(), "meta").parts()
    return {
        name: {k: list(v.shape) for k, v in sorted(part.state_dict().items())}
        for name, part in parts
    }


def test_names_and_shapes_of_weights_are_frozen() -> None:
    locked = json.loads(LOCK.read_text(encoding="utf-8"))
    assert current_keys() == locked, (
        f"stored models would no longer load; if that is meant: {REGENERATE}"
    )


if __name__ == "__main__":
    LOCK.write_text(json.dumps(current_keys(), indent=1) + "\n", encoding="utf-8")
