"""One frame at a smaller size: colour by area, everything else by the nearest pixel."""

from dataclasses import replace

import cv2
import numpy as np

from diff4splat.data_prep.datasets.common.sequence import FlowMap, FrameMaps


def reduced_size(size_px: tuple[int, int], max_side_px: int | None) -> tuple[int, int]:
    """(height, width) whose longer side is at most ``max_side_px``."""
    longer = max(size_px)
    if max_side_px is None or longer <= max_side_px:
        return size_px
    height, width = (max(1, round(side * max_side_px / longer)) for side in size_px)
    return height, width


def resized_frame(frame: FrameMaps, size_px: tuple[int, int]) -> FrameMaps:
    """The frame at another (height, width)."""
    height, width = frame.rgb.shape[:2]
    if (height, width) == size_px:
        return frame
    rows = ((np.arange(size_px[0]) + 0.5) * height / size_px[0]).astype(int)
    columns = ((np.arange(size_px[1]) + 0.5) * width / size_px[1]).astype(int)
    picked = np.ix_(rows, columns)
    factor = np.float32([size_px[1] / width, size_px[0] / height])

    def nearest(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else np.ascontiguousarray(values[picked])

    def flow(flow: FlowMap | None) -> FlowMap | None:
        if flow is None:
            return None
        return FlowMap(
            offset_px=nearest(flow.offset_px) * factor,
            known=nearest(flow.known),
            visible=nearest(flow.visible),
        )

    return replace(
        frame,
        rgb=cv2.resize(frame.rgb, size_px[::-1], interpolation=cv2.INTER_AREA),
        depth=nearest(frame.depth),
        sky=nearest(frame.sky),
        labels=nearest(frame.labels),
        to_next=flow(frame.to_next),
        to_previous=flow(frame.to_previous),
    )
