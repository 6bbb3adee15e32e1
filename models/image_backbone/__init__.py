"""Image backbone: EfficientNet-Lite0, whose public weights have seen a million photographs."""
