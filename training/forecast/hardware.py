"""GPUs that forecasts are made for: data-sheet numbers, and the shares of them that runs reach."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Gpu:
    """One kind of GPU, eight to a machine."""

    name: str
    memory_bytes: float
    flops: float
    """Dense bfloat16 operations per second."""
    memory_rate: float
    """Bytes per second."""
    machine_rate: float
    """Bytes per second between GPUs of one machine, each way."""
    network_rate: float
    """Bytes per second between machines, per GPU."""

    def link_rate(self, count: int) -> float:
        """Bytes per second that the slowest link of ``count`` GPUs carries."""
        return self.machine_rate if count <= PER_MACHINE else self.network_rate


PER_MACHINE = 8
FLOPS_SHARE = 0.4
"""Of the data sheet, as large models reach (PaLM 46 %, Llama 3 38 to 43 %)."""
RATE_SHARE = 0.6
"""Of memory and links."""
MEMORY_SHARE = 0.9
"""The rest goes to the CUDA context and to gaps."""
H100 = Gpu(
    name="H100 80 GB",
    memory_bytes=80e9,
    flops=989e12,
    memory_rate=3.35e12,
    machine_rate=450e9,
    network_rate=50e9,
)
