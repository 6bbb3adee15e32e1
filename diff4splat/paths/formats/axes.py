"""The one place that turns OpenGL cameras (x right, y up, z back) into OpenCV ones and back.

Axes: ``*b`` batch. Both are right-handed and share x; only the camera side of the pose changes:
world_from_camera(OpenCV) = world_from_camera(OpenGL) · diag(1, −1, −1, 1), its own inverse.
"""

from jaxtyping import Float
from torch import Tensor


def swap_opengl_opencv(world_from_camera: Float[Tensor, "*b 4 4"]) -> Float[Tensor, "*b 4 4"]:
    """The same poses for the other camera axes."""
    signs = world_from_camera.new_tensor([1.0, -1.0, -1.0, 1.0])
    # Adding zero turns -0.0 into 0.0, which reads better in a file.
    return world_from_camera * signs + 0.0
