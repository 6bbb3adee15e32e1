"""I3D as modules of torch, written apart from the one that ships, with random weights."""

import torch
from torch import Tensor, nn

BRANCHES = {
    "Mixed_3b": (64, (96, 128), (16, 32), 32),
    "Mixed_3c": (128, (128, 192), (32, 96), 64),
    "Mixed_4b": (192, (96, 208), (16, 48), 64),
    "Mixed_4c": (160, (112, 224), (24, 64), 64),
    "Mixed_4d": (128, (128, 256), (24, 64), 64),
    "Mixed_4e": (112, (144, 288), (32, 64), 64),
    "Mixed_4f": (256, (160, 320), (32, 128), 128),
    "Mixed_5b": (256, (160, 320), (32, 128), 128),
    "Mixed_5c": (384, (192, 384), (48, 128), 128),
}


def same_padded(volume: Tensor, kernel: tuple[int, ...], stride: tuple[int, ...]) -> Tensor:
    """As many outputs as inputs over stride, rounded up; the smaller half of the zeros first."""
    sides = []
    for size, k, s in zip(
        reversed(volume.shape[2:]), reversed(kernel), reversed(stride), strict=True
    ):
        outputs = -(-size // s)
        zeros = max((outputs - 1) * s + k - size, 0)
        sides += [zeros // 2, zeros - zeros // 2]
    return nn.functional.pad(volume, sides)


class Unit(nn.Module):
    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int = 1) -> None:
        super().__init__()
        self.conv3d = nn.Conv3d(inputs, outputs, kernel, stride, bias=False)
        self.bn = nn.BatchNorm3d(outputs, eps=1e-3)

    def forward(self, volume: Tensor) -> Tensor:
        padded = same_padded(volume, self.conv3d.kernel_size, self.conv3d.stride)
        return self.bn(self.conv3d(padded)).relu()


class Pool(nn.Module):
    def __init__(self, kernel: tuple[int, ...], stride: tuple[int, ...]) -> None:
        super().__init__()
        self.pool = nn.MaxPool3d(kernel, stride)

    def forward(self, volume: Tensor) -> Tensor:
        return self.pool(same_padded(volume, self.pool.kernel_size, self.pool.stride))


class Mixed(nn.Module):
    def __init__(
        self, inputs: int, b0: int, b1: tuple[int, int], b2: tuple[int, int], b3: int
    ) -> None:
        super().__init__()
        self.b0 = Unit(inputs, b0, 1)
        self.b1a, self.b1b = Unit(inputs, b1[0], 1), Unit(b1[0], b1[1], 3)
        self.b2a, self.b2b = Unit(inputs, b2[0], 1), Unit(b2[0], b2[1], 3)
        self.b3a, self.b3b = Pool((3, 3, 3), (1, 1, 1)), Unit(inputs, b3, 1)

    def forward(self, v: Tensor) -> Tensor:
        parts = [self.b0(v), self.b1b(self.b1a(v)), self.b2b(self.b2a(v)), self.b3b(self.b3a(v))]
        return torch.cat(parts, 1)


class Logits(nn.Module):
    def __init__(self, classes: int) -> None:
        super().__init__()
        self.conv3d = nn.Conv3d(1024, classes, 1)


class OtherI3d(nn.Module):
    """The same names as pytorch-i3d's state."""

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.Conv3d_1a_7x7 = Unit(3, 64, 7, 2)
        self.MaxPool3d_2a_3x3 = Pool((1, 3, 3), (1, 2, 2))
        self.Conv3d_2b_1x1, self.Conv3d_2c_3x3 = Unit(64, 64, 1), Unit(64, 192, 3)
        self.MaxPool3d_3a_3x3 = Pool((1, 3, 3), (1, 2, 2))
        inputs = 192
        for name, branches in BRANCHES.items():
            if name == "Mixed_4b":
                self.MaxPool3d_4a_3x3 = Pool((3, 3, 3), (2, 2, 2))
            if name == "Mixed_5b":
                self.MaxPool3d_5a_2x2 = Pool((2, 2, 2), (2, 2, 2))
            self.add_module(name, Mixed(inputs, *branches))
            inputs = branches[0] + branches[1][1] + branches[2][1] + branches[3]
        self.logits = Logits(classes)

    def forward(self, volume: Tensor) -> Tensor:
        for name, layer in self.named_children():
            if name != "logits":
                volume = layer(volume)
        window = [min(k, s) for k, s in zip((2, 7, 7), volume.shape[2:], strict=True)]
        return self.logits.conv3d(nn.functional.avg_pool3d(volume, window, 1)).mean((2, 3, 4))


def random_i3d(classes: int = 5, seed: int = 0) -> OtherI3d:
    """With normalisation that is not the identity, and scores of ordinary size."""
    torch.manual_seed(seed)
    network = OtherI3d(classes).eval()
    for module in network.modules():
        if isinstance(module, nn.BatchNorm3d):
            nn.init.uniform_(module.weight, 1.0, 2.0)
            nn.init.normal_(module.bias, 0.0, 0.1)
            module.running_mean.normal_(0.0, 0.05)
            module.running_var.uniform_(0.05, 0.2)
    return network
