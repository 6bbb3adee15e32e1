"""One row per world and variant, out of the cards."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def table(out: Path, variants: Mapping[str, tuple[str, ...]], facts: Mapping[str, float]) -> str:
    """Markdown; worlds and variants without a card are left out."""
    lines = [
        "| world | variant | held out, dB | SSIM | learnt from, dB | Gaussians (moving) | s | MB |",
        "|---|---|---|---|---|---|---|---|",
    ]
    means: dict[str, list[float]] = {}
    for world, mean_db in facts.items():
        lines.append(
            f"| {world} | mean picture of each camera | {mean_db:.1f} (not held out) | | | | | |"
        )
        for variant in variants:
            card = read_card(out / world / variant.replace(" ", "-"))
            if card is not None:
                lines.append(_row(world, variant, card))
                means.setdefault(variant, []).append(card["held_out"]["psnr_db"])
    for variant, values in means.items():
        mean = sum(values) / len(values)
        lines.append(f"| mean of {len(values)} | {variant} | {mean:.2f} | | | | | |")
    return "\n".join(lines) + "\n"


def read_card(folder: Path) -> dict[str, Any] | None:
    file = folder / "card.json"
    return json.loads(file.read_text()) if file.exists() else None


def _row(world: str, variant: str, card: Mapping[str, Any]) -> str:
    held, scene = card["held_out"], card["scene"]
    return (
        f"| {world} | {variant} | {held['psnr_db']:.2f} | {held['ssim']:.3f} "
        f"| {card['training']['psnr_db']:.2f} | {scene['gaussians']:,} "
        f"({scene['moving_gaussians']:,}) | {card['seconds_fitting']:.0f} "
        f"| {card['peak_memory_bytes'] / 1e6:.0f} |"
    )
