"""Networks for robots and other simulators: as ONNX, and as a C header that needs nothing else."""
