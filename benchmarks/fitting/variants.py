"""What is compared: both motions, no motion, and the motion field with one part taken away."""

VARIANTS: dict[str, tuple[str, ...]] = {
    "hexplane": ("--motion", "hexplane"),
    "spacetime": ("--motion", "spacetime"),
    "static": ("--motion", "static"),
}
ABLATIONS: dict[str, tuple[str, ...]] = {
    "full": ("--motion", "hexplane"),
    # Planes of two nodes are linear: the network sees little more than coordinates.
    "no planes": (
        "--motion", "hexplane", "--set", "planes.space=[2,2,2]", "planes.time=2",
        "planes.multipliers=[1]",
    ),
    "no position head": (
        "--motion", "hexplane", "--set", 'decoder.heads=["rotation","scale","opacity","color"]',
    ),
    "no coarse stage": ("--motion", "hexplane", "--set", "coarse_steps=0"),
}  # fmt: skip
