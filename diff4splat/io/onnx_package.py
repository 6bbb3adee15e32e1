"""The package onnx (the extra ``onnx``), imported here alone."""

from types import ModuleType

from diff4splat.errors import MissingExtraError


def onnx_package() -> ModuleType:
    """The module, with ``helper`` and ``numpy_helper``.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import onnx
        import onnx.helper
        import onnx.numpy_helper
    except ImportError as error:
        raise MissingExtraError(
            "ONNX: expected the package onnx, got none; pip install 'diff4splat[onnx]'"
        ) from error
    return onnx
