"""Generation over HTTP: a queue of jobs, worker processes, and the graphs of an ONNX model."""
