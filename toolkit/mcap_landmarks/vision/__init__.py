"""Pixels and boxes: images to RGB, letterbox, detector families, NMS, and the ONNX session."""
