"""Camera path files as pure functions between text and CameraPath; one module per format."""
