"""Pixels and boxes: images to RGB, letterbox, the YOLOv5 contract, decoding, NMS, and the ONNX session."""
