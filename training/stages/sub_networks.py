"""Networks that stages train alone although they lie inside a part of the model."""

from torch import nn

from diff4splat.models.factory import Networks


def depth_network(networks: Networks) -> nn.Module:
    """Monocular depth: raw depth maps of single images."""
    return networks.ldrm.detail.picture_depth


def motion_network(networks: Networks) -> nn.Module:
    """The motion U-Net: clean motion, and the motion mask, of a first image and a caption."""
    return networks.dit.motion_branch


def train_only(part: nn.Module, network: nn.Module) -> None:
    """Freeze a part except for one network inside it."""
    part.requires_grad_(False)
    network.requires_grad_(True)
